//! H9: flat geometry exactly on the planes of splits, slabs and cells, and gears, whose lists hold many equal events.

use kinora::{geom::Ray, glam::Vec3};

use crate::{
    meshes::{builtin_mesh, mapped, plane, together},
    trace::{Mesh, Random},
    trial::{Trial, count},
};

/// Plates across all three axes at every multiple of `size / n`: where medians, centroid bins and cells of any power of two
/// have their planes. The corners of the whole make its box [0, size]^3 exactly.
fn plates(n: u32, size: f32) -> Mesh {
    let step = size / n as f32;
    let place = |i: u32| {
        let height = (i / 3 + 1) as f32 * step;
        mapped(&plane(4), move |p| {
            let (x, y) = ((p.x + 1.0) * 0.5 * size, (p.y + 1.0) * 0.5 * size);
            [Vec3::new(x, y, height), Vec3::new(height, x, y), Vec3::new(y, height, x)][(i % 3) as usize]
        })
    };
    together((0..3 * (n - 1)).map(place))
}

/// Rays along the axes, in the plates' planes, through their edges, and any way; origins on planes as well as between.
fn rays(size: f32, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let mut origin = (random.vec3() * 0.7 + 0.5) * size;
        for axis in 0..3 {
            if random.below(2) == 0 {
                origin[axis] = random.below(17) as f32 / 16.0 * size;
            }
        }
        let mut dir = random.vec3();
        match i % 3 {
            // Along an axis.
            0 => {
                let axis = random.below(3);
                dir[(axis + 1) % 3] = [0.0, -0.0][random.below(2)];
                dir[(axis + 2) % 3] = [0.0, -0.0][random.below(2)];
            }
            // Along a diagonal, from plane to plane at once.
            1 => dir = dir.signum(),
            _ => {}
        }
        Ray::new(origin, dir)
    };
    (first..first + len).map(ray).collect()
}

#[test]
fn h09_plates_on_the_planes_of_the_structures_are_answered_exactly() {
    for (name, n, size) in [("H9 plates, 16", 16, 16.0), ("H9 plates, 12", 12, 0.75)] {
        let mesh = plates(n, size);
        let trial = Trial { name, mesh: &mesh, rays: count(500_000, 4_000, 60), refitted: true };
        trial.run(|first, len| rays(size, first, len));
    }
}

#[test]
fn h09_a_single_plate_without_depth_is_answered_exactly() {
    let mesh = plane(8);
    let trial = Trial { name: "H9 plate", mesh: &mesh, rays: count(500_000, 4_000, 60), refitted: true };
    trial.run(|first, len| {
        let mut rays = rays(2.0, first, len);
        for ray in &mut rays {
            ray.origin -= 1.0;
        }
        rays
    });
}

#[test]
fn h09_gears_are_answered_exactly() {
    let mesh = builtin_mesh(if count(2, 1, 0) == 2 { "spd-gears" } else { "spd-gears:1" });
    let bounds = kinora::geom::Aabb::from_points(mesh.positions.iter().copied());
    let trial = Trial { name: "H9 gears", mesh: &mesh, rays: count(500_000, 5_000, 50), refitted: true };
    trial.run(|first, len| {
        let ray = |i: usize| {
            let mut random = Random(i as u64);
            let [a, b, c] = mesh.corners(random.below(mesh.indices.len()));
            let target = [a, (a + b) * 0.5, (a + b + c) / 3.0][i % 3];
            let mut away = random.vec3();
            if i.is_multiple_of(2) {
                away = Vec3::from_array([0, 1, 2].map(|k| if k == i / 2 % 3 { away[k] } else { 0.0 }));
            }
            Ray::new(target + away * bounds.diagonal(), -away)
        };
        (first..first + len).map(ray).collect()
    });
}
