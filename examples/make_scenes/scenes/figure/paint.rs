//! Colour, roughness and relief of the figure, as functions of the place on its rest surface.

use glam::DVec3;

use super::{
    body::{Body, Stuff},
    rig::{ARM, ARM_DIR, Joint, mirror},
};
use crate::scenes::maths::{fractal, mix, smoothstep};

/// What a texel looks like.
#[derive(Clone, Copy)]
pub struct Finish {
    /// sRGB in [0, 1].
    pub color: DVec3,
    /// Perceptual roughness.
    pub roughness: f64,
}

const SKIN: DVec3 = DVec3::new(0.88, 0.66, 0.53);
const BLUSH: DVec3 = DVec3::new(0.90, 0.54, 0.44);
const INK: DVec3 = DVec3::new(0.10, 0.07, 0.06);
const WHITE: DVec3 = DVec3::new(0.95, 0.94, 0.91);
const HAIR: DVec3 = DVec3::new(0.27, 0.17, 0.12);
const HOODIE: DVec3 = DVec3::new(0.91, 0.54, 0.17);
const TROUSERS: DVec3 = DVec3::new(0.18, 0.24, 0.35);
const SHOE: DVec3 = DVec3::new(0.14, 0.47, 0.49);

/// Lower edge of the hoodie and upper edge of its ribbed hem.
pub const HEM: [f64; 2] = [0.862, 0.902];
/// Height of the shoe's sole.
const SOLE: f64 = 0.030;

/// Looks of the surface at `p`.
pub fn finish(body: &Body, p: DVec3) -> Finish {
    let (color, roughness) = match stuff(body, p) {
        Stuff::Skin if p.y > 1.33 => face(p),
        Stuff::Skin => (SKIN, 0.55),
        Stuff::Hair => (HAIR * mix(0.85, 1.12, strand(p)), 0.42),
        Stuff::Hoodie => hoodie(p),
        Stuff::Trousers => trousers(p),
        Stuff::Shoe => shoe(p),
    };
    Finish { color, roughness }
}

/// The garment at `p`; between hoodie and trousers the hem decides.
pub fn stuff(body: &Body, p: DVec3) -> Stuff {
    match body.stuff(p) {
        Stuff::Hoodie | Stuff::Trousers if p.x.abs() < 0.25 => {
            if p.y > HEM[0] {
                Stuff::Hoodie
            } else {
                Stuff::Trousers
            }
        }
        // The hoodie's band runs a little way up the neck.
        Stuff::Skin if on_neck(p) && body.distance_to(Stuff::Hoodie, p) < BAND => Stuff::Hoodie,
        other => other,
    }
}

/// How far the neck's band reaches.
const BAND: f64 = 0.011;

fn on_neck(p: DVec3) -> bool {
    p.y > 1.2 && p.y < 1.335 && p.x.abs() < 0.1
}

/// 1 inside a shape whose signed distance is `d`, over an edge 1 mm wide.
fn inside(d: f64) -> f64 {
    1.0 - smoothstep(-0.000_6, 0.000_6, d)
}

/// How far outside an axis-aligned ellipse in x and y, in metres, nearly.
fn ellipse(p: DVec3, center: [f64; 2], radii: [f64; 2]) -> f64 {
    let (x, y) = ((p.x - center[0]) / radii[0], (p.y - center[1]) / radii[1]);
    ((x * x + y * y).sqrt() - 1.0) * radii[0].min(radii[1])
}

fn face(p: DVec3) -> (DVec3, f64) {
    let (mut color, mut roughness) = (SKIN, 0.52);
    let half = DVec3::new(p.x.abs(), p.y, p.z);
    let cheek = DVec3::new(half.x - 0.062, (p.y - 1.428) * 1.3, 0.0).length();
    color = color.lerp(BLUSH, 0.55 * (1.0 - smoothstep(0.0, 0.034, cheek)) * smoothstep(0.03, 0.06, p.z));
    color = color.lerp(BLUSH, ear_tint(half));
    if p.z < 0.03 {
        return (color, roughness);
    }
    let mut ink = |d: f64, paint: DVec3, rough: f64| {
        color = color.lerp(paint, inside(d));
        roughness = mix(roughness, rough, inside(d));
    };
    let brow = half.y - 1.5155 - 0.012 * (1.0 - ((half.x - 0.046) / 0.026) * ((half.x - 0.046) / 0.026));
    ink((brow.abs() - 0.0042).max((half.x - 0.047).abs() - 0.024), HAIR * 0.8, 0.6);
    let eye = [0.0440, 1.4690];
    ink(ellipse(half, eye, [0.0160, 0.0222]), WHITE, 0.25);
    ink(ellipse(half, [0.0432, 1.4682], [0.0132, 0.0195]), DVec3::new(0.25, 0.38, 0.33), 0.15);
    ink(ellipse(half, [0.0432, 1.4682], [0.0102, 0.0158]), INK, 0.12);
    ink(ellipse(p, [0.0478, 1.4760], [0.0040, 0.0052]), WHITE, 0.2);
    ink(ellipse(p, [-0.0386, 1.4760], [0.0040, 0.0052]), WHITE, 0.2);
    let lid = ellipse(half, eye, [0.0168, 0.0230]).abs() - 0.0013;
    ink(lid.max(1.474 - p.y), INK, 0.4);
    let smile = p.y - 1.3985 - 7.0 * p.x * p.x;
    ink((smile.abs() - 0.0019).max(half.x - 0.0275), DVec3::new(0.50, 0.22, 0.19), 0.45);
    (color, roughness)
}

/// A little red on the ears.
fn ear_tint(half: DVec3) -> f64 {
    0.35 * smoothstep(0.119, 0.130, half.x)
}

/// Streaks along the hair, in [0, 1].
fn strand(p: DVec3) -> f64 {
    let swept = p.z * 0.8 + p.y * 0.6;
    fractal(DVec3::new(p.x * 95.0 + 9.0 * p.y, swept * 7.0, 3.0))
}

/// Distance along the arm and from the shoulder, for either side.
fn along_arm(p: DVec3) -> f64 {
    let left = if p.x < 0.0 { mirror(p) } else { p };
    (left - Joint::UpperArmL.position()).dot(ARM_DIR)
}

fn hoodie(p: DVec3) -> (DVec3, f64) {
    let mut color = HOODIE;
    let on_sleeve = along_arm(p) > 0.045 && p.x.abs() > 0.165;
    if on_sleeve {
        let s = along_arm(p);
        color = color.lerp(WHITE, inside((s - 0.120).abs() - 0.013));
        color = color.lerp(SHOE, inside((s - 0.152).abs() - 0.008));
    } else {
        color = color.lerp(WHITE, inside((p.y - 1.128).abs() - 0.016));
        color = color.lerp(SHOE, inside((p.y - 1.094).abs() - 0.008));
    }
    let cord = (p.x.abs() - 0.024 - 0.05 * (1.24 - p.y)).abs() - 0.0034;
    if p.z > 0.0 && p.y > 1.150 && p.y < 1.244 {
        color = color.lerp(if p.y < 1.162 { SHOE } else { WHITE }, inside(cord));
    }
    let rib = ribbed(p);
    color = color.lerp(HOODIE * 0.86, if rib { 1.0 } else { 0.0 });
    color *= mix(1.0, 0.8, inside(pocket(p).abs() - 0.0022));
    (color, 0.86)
}

/// True on the knitted hem and cuffs.
fn ribbed(p: DVec3) -> bool {
    let s = along_arm(p);
    if p.x.abs() > 0.25 { s > ARM[0] + ARM[1] - 0.034 } else { p.y < HEM[1] && p.y > HEM[0] }
}

/// Signed distance to the outline of the pocket on the belly.
fn pocket(p: DVec3) -> f64 {
    if p.z < 0.03 {
        return 1.0;
    }
    let slope = 0.105 - 0.62 * (p.y - 0.945).max(0.0);
    (p.x.abs() - slope).max((p.y - 0.962).abs() - 0.048)
}

fn trousers(p: DVec3) -> (DVec3, f64) {
    let leg_x = p.x.abs() - Joint::ThighL.position().x;
    let seam = inside((p.z + 0.003).abs() - 0.0016) * smoothstep(0.03, 0.04, leg_x);
    let cuff = inside((p.y - 0.131).abs() - 0.0018);
    let worn = 0.10 * (1.0 - smoothstep(0.02, 0.09, DVec3::new(leg_x, 0.7 * (p.y - 0.47), p.z - 0.07).length()));
    (TROUSERS * (1.0 + worn) * mix(1.0, 0.68, seam.max(cuff)), 0.80)
}

fn shoe(p: DVec3) -> (DVec3, f64) {
    if p.y < SOLE {
        let stripe = inside((p.y - 0.020).abs() - 0.0022);
        return (WHITE.lerp(SHOE, stripe), 0.6);
    }
    let x = p.x.abs() - Joint::FootL.position().x - 0.002;
    let toe_cap = inside(0.128 - p.z - 0.9 * (0.05 - p.y).min(0.0));
    let row = ((p.z - 0.030) / 0.020).floor();
    let lace_z = p.z - 0.030 - 0.020 * (row + 0.5);
    let on_tongue = p.z > 0.030 && p.z < 0.110 && x.abs() < 0.024;
    let lace = if on_tongue { inside(lace_z.abs() - 0.0042) } else { 0.0 };
    let collar = inside(0.100 - p.y);
    let color = SHOE.lerp(WHITE, toe_cap.max(lace)).lerp(SHOE * 0.7, collar);
    (color, mix(0.62, 0.5, toe_cap))
}

/// Height of the relief of `stuff` above the smooth surface in metres: ribs, seams, strands.
pub fn relief(stuff: Stuff, p: DVec3) -> f64 {
    match stuff {
        Stuff::Hair => 0.0030 * strand(p),
        Stuff::Hoodie if ribbed(p) => {
            let turn = if p.x.abs() > 0.25 {
                let axis = Joint::UpperArmL.position() + ARM_DIR * along_arm(p);
                let left = DVec3::new(p.x.abs(), p.y, p.z) - axis;
                libm::atan2(left.z, left.dot(DVec3::new(-ARM_DIR.y, ARM_DIR.x, 0.0))) * 26.0
            } else {
                libm::atan2(p.x, p.z) * 72.0
            };
            0.0011 * libm::sin(turn) - 0.001
        }
        Stuff::Hoodie => folds(p, 0.0024) - 0.0016 * inside(pocket(p).abs() - 0.0025),
        Stuff::Trousers => folds(p, 0.0022),
        Stuff::Skin | Stuff::Shoe => 0.0,
    }
}

/// Soft creases, mostly across the limbs.
fn folds(p: DVec3, height: f64) -> f64 {
    height * fractal(DVec3::new(p.x * 13.0, p.y * 24.0, p.z * 13.0))
}
