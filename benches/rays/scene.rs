//! Scenes and sets of rays: read from files, or made.

use std::{io, path::Path};

use kinora::{geom::Ray, glam::Vec3};

use crate::{first_hit, meshes, peers::Peer};

/// A mesh, and sets of rays if they were read.
pub(crate) struct Scene {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) indices: Vec<[u32; 3]>,
    read: Vec<Rays>,
}

/// Rays of one kind.
pub(crate) struct Rays {
    pub(crate) name: &'static str,
    /// Whether anything is hit, not what.
    pub(crate) is_any: bool,
    pub(crate) all: Vec<Ray>,
}

/// Names of sets, of their files, and whether any hit will do.
const SETS: [(&str, &str, bool); 4] =
    [("primary", "primary_t8", false), ("ao", "ao", true), ("diffuse", "diffuse", false), ("shadow", "shadow", true)];

/// Numbers of a file behind its eight bytes of head.
fn numbers(path: &Path) -> io::Result<Vec<f32>> {
    let bytes = std::fs::read(path)?;
    let (numbers, _) = bytes.get(8..).unwrap_or_default().as_chunks::<4>();
    Ok(numbers.iter().map(|&number| f32::from_le_bytes(number)).collect())
}

impl Scene {
    /// A folder of the measured scenes.
    pub(crate) fn read(folder: &Path) -> io::Result<Self> {
        let corners = numbers(&folder.join("frame_0000.tris"))?;
        let positions: Vec<_> = corners.as_chunks::<3>().0.iter().map(|&p| Vec3::from(p)).collect();
        let indices = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut read = Vec::new();
        for (name, file, is_any) in SETS {
            let path = folder.join("r0000").join(file).with_extension("rays");
            if !path.exists() {
                println!("no rays in {}", path.display());
                continue;
            }
            let records = numbers(&path)?;
            let ray = |&[ox, oy, oz, t_near, dx, dy, dz, t_far]: &[f32; 8]| Ray {
                origin: Vec3::new(ox, oy, oz),
                t_near,
                dir: Vec3::new(dx, dy, dz),
                t_far,
            };
            read.push(Rays { name, is_any, all: records.as_chunks::<8>().0.iter().map(ray).collect() });
        }
        Ok(Self { positions, indices, read })
    }

    /// A dented sphere; rays are made of what is hit.
    pub(crate) fn sphere(side: usize) -> Self {
        let meshes::Mesh { positions, indices } = meshes::dented_sphere(side, 0.0);
        Self { positions, indices, read: Vec::new() }
    }

    /// The sets of rays; `first` finds what the first of them hit.
    pub(crate) fn sets(self, first: &dyn Peer) -> Vec<Rays> {
        if !self.read.is_empty() {
            return self.read;
        }
        let primary = meshes::camera_rays(256);
        let mut state = 7_u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / 8_388_608.0 - 1.0
        };
        let mut sets = SETS.map(|(name, _, is_any)| Rays { name, is_any, all: Vec::new() });
        for ray in &primary {
            let Some((_, t)) = first_hit(first, *ray) else { continue };
            let point = ray.origin + ray.dir * (t * 0.9999);
            let away = loop {
                let dir = Vec3::new(unit(), unit(), unit());
                if dir.length_squared() <= 1.0 && dir.dot(point) > 0.0 {
                    break dir;
                }
            };
            sets[1].all.push(Ray { t_far: 0.5, ..Ray::new(point, away) });
            sets[2].all.push(Ray::new(point, away));
            sets[3].all.push(Ray { t_far: 1.0, ..Ray::new(point, Vec3::new(2.0, 3.0, 2.5) - point) });
        }
        sets[0].all = primary;
        sets.into()
    }
}
