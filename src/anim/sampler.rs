//! The value of a sampler at a time.
//!
//! Key times are `f32` in the file; the position between two keys is computed in `f64`, so that keys near
//! 10^6 s lose nothing. The key is found by binary search: clips have tens to hundreds of keys, and a search
//! costs less than the bookkeeping of a cursor.

use glam::{DQuat, DVec3};

use super::quat;
use crate::scene::{Interpolation, Sampler};

/// Where a time falls among the keys.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// On a key, or before the first or after the last one.
    On(usize),
    /// Between a key and the next.
    Between {
        /// The key before.
        key: usize,
        /// Fraction of the way to the next, in (0, 1).
        alpha: f64,
        /// Seconds from the key to the next.
        span_s: f64,
    },
}

/// NaN counts as the time before the first key.
#[expect(clippy::float_cmp, reason = "on a key its value holds as stored")]
fn locate(times: &[f32], time_s: f64) -> Place {
    let after = times.partition_point(|&t| f64::from(t) <= time_s);
    if after == 0 {
        return Place::On(0);
    }
    let key = after - 1;
    let start = f64::from(times[key]);
    if after == times.len() || start == time_s {
        return Place::On(key);
    }
    let span_s = f64::from(times[after]) - start;
    Place::Between { key, alpha: (time_s - start) / span_s, span_s }
}

/// Component `c` of value `slot` (values, or tangents and values for cubic splines).
#[inline]
fn component(sampler: &Sampler, slot: usize, c: usize) -> f64 {
    f64::from(sampler.values[slot * sampler.width + c])
}

/// The stored value of a key.
#[inline]
fn key_value(sampler: &Sampler, key: usize, c: usize) -> f64 {
    let slot = if sampler.interpolation == Interpolation::CubicSpline { 3 * key + 1 } else { key };
    component(sampler, slot, c)
}

/// Component `c` at `place`, quaternions not treated specially.
///
/// Equal keys (with zero tangents) give exactly the key's value, so that a channel that never changes moves
/// nothing, not even by rounding.
fn component_at(sampler: &Sampler, place: Place, c: usize) -> f64 {
    match place {
        Place::On(key) => key_value(sampler, key, c),
        Place::Between { key, alpha, span_s } => match sampler.interpolation {
            Interpolation::Step => key_value(sampler, key, c),
            Interpolation::Linear => {
                let from = key_value(sampler, key, c);
                from + (key_value(sampler, key + 1, c) - from) * alpha
            }
            Interpolation::CubicSpline => {
                let from = component(sampler, 3 * key + 1, c);
                let out_tangent = component(sampler, 3 * key + 2, c) * span_s;
                let in_tangent = component(sampler, 3 * key + 3, c) * span_s;
                let to = component(sampler, 3 * key + 4, c);
                hermite(from, out_tangent, in_tangent, to, alpha)
            }
        },
    }
}

/// Cubic with the given ends and end slopes at `s` in [0, 1].
fn hermite(from: f64, slope_from: f64, slope_to: f64, to: f64, s: f64) -> f64 {
    let r = 1.0 - s;
    from + (to - from) * (s * s * (3.0 - 2.0 * s)) + slope_from * (s * r * r) - slope_to * (s * s * r)
}

/// Morph weights at a time: the first `min(width, out.len())` of `out` are written, the rest stay.
pub(super) fn weights(sampler: &Sampler, time_s: f64, out: &mut [f64]) {
    let place = locate(&sampler.times, time_s);
    for (c, w) in out.iter_mut().enumerate().take(sampler.width) {
        *w = component_at(sampler, place, c);
    }
}

/// Translation or scale at a time.
pub(super) fn vector(sampler: &Sampler, time_s: f64) -> DVec3 {
    let place = locate(&sampler.times, time_s);
    DVec3::from_array(std::array::from_fn(|c| component_at(sampler, place, c)))
}

/// Rotation at a time. Keys come back as stored; whoever makes a matrix of it normalises.
pub(super) fn rotation(sampler: &Sampler, time_s: f64) -> DQuat {
    let place = locate(&sampler.times, time_s);
    match place {
        Place::Between { key, alpha, .. } if sampler.interpolation == Interpolation::Linear => {
            quat::slerp(key_rotation(sampler, key), key_rotation(sampler, key + 1), alpha)
        }
        _ => DQuat::from_array(std::array::from_fn(|c| component_at(sampler, place, c))),
    }
}

fn key_rotation(sampler: &Sampler, key: usize) -> DQuat {
    DQuat::from_array(std::array::from_fn(|c| key_value(sampler, key, c)))
}
