//! The figure as a solid: smooth unions of rounded cones and ellipsoids, one group a garment.

use glam::DVec3;

use super::rig::{ARM, ARM_DIR, Joint, mirror};
use crate::scenes::sdf::{Solid, smooth_max, smooth_min};

/// What a place of the surface is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stuff {
    Skin,
    Hair,
    Hoodie,
    Trousers,
    Shoe,
}

/// Solids that blend into each other over a width of `blend`.
struct Group {
    stuff: Stuff,
    solids: Vec<(Solid, f64)>,
    /// Ball around all of them.
    center: DVec3,
    radius: f64,
}

impl Group {
    fn new(stuff: Stuff, solids: Vec<(Solid, f64)>) -> Self {
        let balls = solids.iter().map(|(solid, _)| solid.ball());
        let (min, max) = balls.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), (c, r)| {
            (min.min(c - DVec3::splat(r)), max.max(c + DVec3::splat(r)))
        });
        Self { stuff, solids, center: 0.5 * (min + max), radius: 0.5 * (max - min).length() }
    }

    fn distance(&self, p: DVec3) -> f64 {
        let union = self.solids.iter().fold(f64::INFINITY, |d, (solid, blend)| blended(d, solid.distance(p), *blend));
        match self.stuff {
            Stuff::Hair => smooth_max(union, hairline(p), 0.02),
            Stuff::Trousers => smooth_max(union, 0.098 - p.y, 0.010),
            Stuff::Shoe => smooth_max(union, 0.002 - p.y, 0.012),
            _ => union,
        }
    }
}

/// [`smooth_min`] that takes an empty union.
fn blended(a: f64, b: f64, k: f64) -> f64 {
    if a.is_finite() { smooth_min(a, b, k) } else { b }
}

/// Positive in front of and below the plane that bounds the hair.
fn hairline(p: DVec3) -> f64 {
    let side = 0.35 * (p.x.abs() - 0.06).max(0.0);
    -(p - DVec3::new(0.0, 1.548, 0.115)).dot(DVec3::new(0.0, 0.73, -0.683)) - side
}

/// The whole figure.
pub struct Body {
    groups: Vec<Group>,
}

/// How sharply garments meet.
const SEAM: f64 = 0.008;

impl Body {
    /// The figure in its rest pose.
    pub fn new() -> Self {
        let mut groups =
            vec![Group::new(Stuff::Skin, head()), Group::new(Stuff::Hair, hair()), Group::new(Stuff::Hoodie, torso())];
        for side in [false, true] {
            let place = |solids: Vec<(Solid, f64)>| -> Vec<(Solid, f64)> {
                solids.into_iter().map(|(s, k)| (if side { mirrored(s) } else { s }, k)).collect()
            };
            groups.push(Group::new(Stuff::Hoodie, place(sleeve())));
            groups.push(Group::new(Stuff::Skin, place(hand())));
            groups.push(Group::new(Stuff::Trousers, place(leg())));
            groups.push(Group::new(Stuff::Shoe, place(shoe())));
        }
        Self { groups }
    }

    /// Signed distance of `p`, negative inside.
    pub fn distance(&self, p: DVec3) -> f64 {
        let mut best = f64::INFINITY;
        for group in &self.groups {
            // A group farther than the best by more than any blend cannot change the result.
            if (p - group.center).length() - group.radius > best + 0.06 {
                continue;
            }
            // The two parts of a garment run into each other; different garments meet in a seam.
            let k = match group.stuff {
                Stuff::Hoodie => 0.045,
                Stuff::Trousers => 0.022,
                _ => SEAM,
            };
            best = blended(best, group.distance(p), k);
        }
        best
    }

    /// Distance of `p` from the parts made of `stuff` alone.
    pub fn distance_to(&self, stuff: Stuff, p: DVec3) -> f64 {
        let of_stuff = self.groups.iter().filter(|group| group.stuff == stuff);
        of_stuff.map(|group| group.distance(p)).fold(f64::INFINITY, f64::min)
    }

    /// What the surface at `p` is made of: the group nearest to it.
    pub fn stuff(&self, p: DVec3) -> Stuff {
        let mut best = (f64::INFINITY, Stuff::Skin);
        for group in &self.groups {
            if (p - group.center).length() - group.radius < best.0 {
                let d = group.distance(p);
                if d < best.0 {
                    best = (d, group.stuff);
                }
            }
        }
        best.1
    }
}

fn mirrored(solid: Solid) -> Solid {
    match solid {
        Solid::Cone { a, b, radius_a, radius_b } => Solid::cone(mirror(a), mirror(b), radius_a, radius_b),
        Solid::Ellipsoid { center, radii, x, y } => {
            Solid::Ellipsoid { center: mirror(center), radii, x: mirror(x), y: mirror(y) }
        }
    }
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn head() -> Vec<(Solid, f64)> {
    let ear = |x: f64| Solid::ellipsoid(v(x, 1.457, 0.0), v(0.017, 0.034, 0.025));
    vec![
        (Solid::ellipsoid(v(0.0, 1.482, 0.008), v(0.116, 0.130, 0.122)), 0.0),
        (Solid::ellipsoid(v(0.0, 1.420, 0.034), v(0.084, 0.072, 0.084)), 0.06),
        (Solid::cone(v(0.0, 1.22, -0.012), v(0.0, 1.38, -0.004), 0.052, 0.048), 0.03),
        (Solid::cone(v(0.0, 1.462, 0.122), v(0.0, 1.443, 0.139), 0.009, 0.0135), 0.02),
        (ear(0.116), 0.012),
        (ear(-0.116), 0.012),
    ]
}

fn hair() -> Vec<(Solid, f64)> {
    let tilt = |x: f64, y: f64| (v(x, y, 0.0).normalize(), v(-y, x, 0.0).normalize());
    let (x, y) = tilt(0.97, -0.22);
    vec![
        (Solid::ellipsoid(v(0.0, 1.497, -0.008), v(0.129, 0.134, 0.136)), 0.0),
        (Solid::Ellipsoid { center: v(0.022, 1.603, 0.062), radii: v(0.094, 0.040, 0.070), x, y }, 0.03),
        (Solid::Ellipsoid { center: v(-0.058, 1.594, 0.030), radii: v(0.060, 0.038, 0.075), x, y }, 0.03),
    ]
}

fn torso() -> Vec<(Solid, f64)> {
    vec![
        (Solid::ellipsoid(v(0.0, 1.125, 0.0), v(0.158, 0.150, 0.112)), 0.0),
        (Solid::ellipsoid(v(0.0, 0.985, 0.004), v(0.142, 0.135, 0.112)), 0.06),
        (Solid::ellipsoid(v(0.0, 0.885, 0.0), v(0.150, 0.034, 0.120)), 0.02),
        (Solid::cone(v(-0.12, 1.215, -0.005), v(0.12, 1.215, -0.005), 0.062, 0.062), 0.04),
        // The hood lies on the shoulders; its rim runs round the neck.
        (Solid::ellipsoid(v(0.0, 1.262, -0.088), v(0.098, 0.060, 0.055)), 0.03),
        (Solid::cone(v(0.060, 1.283, -0.050), v(0.012, 1.243, 0.066), 0.028, 0.014), 0.02),
        (Solid::cone(v(-0.060, 1.283, -0.050), v(-0.012, 1.243, 0.066), 0.028, 0.014), 0.02),
    ]
}

fn sleeve() -> Vec<(Solid, f64)> {
    let shoulder = Joint::UpperArmL.position();
    let along = |s: f64| shoulder + ARM_DIR * s;
    let end = ARM[0] + ARM[1];
    vec![
        (Solid::cone(shoulder, along(ARM[0]), 0.063, 0.051), 0.0),
        (Solid::cone(along(ARM[0]), along(end - 0.035), 0.051, 0.044), 0.02),
        (Solid::cone(along(end - 0.022), along(end - 0.004), 0.040, 0.038), 0.008),
    ]
}

fn hand() -> Vec<(Solid, f64)> {
    let wrist = Joint::HandL.position();
    let inward = v(ARM_DIR.y, -ARM_DIR.x, 0.0);
    let at = |along: f64, z: f64, inside: f64| wrist + ARM_DIR * along + v(0.0, 0.0, z) + inward * inside;
    let mut solids = vec![
        (Solid::cone(at(-0.04, 0.0, 0.0), at(0.02, 0.0, 0.0), 0.028, 0.026), 0.0),
        (Solid::Ellipsoid { center: at(0.05, 0.002, 0.0), radii: v(0.052, 0.023, 0.043), x: ARM_DIR, y: inward }, 0.02),
        (Solid::cone(at(0.022, 0.022, 0.004), at(0.062, 0.056, 0.014), 0.019, 0.0145), 0.015),
        (Solid::cone(at(0.062, 0.056, 0.014), at(0.088, 0.060, 0.020), 0.0145, 0.0125), 0.006),
    ];
    for (i, length) in [0.026, 0.033, 0.034, 0.030].into_iter().enumerate() {
        let z = -0.0315 + 0.021 * i as f64;
        let (knuckle, middle) = (at(0.078, z, 0.001), at(0.082 + length, z * 1.04, 0.006));
        solids.push((Solid::cone(knuckle, middle, 0.0138, 0.0128), 0.008));
        solids.push((Solid::cone(middle, at(0.082 + 1.75 * length, z * 1.02, 0.019), 0.0128, 0.0112), 0.005));
    }
    solids
}

fn leg() -> Vec<(Solid, f64)> {
    let (hip, knee, ankle) = (Joint::ThighL.position(), Joint::ShinL.position(), Joint::FootL.position());
    let cuff = ankle + v(0.0, 0.045, -0.002);
    vec![
        (Solid::cone(hip, knee, 0.087, 0.064), 0.0),
        (Solid::cone(knee, cuff, 0.066, 0.058), 0.03),
        (Solid::cone(cuff - v(0.0, 0.012, 0.0), cuff + v(0.0, 0.012, 0.0), 0.060, 0.062), 0.006),
        (Solid::ellipsoid(v(0.03, 0.868, -0.006), v(0.114, 0.080, 0.108)), 0.05),
        (Solid::ellipsoid(v(0.062, 0.835, -0.042), v(0.074, 0.074, 0.074)), 0.03),
    ]
}

fn shoe() -> Vec<(Solid, f64)> {
    let ankle = Joint::FootL.position();
    let at = |x: f64, y: f64, z: f64| v(ankle.x + x, y, z);
    vec![
        (Solid::cone(at(0.0, 0.044, -0.022), at(0.003, 0.040, 0.10), 0.050, 0.046), 0.0),
        (Solid::cone(at(0.003, 0.040, 0.10), at(0.004, 0.034, 0.150), 0.046, 0.038), 0.01),
        (Solid::cone(at(0.0, 0.060, -0.008), at(0.0, 0.112, -0.010), 0.048, 0.047), 0.03),
        (Solid::cone(at(0.001, 0.075, 0.03), at(0.002, 0.055, 0.10), 0.034, 0.030), 0.03),
        // The sole stands out a little all round.
        (Solid::cone(at(0.0, 0.014, -0.024), at(0.003, 0.014, 0.10), 0.054, 0.050), 0.006),
        (Solid::cone(at(0.003, 0.014, 0.10), at(0.004, 0.013, 0.152), 0.050, 0.042), 0.006),
    ]
}
