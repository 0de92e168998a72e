//! `lattice`: spheres at the points of a cubic lattice, joined by cylinders, seen from within.

use glam::DVec3;

use super::object::{SpdScene, SpdSurface};

/// Radius of a sphere over the lattice's step.
const SPHERE: f64 = 1.0 / 4.0;
/// Radius of a cylinder over the lattice's step.
const CYLINDER: f64 = 1.0 / 16.0;
/// Part of a sphere's radius at which the cylinders end inside it: 0.99 (1 - sqrt(1/16 / (1/4))).
const INSET: f64 = 0.99 * 0.5;

pub(super) fn make(scene: &mut SpdScene) {
    let n = scene.size;
    let step = 1.0 / f64::from(n);
    let column = (f64::from(n / 2) + 0.5) * step;
    scene.look([column, 1.0, 1.0 - step / 2.0], [column, -1.0, -1.0 - step / 2.0], [0.2, 1.0, 0.0]);
    scene.view.angle_deg = 60.0;
    scene.light(&[
        [2.0, 0.5, 0.5],
        [-1.0, 0.5, 0.5],
        [0.5, 2.0, 0.5],
        [0.5, -1.0, 0.5],
        [0.5, 0.5, 2.0],
        [0.5, 0.5, -1.0],
    ]);

    let gray = SpdSurface { color: DVec3::splat(0.9), diffuse: 0.5, specular: 0.5, shine: 37.0, ..SpdSurface::MATT };
    let gray = scene.surface(gray);
    let rods = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
        let color = axis * 0.8 + 0.1;
        (axis, scene.surface(SpdSurface { color, diffuse: 0.99, ..SpdSurface::MATT }))
    });
    let inset = INSET * SPHERE * step;
    let coordinates = || (0..=n).map(|i| f64::from(i) / f64::from(n));
    for x in coordinates() {
        for y in coordinates() {
            for z in coordinates() {
                let at = DVec3::new(x, y, z);
                scene.add_sphere(gray, at, SPHERE * step);
                for (axis, surface) in rods {
                    if at.dot(axis) < 1.0 {
                        scene.add_cylinder(surface, at + axis * inset, at + axis * (step - inset), CYLINDER * step);
                    }
                }
            }
        }
    }
}
