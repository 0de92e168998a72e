//! Where secondary rays start, of [`Forms::offset`](crate::geom::Forms) fast: a fixed way off the surface, whatever the hit's error.

use super::wide::{Floats, V3, row};

/// Where rays along `dir` leave `point` of surfaces with unit normals `n_geom` of either side.
#[inline(always)]
pub(crate) fn off_surface<F: Floats>(point: V3<F>, n_geom: V3<F>, dir: V3<F>) -> V3<F> {
    pushed(point, V3::select(dir.dot(n_geom).lt(F::splat(0.0)), -n_geom, n_geom))
}

/// A fixed number of floats in the direction of `away` (of unit length), by its share on each axis; a fixed distance on axes where the point is
/// near 0 and floats are dense. Too short for points whose coordinates came from much larger ones, too long where a scene is small.
///
/// # Source
/// Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems, 2019.
#[inline(always)]
fn pushed<F: Floats>(point: V3<F>, away: V3<F>) -> V3<F> {
    V3 { x: pushed_axis(point.x, away.x), y: pushed_axis(point.y, away.y), z: pushed_axis(point.z, away.z) }
}

#[inline(always)]
fn pushed_axis<F: Floats>(x: F, away: F) -> F {
    let (mut x, away) = (row(x), row(away));
    for i in 0..F::LEN {
        x[i] = pushed_one(x[i], away[i]);
    }
    F::load(&x)
}

/// Finite numbers stay finite: where the way leads past the largest, it is not taken.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the source cuts")]
fn pushed_one(x: f32, away: f32) -> f32 {
    const NEAR: f32 = 1.0 / 32.0;
    const FLOATS: f32 = 256.0;
    const DISTANCE: f32 = 1.0 / 65536.0;
    if x.abs() < NEAR {
        return x + DISTANCE * away;
    }
    let floats = (FLOATS * away) as i32;
    let floats = if x < 0.0 { -floats } else { floats };
    let pushed = f32::from_bits(x.to_bits().wrapping_add_signed(floats));
    if pushed.is_finite() { pushed } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_leave_on_the_side_of_the_direction() {
        for x in [0.0, 1e-9, -0.01, 0.5, -0.5, 1.0, -7.25, 1e6, -1e30] {
            assert!(pushed_one(x, 0.6) > x && pushed_one(x, -0.6) < x, "{x}");
            assert!((pushed_one(x, 0.0) - x).abs() < 1e-30, "{x}");
        }
    }

    #[test]
    fn the_largest_numbers_stay_finite() {
        for x in [f32::MAX, f32::MIN] {
            assert!(pushed_one(x, 1.0).is_finite() && pushed_one(x, -1.0).is_finite());
        }
    }
}
