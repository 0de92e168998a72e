//! Colours of the figure, as a function of the place on its rest surface.

use glam::DVec3;

use super::body::{Body, Stuff};

/// sRGB colour in [0, 1] at `p`.
pub fn color(body: &Body, p: DVec3) -> DVec3 {
    match body.stuff(p) {
        Stuff::Skin => DVec3::new(0.87, 0.66, 0.53),
        Stuff::Hair => DVec3::new(0.23, 0.15, 0.11),
        Stuff::Hoodie => DVec3::new(0.90, 0.52, 0.18),
        Stuff::Trousers => DVec3::new(0.19, 0.25, 0.36),
        Stuff::Shoe if p.y < 0.030 => DVec3::new(0.93, 0.92, 0.89),
        Stuff::Shoe => DVec3::new(0.16, 0.48, 0.50),
    }
}

/// A linear colour with alpha from an sRGB one.
pub fn linear(color: DVec3) -> [f64; 4] {
    let decode = |c: f64| if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) };
    [decode(color.x), decode(color.y), decode(color.z), 1.0]
}
