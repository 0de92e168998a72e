//! `balls`: each sphere carries nine of a third of its radius.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use glam::DVec3;

use super::{
    object::{SpdScene, SpdSurface},
    rotate::{rotated, turned},
};

/// Radius of a child over that of its parent.
const RATIO: f64 = 1.0 / 3.0;

pub(super) fn make(scene: &mut SpdScene) {
    scene.look([2.1, 1.3, 1.7], [0.0; 3], [0.0, 0.0, 1.0]);
    scene.light(&[[4.0, 3.0, 2.0], [1.0, -4.0, 4.0], [-3.0, 1.0, 5.0]]);
    let floor = scene.surface(SpdSurface { color: DVec3::new(1.0, 0.75, 0.33), diffuse: 0.8, ..SpdSurface::MATT });
    scene.add_polygon(
        floor,
        [(12.0, 12.0), (-12.0, 12.0), (-12.0, -12.0), (12.0, -12.0)].map(|(x, y)| DVec3::new(x, y, -0.5)),
    );
    let mirror = scene.surface(SpdSurface {
        color: DVec3::new(1.0, 0.9, 0.7),
        diffuse: 0.5,
        specular: 0.5,
        shine: 37.0,
        ..SpdSurface::MATT
    });
    let flake = Flake { directions: directions(), surface: mirror };
    flake.grow(scene, scene.size, DVec3::ZERO, 0.5, DVec3::Z);
}

/// Where the nine children of a sphere that points along +Z sit.
fn directions() -> [DVec3; 9] {
    let s = FRAC_1_SQRT_2;
    let axis = DVec3::new(s, -s, 0.0);
    let tilt = libm::asin(2.0 / 6.0f64.sqrt());
    let trio = [DVec3::new(s, s, 0.0), DVec3::new(s, 0.0, -s), DVec3::new(0.0, s, -s)].map(|v| rotated(v, axis, tilt));
    std::array::from_fn(|i| rotated(trio[i % 3], DVec3::Z, (i / 3) as f64 * 2.0 * PI / 3.0))
}

struct Flake {
    directions: [DVec3; 9],
    surface: u32,
}

impl Flake {
    fn grow(&self, scene: &mut SpdScene, depth: u32, center: DVec3, radius: f64, direction: DVec3) {
        scene.add_sphere(self.surface, center, radius);
        if depth == 0 {
            return;
        }
        for &child in &self.directions {
            let towards = from_z(child, direction);
            self.grow(scene, depth - 1, center + towards * (radius * (1.0 + RATIO)), radius * RATIO, towards);
        }
    }
}

/// `v` under the rotation that takes +Z to the unit vector `direction`: about their common normal, about Y when they
/// are opposite.
fn from_z(v: DVec3, direction: DVec3) -> DVec3 {
    let axis = DVec3::Z.cross(direction);
    let sin = axis.length();
    // Rounding leaves directions near an end of the axis, where their normal means nothing.
    if sin > 1e-9 {
        turned(v, axis / sin, direction.z, sin)
    } else if direction.z > 0.0 {
        v
    } else {
        DVec3::new(-v.x, v.y, -v.z)
    }
}
