//! Where rays cross axis-aligned planes, in one fused operation a plane.
//!
//! `t = plane * (1/d) - o * (1/d)` cancels where the plane lies close to the origin for the size of both, so it is far less accurate than
//! `(plane - o) * (1/d)`; but the error is at most a few roundings of `o * (1/d)`, which is known before any plane is. The exact form
//! moves that term outward by its error, entries down and exits up. The fast form leaves it as it is.

use glam::Vec3;

use super::{
    TravRay,
    query::{ORDINARY_MAX, SLACK},
};
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

/// The least and the greatest `|d|∞` of rays along a plane: 2^-30 and 2^30.
pub(super) const STEADY: [f32; 2] = [1.0 / 1_073_741_824.0, 1_073_741_824.0];

/// The least size of a direction's components other than 0.
pub(super) const SLANTED: f32 = 1.0 / ORDINARY_MAX;

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
    ray.is_steady() && ray.is_within(farthest(reach)) && reach <= ORDINARY_MAX
}

/// The greatest size of the coordinates of an origin that [`Slab`] is proven for.
#[inline(always)]
pub(super) fn farthest(reach: f32) -> f32 {
    FAR * reach
}

/// True for a `|d|∞` that [`Slab`] is proven for where the ray runs along a plane.
#[inline(always)]
pub(super) fn is_steady(size: f32) -> bool {
    (STEADY[0]..=STEADY[1]).contains(&size)
}

/// One ray against two boxes at once: factor and summand of each axis for lanes of entry, entry, negated exit, negated exit. As [`Slab`], lane
/// by lane: with the factor `-B` of an exit, what is added is again `-o` times the factor, less its pad.
#[inline(always)]
pub(super) fn of_pair<S: Simd>(ray: &TravRay, reach: f32) -> ([S::F4; 3], [S::F4; 3]) {
    let (range, inv) = (ray.range(), ray.inv());
    let (ends, pad) = match ray.forms().nodes {
        Precision::Exact => ([SHRINK, SHRINK, -GROW, -GROW], PAD),
        Precision::Fast => ([1.0, 1.0, -1.0, -1.0], 0.0),
    };
    let (ends, pad) = (S::F4::load(&ends), S::F4::splat(pad));
    let mut mul = [ends; 3];
    let mut add = [ends; 3];
    for (axis, (mul, add)) in mul.iter_mut().zip(&mut add).enumerate() {
        let (mut inv, mut raise) = (inv[axis], 0.0);
        if range.dir[axis] == 0.0 {
            let size = range.dir.abs().max_element();
            (inv, raise) = (STEEP / size, (ray.far() + reach) * 1.001 / size);
        }
        *mul = S::F4::splat(inv) * ends;
        let place = S::F4::splat(range.origin[axis]) * *mul;
        *add = -(place + place.abs() * pad) + S::F4::load(&[0.0, 0.0, -raise, -raise]);
    }
    (mul, add)
}

/// The slabs of one ray on each axis, for any number of boxes: those of [`of_pair`].
#[inline(always)]
pub(super) fn of_ray<S: Simd>(ray: &TravRay, reach: f32) -> [Slab<f32>; 3] {
    let (mul, add) = of_pair::<S>(ray, reach);
    let mut out = [Slab { entry_mul: 0.0, entry_add: 0.0, exit_mul: 0.0, exit_add: 0.0 }; 3];
    for axis in 0..3 {
        let (mut muls, mut adds) = ([0.0; 4], [0.0; 4]);
        mul[axis].store(&mut muls);
        add[axis].store(&mut adds);
        out[axis] = Slab { entry_mul: muls[0], entry_add: adds[0], exit_mul: -muls[2], exit_add: -adds[2] };
    }
    out
}

/// One ray on three axes, a lane each: [`Slab`] with summands that hold the slack of comparisons as well.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) entry_mul: [f32; 4],
    pub(super) entry_add: [f32; 4],
    pub(super) exit_mul: [f32; 4],
    pub(super) exit_add: [f32; 4],
}

impl Line {
    #[inline(always)]
    pub(super) fn new<S: Simd>(ray: &TravRay, reach: f32) -> Self {
        let Vec3 { x, y, z } = ray.range().dir;
        // No lane that divides by something else: what underflows costs more than a walk.
        let dir = S::F4::load(&[x, y, z, 1.0]);
        let Vec3 { x, y, z } = ray.range().origin;
        let origin = S::F4::load(&[x, y, z, 0.0]);
        let (mut inv, mut raise) = (S::F4::splat(1.0) / dir, S::F4::splat(SLACK));
        let zero = S::F4::splat(0.0);
        let along = dir.le(zero) & zero.le(dir);
        if along != 0 {
            let size = S::F4::splat(ray.range().dir.abs().max_element());
            inv = S::F4::select(along, S::F4::splat(STEEP) / size, inv);
            raise = S::F4::select(along, S::F4::splat((ray.far() + reach) * 1.001) / size, raise);
        }
        let (shrink, grow, pad) = match ray.forms().nodes {
            Precision::Exact => (SHRINK, GROW, PAD),
            Precision::Fast => (1.0, 1.0, 0.0),
        };
        let (entry_mul, exit_mul) = (inv * S::F4::splat(shrink), inv * S::F4::splat(grow));
        let (entry, exit, pad) = (origin * entry_mul, origin * exit_mul, S::F4::splat(pad));
        let mut out = Self { entry_mul: [0.0; 4], entry_add: [0.0; 4], exit_mul: [0.0; 4], exit_add: [0.0; 4] };
        entry_mul.store(&mut out.entry_mul);
        (-(entry + entry.abs() * pad)).store(&mut out.entry_add);
        exit_mul.store(&mut out.exit_mul);
        (exit.abs() * pad - exit + raise).store(&mut out.exit_add);
        out
    }
}

/// As many rays as a vector has lanes: on each axis [`Slab`]'s four numbers, with the slack of comparisons as in [`Line`].
#[derive(Clone, Copy)]
pub(super) struct Lines {
    /// `[axis][entry factor, entry summand, exit factor, exit summand][ray]`.
    pub(super) rows: [[[f32; 16]; 4]; 3],
}

impl Lines {
    /// The slabs of one axis.
    #[inline(always)]
    pub(super) fn slab<S: Simd>(&self, axis: usize) -> Slab<S::F> {
        let [entry_mul, entry_add, exit_mul, exit_add] = &self.rows[axis];
        Slab {
            entry_mul: S::F::load(entry_mul),
            entry_add: S::F::load(entry_add),
            exit_mul: S::F::load(exit_mul),
            exit_add: S::F::load(exit_add),
        }
    }

    pub(super) const EMPTY: Self = Self { rows: [[[0.0; 16]; 4]; 3] };

    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        [ox, oy, oz]: &[[f32; 16]; 3],
        [dx, dy, dz]: &[[f32; 16]; 3],
        reach: f32,
        nodes: Precision,
    ) {
        let origin = [S::F::load(ox), S::F::load(oy), S::F::load(oz)];
        let dir = [S::F::load(dx), S::F::load(dy), S::F::load(dz)];
        let extent = Extent::new(origin, dir, reach);
        for axis in 0..3 {
            let slab = Slab::new(origin[axis], dir[axis], &extent, nodes);
            let [entry_mul, entry_add, exit_mul, exit_add] = &mut self.rows[axis];
            slab.entry_mul.store(entry_mul);
            slab.entry_add.store(entry_add);
            slab.exit_mul.store(exit_mul);
            (slab.exit_add + S::F::splat(SLACK)).store(exit_add);
        }
    }
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
        /// On each axis entry and exit of a single ray, then of a packet.
        type Output = [[f32; 4]; 3];

        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            let (mul, add) = of_pair::<S>(self.ray, self.reach);
            let (origin, dir) = (self.ray.range().origin.to_array(), self.ray.range().dir.to_array());
            let splat3 = |v: [f32; 3]| v.map(S::F::splat);
            let extent = Extent::new(splat3(origin), splat3(dir), self.reach);
            let mut out = [[0.0; 4]; 3];
            for (axis, out) in out.iter_mut().enumerate() {
                let (mut row, mut rows) = ([0.0; 4], [[0.0; 16]; 2]);
                S::F4::splat(self.planes[axis]).mul_add_loose(mul[axis], add[axis]).store(&mut row);
                let plane = S::F::splat(self.planes[axis]);
                let nodes = self.ray.forms().nodes;
                let slab = Slab::new(S::F::splat(origin[axis]), S::F::splat(dir[axis]), &extent, nodes);
                plane.mul_add_loose(slab.entry_mul, slab.entry_add).store(&mut rows[0]);
                plane.mul_add_loose(slab.exit_mul, slab.exit_add).store(&mut rows[1]);
                *out = [row[0], -row[2], rows[0][0], rows[1][0]];
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
                for (axis, ends) in [0, 1, 2, 0, 1, 2].into_iter().zip([[0, 1]; 3].into_iter().chain([[2, 3]; 3])) {
                    let distance = f64::from(planes[axis]) - f64::from(origin[axis]);
                    let [entry, exit] = ends.map(|end| f64::from(crossed[axis][end]));
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
            assert!(beyond[0].min(beyond[2]) > 1e4, "{level}: a lower plane above the ray is entered late: {beyond:?}");
            assert!(below[1].max(below[3]) < -1e4, "{level}: an upper plane below the ray is left at once: {below:?}");
        }
    }
}
