//! `jacks`: three crossed cylinders with spheres at their ends, and eight copies of half the size in the octants.

use glam::DVec3;

use super::{
    object::{SpdScene, SpdSurface},
    rotate::rotated,
};

/// Size of a jack in its cube.
const FIT: f64 = 0.75;

pub(super) fn make(scene: &mut SpdScene) {
    scene.look([0.0, 0.0, -8.0], [0.0; 3], [0.0, 1.0, 0.0]);
    scene.view.angle_deg = 25.0;
    scene.light(&[[-10.0, 3.0, -20.0]]);
    scene.background = DVec3::new(0.2, 0.05, 0.2);
    let pink = scene.surface(SpdSurface {
        color: DVec3::new(0.737, 0.561, 0.561),
        diffuse: 0.7,
        specular: 0.7,
        shine: 20.0,
        ..SpdSurface::MATT
    });
    grow(scene, pink, scene.size, DVec3::ZERO, 1.0);
}

/// From the object's own axes to the scene's.
fn turned(p: DVec3) -> DVec3 {
    rotated(rotated(p, DVec3::Y, -(20.0f64.to_radians())), DVec3::X, -(30.0f64.to_radians()))
}

fn grow(scene: &mut SpdScene, surface: u32, depth: u32, center: DVec3, half: f64) {
    let place = |offset: DVec3| turned(center + offset * (FIT * half));
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        scene.add_cylinder(surface, place(-axis), place(axis), 0.1 * FIT * half);
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z] {
        scene.add_sphere(surface, place(axis), 0.2 * FIT * half);
    }
    if depth > 1 {
        for i in [-0.5, 0.5] {
            for j in [-0.5, 0.5] {
                for k in [-0.5, 0.5] {
                    grow(scene, surface, depth - 1, center + DVec3::new(i, j, k) * half, half / 2.0);
                }
            }
        }
    }
}
