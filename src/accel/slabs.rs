//! Where rays cross axis-aligned planes, in one fused operation a plane.
//!
//! `t = plane * (1/d) - o * (1/d)` cancels where the plane lies close to the origin for the size of both, so it is far less accurate than
//! `(plane - o) * (1/d)`; but the error is at most a few roundings of `o * (1/d)`, which is known before any plane is. The exact form
//! moves that term outward by its error, entries down and exits up. The fast form leaves it as it is.

use super::{TravRay, query::ORDINARY_MAX};
use crate::{
    geom::Precision,
    simd::{Lanes, Simd},
};

/// Six units in the last place of 1 seen from below: `u = 2^-24`.
const PAD: f32 = 6.0 / 16_777_216.0;

/// Factors of reciprocals for entries and exits.
const SHRINK: f32 = 1.0 - PAD;
const GROW: f32 = 1.0 + PAD;

/// Origins up to this many times farther out than any plane: farther ones would widen boxes by more than the least triangles measure.
const FAR: f32 = 1024.0;

/// Greatest `|d|∞`, and the inverse of the least, of rays along a plane: 2^30.
const STEADY: f32 = 1_073_741_824.0;

/// How many times a plane's distance is magnified where the ray runs along it: 2^25.
const STEEP: f32 = 33_554_432.0;

/// A ray on one axis, or a ray a lane.
///
/// # Proof that no half-space is missed
/// Take a ray that [`fits`] and a plane p within 2^60 of 0, and `d != 0`. Let `T = (p - o) / d` in exact arithmetic and u = 2^-24.
/// `entry_mul` is A with `A d` within `1 - 8.1 u` and `1 - 3.9 u`, by two roundings beside the factor [`SHRINK`]. `entry_add` is `-o A` less
/// `6 u |o A|`, by three roundings of at most `u |o A|` each, so it is below `-o A - 2.9 u |o A|`; a product that is rounded by itself adds `u |p A|`,
/// at most `u |p - o| |A| + u |o A|`. So what comes out before the last rounding is at most `T (1 - 2.8 u)` where `T >= 0`, and the last rounding
/// leaves it below T; where `T < 0` it is not positive, and `t_near >= 0` takes its place. Exits mirror this: not below T where `T >= 0`, and a
/// negative exit is a miss in truth. Nothing overflows (2^60 * 2^61), and underflow loses less than 2^-148, which comparisons leave room for.
///
/// Where `d = 0` the ray stays at o. The factor is `2^25 / |d|∞` on both sides, so a plane that the ray lies inside of gives an entry that is not
/// positive; the exit is raised by R, which is at least the t of every plane on the longest axis: no box is left before that.
/// A plane that the ray lies outside of by more than about `2^-24 (|o|∞ + reach)` makes it miss, as it does in truth.
#[derive(Clone, Copy)]
pub(super) struct Slab<L> {
    pub(super) entry_mul: L,
    pub(super) entry_add: L,
    pub(super) exit_mul: L,
    pub(super) exit_add: L,
}

/// What [`Slab::new`] knows of the whole ray.
#[derive(Clone, Copy)]
pub(super) struct Extent<L> {
    /// `|d|∞`.
    pub(super) size: L,
    /// `|o|∞` and the planes' reach, added.
    pub(super) span: L,
}

impl<L: Lanes<Elem = f32>> Extent<L> {
    #[inline(always)]
    pub(super) fn new(origin: [L; 3], dir: [L; 3], reach: f32) -> Self {
        let far = origin[0].abs().max(origin[1].abs()).max(origin[2].abs());
        Self { size: dir[0].abs().max(dir[1].abs()).max(dir[2].abs()), span: far + L::splat(reach) }
    }
}

impl<L: Lanes<Elem = f32>> Slab<L> {
    #[inline(always)]
    pub(super) fn new(origin: L, dir: L, extent: &Extent<L>, nodes: Precision) -> Self {
        let zero = L::splat(0.0);
        let mut inv = L::splat(1.0) / dir;
        let along = dir.le(zero) & zero.le(dir);
        let mut raise = zero;
        if along != 0 {
            inv = L::select(along, L::splat(STEEP) / extent.size, inv);
            raise = L::select(along, extent.span * L::splat(1.001) / extent.size, zero);
        }
        if nodes == Precision::Fast {
            let add = -(origin * inv);
            return Self { entry_mul: inv, entry_add: add, exit_mul: inv, exit_add: add + raise };
        }
        let (entry_mul, exit_mul) = (inv * L::splat(SHRINK), inv * L::splat(GROW));
        let (entry, exit) = (origin * entry_mul, origin * exit_mul);
        let (down, up) = (entry.abs() * L::splat(PAD), exit.abs() * L::splat(PAD));
        Self { entry_mul, entry_add: -(entry + down), exit_mul, exit_add: up - exit + raise }
    }
}

/// True when [`Slab`] is proven for the ray and planes up to `reach` from 0.
#[inline(always)]
pub(super) fn fits(ray: &TravRay, reach: f32) -> bool {
    let range = ray.range();
    let (far, size) = (range.origin.abs().max_element(), range.dir.abs());
    let steady = size.min_element() > 0.0 || (1.0 / STEADY..=STEADY).contains(&size.max_element());
    ray.is_ordinary() && reach <= ORDINARY_MAX && far <= FAR * reach && steady
}

/// The slabs of one ray on each axis.
#[inline(always)]
pub(super) fn of_ray<S: Simd>(ray: &TravRay, reach: f32) -> [Slab<f32>; 3] {
    let range = ray.range();
    let ([x, y, z], [dx, dy, dz]) = (range.origin.to_array(), range.dir.to_array());
    let extent = Extent {
        size: S::F4::splat(range.dir.abs().max_element()),
        span: S::F4::splat(range.origin.abs().max_element() + reach),
    };
    // The fourth lane repeats the third, so that it takes no way of its own.
    let slab = Slab::new(S::F4::load(&[x, y, z, z]), S::F4::load(&[dx, dy, dz, dz]), &extent, ray.forms().nodes);
    let mut rows = [[0.0; 4]; 4];
    slab.entry_mul.store(&mut rows[0]);
    slab.entry_add.store(&mut rows[1]);
    slab.exit_mul.store(&mut rows[2]);
    slab.exit_add.store(&mut rows[3]);
    let [a, b, c, d] = rows;
    [
        Slab { entry_mul: a[0], entry_add: b[0], exit_mul: c[0], exit_add: d[0] },
        Slab { entry_mul: a[1], entry_add: b[1], exit_mul: c[1], exit_add: d[1] },
        Slab { entry_mul: a[2], entry_add: b[2], exit_mul: c[2], exit_add: d[2] },
    ]
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        accel::Forms,
        geom::Ray,
        simd::{SimdLevel, Task, dispatch},
    };

    struct Crossing<'a> {
        ray: &'a TravRay,
        reach: f32,
        planes: [f32; 3],
    }

    impl Task for Crossing<'_> {
        type Output = [[f32; 2]; 3];

        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            let slabs = of_ray::<S>(self.ray, self.reach);
            let mut out = [[0.0; 2]; 3];
            for axis in 0..3 {
                let (slab, plane) = (slabs[axis], S::F4::splat(self.planes[axis]));
                let mut row = [0.0; 4];
                plane.mul_add_loose(S::F4::splat(slab.entry_mul), S::F4::splat(slab.entry_add)).store(&mut row);
                out[axis][0] = row[0];
                plane.mul_add_loose(S::F4::splat(slab.exit_mul), S::F4::splat(slab.exit_add)).store(&mut row);
                out[axis][1] = row[0];
            }
            out
        }
    }

    fn number() -> impl Strategy<Value = f32> {
        (-1_000_000_i32..1_000_000, -20_i32..10).prop_map(|(m, e)| m as f32 * 2.0_f32.powi(e))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        /// Differences of these numbers are exact in f64.
        #[test]
        fn entries_are_never_late_and_exits_never_early(
            origin in prop::array::uniform3(number()),
            dir in prop::array::uniform3(prop_oneof![3 => number(), 1 => Just(0.0)]),
            near in prop::array::uniform3(-3_i32..4),
            planes in prop::array::uniform3(number()),
        ) {
            let ray = Ray::new(Vec3::from(origin), Vec3::from(dir));
            let Some(ray) = TravRay::with_forms(&ray, Forms::EXACT) else { return Ok(()) };
            // Half of the planes lie within a few numbers of the origin.
            let nudged = |i: usize| match near[i] {
                -1 => origin[i].next_down(),
                0 => origin[i],
                1 => origin[i].next_up(),
                _ => planes[i],
            };
            let planes = [nudged(0), nudged(1), nudged(2)];
            let reach = planes.into_iter().fold(0.0, |reach: f32, p| reach.max(p.abs())).max(1.0);
            if !fits(&ray, reach) {
                return Ok(());
            }
            let far = f64::from(reach) + origin.map(f64::from).into_iter().fold(0.0, |far: f64, o| far.max(o.abs()));
            let limit = far / f64::from(ray.range().dir.abs().max_element());
            for level in SimdLevel::available() {
                let crossed = dispatch(level, Crossing { ray: &ray, reach, planes });
                for axis in 0..3 {
                    let distance = f64::from(planes[axis]) - f64::from(origin[axis]);
                    let [entry, exit] = crossed[axis].map(f64::from);
                    prop_assert!(entry.is_finite() && exit.is_finite());
                    let d = f64::from(ray.range().dir[axis]);
                    if d == 0.0 {
                        prop_assert!(distance > 0.0 || entry <= 0.0, "{level}: axis {axis}, {entry}");
                        prop_assert!(distance < 0.0 || exit >= limit, "{level}: axis {axis}, {exit} of {limit}");
                    } else if distance / d >= 0.0 {
                        prop_assert!(entry <= distance / d && exit >= distance / d, "{level}: axis {axis}, {entry} {exit}");
                    } else {
                        prop_assert!(entry <= 0.0, "{level}: axis {axis}, {entry}");
                    }
                }
            }
        }
    }

    #[test]
    fn planes_that_a_ray_runs_along_and_passes_by_are_found() {
        let ray = TravRay::new(&Ray::new(Vec3::new(0.5, 0.5, -3.0), Vec3::Z)).unwrap();
        for level in SimdLevel::available() {
            let [beyond, below, _] = dispatch(level, Crossing { ray: &ray, reach: 4.0, planes: [0.6, 0.4, 1.0] });
            assert!(beyond[0] > 1e4, "{level}: a lower plane above the ray is entered late: {beyond:?}");
            assert!(below[1] < -1e4, "{level}: an upper plane below the ray is left at once: {below:?}");
        }
    }
}
