//! H2: an axis-aligned lattice of boxes, with directions and origins that make NaN, infinities and denormal reciprocals.

use kinora::{geom::Ray, glam::Vec3};

use crate::{
    meshes::{cuboid, together},
    trace::{Mesh, Random},
    trial::{Trial, count},
};

/// Components that break reciprocals.
const TINY: [f32; 8] = [0.0, -0.0, 1e-45, -1e-45, 1e-38, -1e-38, 1e-7, -1e-7];

/// n^3 boxes of half the spacing 1, the first at 0.
fn lattice(n: u32) -> Mesh {
    let place = |i: u32| Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
    together((0..n * n * n).map(|i| cuboid(place(i), place(i) + 0.5)))
}

/// Rays with one or two tiny components; origins on planes of the boxes, halfway, or anywhere.
fn tiny_rays(n: usize, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let mut dir = random.vec3();
        if random.below(3) == 0 {
            dir = dir.signum();
        }
        let axis = random.below(3);
        for k in 0..=random.below(2) {
            dir[(axis + k) % 3] = TINY[random.below(TINY.len())];
        }
        let mut origin = (random.vec3() + 1.0) * (n as f32 * 0.6) - 0.2;
        for axis in 0..3 {
            match random.below(4) {
                // On a plane of boxes, or in the middle of a box.
                0 | 1 => origin[axis] = random.below(2 * n + 1) as f32 * 0.5 - 0.5,
                2 => origin[axis] = random.below(4 * n) as f32 * 0.25,
                _ => {}
            }
        }
        Ray::new(origin, dir)
    };
    (first..first + len).map(ray).collect()
}

#[test]
fn h02_rays_with_zero_and_denormal_components_are_answered_exactly() {
    let n = count(6, 6, 2) as u32;
    let mesh = lattice(n);
    let trial = Trial { name: "H2", mesh: &mesh, rays: count(1_000_000, 8_000, 200), refitted: true };
    let results = trial.run(|first, len| tiny_rays(n as usize, first, len));
    assert!(results.iter().all(|(_, found)| found.hits > found.rays / 4 && found.hits < found.rays));
}
