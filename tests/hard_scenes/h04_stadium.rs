//! H4: contrast of scale, which grids fear: a teapot of size 1 in a stadium of size 10^5, and a tree on its field.

use kinora::{
    geom::{Aabb, Ray},
    glam::Vec3,
};

use crate::{
    meshes::{builtin_mesh, icosphere, mapped, plane, together},
    trace::{Mesh, Random},
    trial::{Trial, count},
};

/// Half the stadium's size.
const STADIUM: f32 = 1e5;

/// A teapot of size 1 on the ground of a bowl.
fn teapot_in_stadium(size: u32) -> (Mesh, usize) {
    let teapot = builtin_mesh(&format!("spd-teapot:{size}"));
    let bounds = Aabb::from_points(teapot.positions.iter().copied());
    let teapot = mapped(&teapot, |p| (p - bounds.min) / bounds.diagonal() + Vec3::new(0.3, 0.01, 0.2));
    let ground = mapped(&plane(8), |p| Vec3::new(p.x, 0.0, p.y) * STADIUM);
    let bowl = mapped(&icosphere(4), |p| p * Vec3::new(STADIUM, STADIUM * 0.4, STADIUM));
    let count = teapot.indices.len();
    (together([teapot, ground, bowl]), count)
}

/// Rays from a camera beside the small thing, across the large one, and from afar at the small one.
fn rays(mesh: &Mesh, small: usize, size: f32, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let corners = mesh.corners(random.below(small));
        let target = (corners[0] + corners[1] + corners[2]) / 3.0;
        match i % 4 {
            0 | 1 => {
                let origin = target + random.vec3() * 3.0;
                Ray::new(origin, target - origin)
            }
            2 => Ray::new(target + random.vec3().abs() * 2.0, random.vec3()),
            _ => {
                let origin = Vec3::new(random.unit(), random.unit().abs() * 0.3, random.unit()) * (size * 0.6);
                Ray::new(origin, target - origin)
            }
        }
    };
    (first..first + len).map(ray).collect()
}

#[test]
fn h04_a_teapot_in_a_stadium_is_answered_exactly() {
    let (mesh, small) = teapot_in_stadium(count(12, 6, 2) as u32);
    let trial = Trial { name: "H4 stadium", mesh: &mesh, rays: count(1_000_000, 5_000, 60), refitted: true };
    trial.run(|first, len| rays(&mesh, small, STADIUM, first, len));
}

#[test]
fn h04_a_tree_on_its_field_is_answered_exactly() {
    let mesh = builtin_mesh(if count(2, 1, 0) == 2 { "spd-tree" } else { "spd-tree:4" });
    let small = mesh.indices.len();
    let trial = Trial { name: "H4 tree", mesh: &mesh, rays: count(1_000_000, 5_000, 60), refitted: true };
    trial.run(|first, len| rays(&mesh, small, 100.0, first, len));
}
