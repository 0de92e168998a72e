//! A ray as event lists see it: at which parameter it passes a coordinate.

use crate::{accel::TravRay, geom::Aabb};

/// Relative widening of exits and of the limit: 2^-49.
///
/// Differences of `f32` and their quotients by an `f32` neither overflow nor underflow in `f64`, so the parameter of a
/// plane has the error of three roundings (reciprocal, difference, product), at most `(1 + u)^3` with u = 2^-53, and the
/// right sign. An exact `entry <= exit` is then found as `entry <= exit * WIDEN`: the two errors and the rounding of
/// this product make less than 8 u, and the widening is 16 u.
pub(crate) const WIDEN: f64 = 1.0 + 8.0 * f64::EPSILON;

/// The ray in f64. Serves every finite ray: there is no faster form with a narrower range.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventRay {
    pub(super) origin: [f32; 3],
    wide_origin: [f64; 3],
    /// Infinite on an axis that the ray does not move along.
    inv: [f64; 3],
    pub(super) t_near: f64,
    t_far: f64,
}

impl EventRay {
    #[inline(always)]
    pub(crate) fn new(ray: &TravRay) -> Self {
        let range = ray.range();
        Self {
            origin: range.origin.to_array(),
            wide_origin: range.origin.to_array().map(f64::from),
            inv: range.dir.to_array().map(|d| 1.0 / f64::from(d)),
            t_near: f64::from(range.t_near),
            t_far: f64::from(range.t_far),
        }
    }

    /// True on an axis with a direction component other than 0.
    #[inline(always)]
    pub(super) fn moves(&self, axis: usize) -> bool {
        self.inv[axis].is_finite()
    }

    /// True on an axis along which the ray runs downward.
    #[inline(always)]
    pub(super) fn runs_back(&self, axis: usize) -> bool {
        self.inv[axis] < 0.0
    }

    /// Where the ray passes `value`; monotone in `value`. Only for axes that the ray moves along.
    #[inline(always)]
    pub(super) fn t(&self, axis: usize, value: f32) -> f64 {
        (f64::from(value) - self.wide_origin[axis]) * self.inv[axis]
    }

    /// True when the ray has surely passed `value` before `now`.
    #[inline(always)]
    pub(super) fn is_behind(&self, axis: usize, value: f32, now: f64) -> bool {
        self.t(axis, value) * WIDEN < now
    }

    /// When the ray leaves a box that it meets, not too early.
    #[inline(always)]
    pub(super) fn leaves(&self, aabb: Aabb) -> f64 {
        let mut end = f64::INFINITY;
        for axis in 0..3 {
            if self.moves(axis) {
                let exit = if self.runs_back(axis) { aabb.min[axis] } else { aabb.max[axis] };
                end = end.min(self.t(axis, exit) * WIDEN);
            }
        }
        end
    }

    /// When the ray, from `t_near` on, enters a box, and the axis on which it does so last; no axis when it starts inside.
    /// `None` when it surely misses the box.
    #[inline(always)]
    pub(super) fn enters(&self, aabb: Aabb) -> Option<(f64, Option<usize>)> {
        if aabb.is_empty() {
            return None;
        }
        let (mut now, mut last) = (self.t_near, None);
        for axis in 0..3 {
            if self.moves(axis) {
                let entry = if self.runs_back(axis) { aabb.max[axis] } else { aabb.min[axis] };
                let t = self.t(axis, entry);
                if t > now {
                    (now, last) = (t, Some(axis));
                }
            } else if !(aabb.min[axis] <= self.origin[axis] && self.origin[axis] <= aabb.max[axis]) {
                return None;
            }
        }
        (now <= self.leaves(aabb) && now <= self.t_far * WIDEN).then_some((now, last))
    }
}
