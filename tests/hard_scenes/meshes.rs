//! Meshes of the scenes.

use std::collections::HashMap;

use kinora::{glam::Vec3, report::Subject, scene::builtin};

use crate::trace::{Mesh, Random};

/// A closed sphere of radius 1 around the origin: an icosahedron subdivided `levels` times, 20 * 4^levels triangles.
pub(crate) fn icosphere(levels: u32) -> Mesh {
    let g = 1.618_034;
    let corners = [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)];
    let mut positions: Vec<Vec3> = corners.iter().map(|&(a, b)| Vec3::new(a, b, 0.0)).collect();
    positions.extend(corners.iter().map(|&(a, b)| Vec3::new(0.0, a, b)));
    positions.extend(corners.iter().map(|&(a, b)| Vec3::new(b, 0.0, a)));
    for p in &mut positions {
        *p /= p.length();
    }
    let mut indices = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut next = Vec::with_capacity(indices.len() * 4);
        for [a, b, c] in indices {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    let p = positions[i as usize] + positions[j as usize];
                    positions.push(p / p.length());
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        indices = next;
    }
    Mesh { positions, indices }
}

/// A grid of n x n squares over [-1, 1] x [-1, 1] at the height z = 0, two triangles each.
pub(crate) fn plane(n: u32) -> Mesh {
    let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    let positions = (0..=n).flat_map(|y| (0..=n).map(move |x| Vec3::new(at(x), at(y), 0.0))).collect();
    let square = move |i: u32| {
        let a = i / n * (n + 1) + i % n;
        [[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]
    };
    Mesh { positions, indices: (0..n * n).flat_map(square).collect() }
}

/// The twelve triangles of a box.
pub(crate) fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let corner = |i: usize| Vec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 1 { max[a] } else { min[a] }));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    Mesh { positions: (0..8).map(corner).collect(), indices: quads.into_iter().flat_map(halves).collect() }
}

/// Several meshes as one, in order.
pub(crate) fn together(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(mesh.positions);
        all.indices.extend(mesh.indices.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

/// The mesh with every vertex moved.
pub(crate) fn mapped(mesh: &Mesh, to: impl Fn(Vec3) -> Vec3) -> Mesh {
    Mesh { positions: mesh.positions.iter().map(|&p| to(p)).collect(), indices: mesh.indices.clone() }
}

/// The mesh with every vertex off by up to a fiftieth of its box: what a refit comes from. (`accel_conformance` refits from heaps without
/// any order, whose trees are too slow for large meshes.)
pub(crate) fn displaced(mesh: &Mesh) -> Mesh {
    let mut random = Random(7);
    let bounds = kinora::geom::Aabb::from_points(mesh.positions.iter().copied().filter(|p| p.is_finite()));
    let half = bounds.max * 0.5 - bounds.min * 0.5;
    let (low, high) = (bounds.min, bounds.max);
    let positions = mesh.positions.iter().map(|&p| (p + half * random.vec3() * 0.02).clamp(low, high)).collect();
    Mesh { positions, indices: mesh.indices.clone() }
}

/// Every triangle of a built-in scene at rest.
pub(crate) fn builtin_mesh(name: &str) -> Mesh {
    let scene = builtin::load(name).expect("a built-in scene");
    let subject = Subject::from_scene(name, &scene);
    Mesh { positions: subject.positions, indices: subject.indices }
}
