//! `gears`: a block of meshed gears over a mirroring floor.

use std::f64::consts::PI;

use glam::DVec3;

use super::{
    object::{SpdScene, SpdSurface},
    rotate::on_circle,
};

/// Teeth of a gear.
const TEETH: u32 = 36;
/// Radius of the teeth's tips, a little less than the gear's place, so that gears keep apart.
const OUTER: f64 = 0.995;
/// Radius between the teeth.
const INNER: f64 = 0.9;
/// Corners of a tooth: part of the pitch from its middle, and whether it is a tip.
const TOOTH: [(f64, bool); 4] = [(-0.19, true), (0.19, true), (0.3, false), (0.7, false)];

pub(super) fn make(scene: &mut SpdScene) {
    scene.look([-1.1, -2.1, 2.6], [0.0; 3], [0.0, 0.0, 1.0]);
    scene.light(&[[2.0, 4.0, 4.0], [-2.0, 4.0, 3.0], [2.0, -2.5, 2.5], [-1.0, -4.0, 2.0], [-1.111, -2.121, 2.626]]);
    let ground = scene.surface(SpdSurface {
        color: DVec3::new(1.0, 0.85, 0.7),
        diffuse: 0.3,
        specular: 0.6,
        shine: 37.0,
        ..SpdSurface::MATT
    });
    scene.add_polygon(ground, [(2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (2.0, -2.0)].map(|(x, y)| DVec3::new(x, y, 0.0)));

    let size = f64::from(scene.size);
    let radius = 1.0 / (size - (size - 1.0) * (1.0 - INNER) / 2.0);
    let first = DVec3::new(radius - 1.0, radius - 1.0, 1.0);
    let step = DVec3::new(radius * (1.0 + INNER), radius * (1.0 + INNER), -1.0 / size);
    let thickness = (1.0 / (2.0 * size)).min(0.1);
    for z in 0..scene.size {
        for y in 0..scene.size {
            for x in 0..scene.size {
                let surface = scene.surface(material(x, y, z));
                let center = first + step * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                let turn = PI * f64::from((x + y + z) % 2) / f64::from(TEETH);
                add_gear(scene, surface, center, turn, radius, thickness);
            }
        }
    }
}

/// Colours by place, brought to full brightness; every fifth gear is of glass.
fn material(x: u32, y: u32, z: u32) -> SpdSurface {
    let channel = |sum: u32, factor: u32| 0.01 + f64::from(sum * factor % 7) / 7.0;
    let color = DVec3::new(
        channel(3 * x + 2 * y + z + 1, 5),
        channel(3 * y + 2 * z + x + 1, 3),
        channel(3 * z + 2 * x + y + 1, 2),
    );
    let color = color / color.max_element();
    if (4 * x + 2 * y + z).is_multiple_of(5) {
        SpdSurface { color, diffuse: 0.2, transmittance: 0.8, ior: 1.1, two_sided: true, ..SpdSurface::MATT }
    } else {
        SpdSurface { color, ..SpdSurface::MATT }
    }
}

/// Corners of a face, counter-clockwise seen from +Z, or clockwise when `sense` is -1.
fn outline(center: DVec3, turn: f64, radius: f64, sense: f64) -> Vec<DVec3> {
    let pitch = 2.0 * PI / f64::from(TEETH);
    let corner = |k: u32, (part, tip): (f64, bool)| {
        let angle = turn + sense * pitch * (f64::from(k) + part);
        center + on_circle(angle) * (radius * if tip { OUTER } else { INNER })
    };
    (0..TEETH).flat_map(|k| TOOTH.map(|at| corner(k, at))).collect()
}

fn add_gear(scene: &mut SpdScene, surface: u32, center: DVec3, turn: f64, radius: f64, thickness: f64) {
    let top = outline(center, turn, radius, 1.0);
    let down = DVec3::new(0.0, 0.0, -thickness);
    scene.add_polygon(surface, top.clone());
    for (i, &corner) in top.iter().enumerate() {
        let next = top[(i + 1) % top.len()];
        scene.add_polygon(surface, [corner, corner + down, next + down, next]);
    }
    scene.add_polygon(surface, outline(center + down, turn, radius, -1.0));
}
