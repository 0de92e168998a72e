//! What f32 makes of triangles and a packet, with bounds.

use super::leaf::Spread;
use crate::{accel::query::SLACK, simd::Lanes};

/// At least what the roundings of t amount to, of t.
const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// What f32 makes of the volumes of a triangle and its rays.
pub(super) struct Bounded<L> {
    pub(super) t_low: L,
    pub(super) t_high: L,
    /// Rays whose t is bounded.
    pub(super) solid: u32,
    /// Rays that surely meet the triangle and whose t is bounded.
    pub(super) sure: u32,
}

impl Spread {
    /// As [`Quotients`](crate::geom::exact::Quotients) in f32; [`SLACK`] is above what underflow takes.
    #[inline(always)]
    pub(super) fn bounded<L: Lanes<Elem = f32>>(&self, lane: usize, [det, u, v, t]: [L; 4]) -> Bounded<L> {
        let [uv_error, det_error, t_error] = self.errors(lane);
        let w = det - u - v;
        let (error, det_error) = (L::splat(uv_error), L::splat(det_error));
        let inside = error.lt(u.min(v).min(w)) | u.max(v).max(w).lt(-error);
        let solid = (det_error * L::splat(4.0)).le(det.abs());
        let inv_det = L::splat(1.0) / det;
        let t = t * inv_det;
        let slack = t.abs().mul_add_loose(det_error, L::splat(t_error)) * inv_det.abs() * L::splat(2.0);
        let slack = t.abs().mul_add_loose(L::splat(ROUNDING), slack) + L::splat(SLACK);
        Bounded { t_low: t - slack, t_high: t + slack, solid, sure: solid & inside }
    }
}
