//! H6: coplanar duplicates and layers a few units in the last place apart: every structure names the same triangle.

use kinora::{geom::Ray, glam::Vec3, simd::SimdLevel};

use crate::{
    fast::{self, FAST},
    meshes::{mapped, plane, together},
    trace::{Mesh, Random, closest_as},
    trial::{Candidate, Mistakes, Trial, candidates, count},
};

/// Units in the last place between the layers and the lowest one; equal ones are duplicates.
const ULPS: [u32; 8] = [0, 8, 1, 2, 0, 8, 2, 1];

/// Copies of a plane at z = 1 and some units in the last place above, each with its own triangles.
fn layers(n: u32) -> Mesh {
    let at = |ulps: u32| mapped(&plane(n), |p| Vec3::new(p.x, p.y, f32::from_bits(1.0_f32.to_bits() + ulps)));
    together(ULPS.map(at))
}

/// Copies of a tilted plane: no coordinate is exact, and the duplicates still are.
fn tilted(n: u32) -> Mesh {
    let at = |ulps: u32| {
        mapped(&plane(n), |p| {
            let p = p.x * Vec3::new(0.36, 0.48, -0.8) + p.y * Vec3::new(0.8, -0.6, 0.0) + Vec3::new(0.1, 0.2, 0.3);
            Vec3::new(p.x, p.y, f32::from_bits(p.z.to_bits() + ulps))
        })
    };
    together(ULPS.map(at))
}

fn rays(mesh: &Mesh, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let [a, b, c] = mesh.corners(random.below(mesh.indices.len()));
        let target = [a, (a + b) * 0.5, (a + b + c) / 3.0, b + (c - b) * 0.3][i % 4];
        // Straight down, straight up, and any way; from beside the layers as well as from afar.
        let away = match i % 3 {
            0 => Vec3::Z,
            1 => Vec3::NEG_Z,
            _ => random.vec3(),
        };
        Ray::new(target + away * [2.0, 0.25][i % 2], -away)
    };
    (first..first + len).map(ray).collect()
}

#[test]
fn h06_coplanar_layers_are_told_apart_alike_by_every_structure() {
    for (name, mesh) in [("H6 level", layers(8)), ("H6 tilted", tilted(8))] {
        let trial = Trial { name, mesh: &mesh, rays: count(500_000, 2_000, 60), refitted: true };
        trial.run(|first, len| rays(&mesh, first, len));
    }
}

/// Exact names the lowest of the triangles met first (above); fast names what comes first by its own rounding, which is not the same in all structures.
#[test]
fn h06_structures_disagree_in_fast_no_more_than_listed() {
    for (name, mesh) in [("level", layers(8)), ("tilted", tilted(8))] {
        let rays = rays(&mesh, 0, count(100_000, 4_000, 60));
        let of = |c: &Candidate| closest_as(&c.accel, &mesh.prims(), &rays, SimdLevel::best(), FAST);
        let named: Vec<Vec<_>> = candidates(&mesh, true)
            .iter()
            .filter(|c| !c.slow)
            .map(|c| of(c).iter().map(|h| h.map(|h| h.prim)).collect())
            .collect();
        let differ = (0..rays.len()).filter(|&i| named.iter().any(|of| of[i] != named[0][i])).count() as u64;
        println!(
            "H6 alike, {name}: fast: {differ} of {} rays are answered differently by {} structures",
            rays.len(),
            named.len()
        );
        let found = Mistakes { rays: rays.len() as u64, wrong: differ, ..Mistakes::default() };
        fast::check("H6 alike", "all structures", &found);
    }
}
