//! H1: no ray from inside a closed sphere escapes, wherever it is aimed.

use kinora::{geom::Ray, glam::Vec3};

use crate::{
    meshes::icosphere,
    trace::{Mesh, Random},
    trial::{Trial, count},
};

/// Rays `first..first + len` from inside: a third each at vertices, at the middles of edges and anywhere; half of them from
/// the very centre, from where directions to vertices are the vertices themselves.
pub(crate) fn from_inside(mesh: &Mesh, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let corners = mesh.corners(random.below(mesh.indices.len()));
        let origin = if i.is_multiple_of(2) { Vec3::ZERO } else { random.vec3() * 0.4 };
        match i % 3 {
            0 => Ray::new(origin, corners[random.below(3)] - origin),
            1 => Ray::new(origin, (corners[0] + corners[1]) * 0.5 - origin),
            _ => Ray::new(origin, random.vec3()),
        }
    };
    (first..first + len).map(ray).collect()
}

#[test]
fn h01_no_ray_leaks_from_a_closed_sphere() {
    let levels = count(7, 5, 2) as u32;
    let mesh = icosphere(levels);
    let trial = Trial { name: "H1", mesh: &mesh, rays: count(10_000_000, 40_000, 300), refitted: true };
    for (name, found) in trial.run(|first, len| from_inside(&mesh, first, len)) {
        assert_eq!(found.hits, found.rays, "{name}: a closed mesh is met from inside");
    }
}
