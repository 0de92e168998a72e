//! `rings`: objects of six interlocked pentagons, in layers that grow away from the eye.

use std::f64::consts::{FRAC_PI_3, FRAC_PI_8, PI};

use glam::DVec3;

use super::{
    object::{SpdScene, SpdSurface},
    rotate::{on_circle, rotated},
};

/// Radius of the cylinders and spheres of an object that fits into a sphere of radius 1.
const RADIUS: f64 = 0.07412;
/// Colours of the six rings.
const COLORS: [[f64; 3]; 6] =
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]];

pub(super) fn make(scene: &mut SpdScene) {
    let spread = 1.0 / libm::sin(FRAC_PI_8);
    let eye = DVec3::new(-1.0, -spread, 0.5);
    scene.look(eye.to_array(), (eye + DVec3::Y).to_array(), [0.0, 0.0, 1.0]);
    scene.light(&[[3.0, -spread, 3.0], [-4.0, -spread, 1.0], [2.0, -spread, -4.0]]);
    add_wall(scene, eye, spread);

    let surfaces = COLORS.map(|color| {
        let color = DVec3::from_array(color);
        scene.surface(SpdSurface { color, diffuse: 0.5, specular: 0.2, shine: 37.0, ..SpdSurface::MATT })
    });
    let rings = pentagons();
    for depth in 0..scene.size {
        let place = |i: u32| f64::from(2 * i) - f64::from(depth);
        for z in 0..=depth {
            for x in 0..=depth {
                let offset = DVec3::new(place(x), spread * f64::from(depth + 1), place(z));
                for (ring, &surface) in rings.iter().zip(&surfaces) {
                    add_ring(scene, surface, &ring.map(|p| p + offset));
                }
            }
        }
    }
}

/// The wall behind everything: what the view spans, and one part in a hundred more.
fn add_wall(scene: &mut SpdScene, eye: DVec3, spread: f64) {
    let white = scene.surface(SpdSurface::MATT);
    let y = spread * f64::from(scene.size + 1);
    let half = 1.01 * (y - eye.y) * libm::tan(FRAC_PI_8);
    let corner = |(x, z): (f64, f64)| DVec3::new(eye.x + x * half, y, eye.z + z * half);
    scene.add_polygon(white, [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(corner));
}

/// A pentagon in the plane z = 0, and five that are tilted by the angle between a dodecahedron's faces and turned about
/// z.
fn pentagons() -> [[DVec3; 5]; 6] {
    let flat: [DVec3; 5] = std::array::from_fn(|i| on_circle(i as f64 * 2.0 * PI / 5.0) / (1.0 + RADIUS));
    let tilt = 2.0 * libm::acos(libm::cos(FRAC_PI_3) / libm::sin(PI / 5.0));
    std::array::from_fn(|k| match k {
        0 => flat,
        _ => flat.map(|p| rotated(rotated(p, DVec3::X, tilt), DVec3::Z, PI * (2.0 * (k - 1) as f64 + 1.0) / 5.0)),
    })
}

/// From each corner a cylinder to the one before it, and a sphere.
fn add_ring(scene: &mut SpdScene, surface: u32, corners: &[DVec3; 5]) {
    for (i, &corner) in corners.iter().enumerate() {
        scene.add_cylinder(surface, corner, corners[(i + 4) % 5], RADIUS);
        scene.add_sphere(surface, corner, RADIUS);
    }
}
