//! `tree`: every branch ends in two thinner, shorter ones.
//!
//! # Source
//! M. Aono and T. L. Kunii, "Botanical Tree Image Generation", 1984, with the package's angles.

use glam::DVec3;

use super::{
    object::{SpdScene, SpdShape, SpdSurface},
    rotate::rotated,
};

/// Angle from the parent's direction and divergence around it, in degrees, and length over the parent's.
const BRANCHES: [(f64, f64, f64); 2] = [(40.0, 90.0, 0.65), (25.0, 230.0, 0.70)];
/// Diameter over the parent's, and of a branch's end over that of its start.
const THINNER: f64 = 0.67;
/// Radius of the trunk's foot over its length.
const WIDTH: f64 = 0.15;

pub(super) fn make(scene: &mut SpdScene) {
    scene.look([4.5, 0.4, 2.0], [0.0, 0.0, 1.5], [0.0, 0.0, 1.0]);
    scene.light(&[
        [-5.0, 5.0, 50.0],
        [30.0, -30.0, 30.0],
        [-40.0, -30.0, 20.0],
        [10.0, 30.0, 40.0],
        [-30.0, 40.0, 10.0],
        [50.0, 25.0, 20.0],
        [-10.0, -60.0, 30.0],
    ]);
    let grass = scene.surface(SpdSurface { color: DVec3::new(0.2, 0.7, 0.2), ..SpdSurface::MATT });
    scene.add_polygon(
        grass,
        [(50.0, 50.0), (-50.0, 50.0), (-50.0, -50.0), (50.0, -50.0)].map(|(x, y)| DVec3::new(x, y, 0.0)),
    );
    let wood = scene.surface(SpdSurface { color: DVec3::new(0.55, 0.4, 0.2), ..SpdSurface::MATT });
    let branches = BRANCHES.map(|(angle, divergence, length)| {
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            let tilted = rotated(axis, DVec3::X, angle.to_radians());
            rotated(tilted, DVec3::Z, divergence.to_radians()) * length
        })
    });
    let trunk = Place { foot: DVec3::ZERO, axes: [DVec3::X, DVec3::Y, DVec3::Z] };
    grow(scene, wood, &branches, &trunk, 1.0, scene.size);
}

/// A branch's own coordinates in the scene: it runs from (0, 0, 0) to (0, 0, 1).
struct Place {
    foot: DVec3,
    axes: [DVec3; 3],
}

impl Place {
    fn vector(&self, v: DVec3) -> DVec3 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }
}

fn grow(scene: &mut SpdScene, surface: u32, branches: &[[DVec3; 3]; 2], place: &Place, scale: f64, depth: u32) {
    let base_radius = WIDTH * scale;
    let apex_radius = base_radius * THINNER;
    let apex = place.foot + place.axes[2];
    scene.add(surface, SpdShape::Cone { base: place.foot, base_radius, apex, apex_radius });
    scene.add_sphere(surface, apex, apex_radius);
    if depth > 0 {
        for axes in branches {
            let child = Place { foot: apex, axes: axes.map(|axis| place.vector(axis)) };
            grow(scene, surface, branches, &child, scale * THINNER, depth - 1);
        }
    }
}
