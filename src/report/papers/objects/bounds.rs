//! Boxes rounded outward.

use glam::{DVec3, Vec3};

use crate::geom::Aabb;

/// Part of the largest coordinate by which boxes grow: far above the error of the tests in f64, far below a rounding to
/// f32.
const MARGIN: f64 = 1.0 / (1_u64 << 40) as f64;

/// The least `f32` box, with a margin, around a box in f64.
pub(super) fn outward(min: DVec3, max: DVec3) -> Aabb {
    let pad = DVec3::splat(min.abs().max(max.abs()).max_element() * MARGIN);
    Aabb { min: round(min - pad, false), max: round(max + pad, true) }
}

/// The box around points.
pub(super) fn of_points(points: &[DVec3]) -> Aabb {
    let min = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let max = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    if points.is_empty() { Aabb::EMPTY } else { outward(min, max) }
}

#[expect(clippy::cast_possible_truncation, reason = "rounded outward right after")]
fn round(v: DVec3, up: bool) -> Vec3 {
    Vec3::from_array(v.to_array().map(|x| {
        let near = x as f32;
        match up {
            true if f64::from(near) < x => near.next_up(),
            false if f64::from(near) > x => near.next_down(),
            _ => near,
        }
    }))
}
