//! What one ray carries through structures: its derived values and the best hit so far.

use std::cmp::Ordering;

use glam::{Vec3, Vec3A};

use super::{fast, slabs};
use crate::geom::{
    Forms, Hit, InstanceId, Precision, PrimId, Ray, Triangles,
    exact::{Quotients, RayRange, TriangleHit},
};

/// Maps a structure's own triangle numbers to the caller's and decides whether a hit counts.
///
/// Both are asked only about triangles that the ray really hits.
pub trait HitSink {
    /// True when `accept` always is: hits that are beaten later are then never rounded.
    const ACCEPTS_ALL: bool = false;
    /// The (instance, prim) that orders equal `t` and is reported; must be monotone in `prim`.
    fn key(&self, prim: PrimId) -> (InstanceId, PrimId);
    /// False to let the ray pass (alpha tests, layers). `hit` carries the key.
    fn accept(&self, hit: &Hit) -> bool;
}

/// Accepts every hit and keeps the structure's own numbers, in instance 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct AnyHit;

impl HitSink for AnyHit {
    const ACCEPTS_ALL: bool = true;

    #[inline(always)]
    fn key(&self, prim: PrimId) -> (InstanceId, PrimId) {
        (InstanceId(0), prim)
    }

    #[inline(always)]
    fn accept(&self, _hit: &Hit) -> bool {
        true
    }
}

/// Magnitudes up to which f32 node tests cannot overflow: 2^60.
pub(super) const ORDINARY_MAX: f32 = 1_152_921_504_606_846_976.0;

/// Relative widening of reciprocals: 6 * 2^-24.
const WIDEN: f32 = 6.0 / 16_777_216.0;

/// Factor of the reciprocal direction for entries: with it `fl(fl(plane - o) * inv)` is at most `(plane - o) / d` where
/// that is not negative.
///
/// Four roundings (reciprocal, widening, difference, product) make a relative error below 4.01 u with u = 2^-24,
/// and the widening is 6 u.
pub(super) const SHRINK: f32 = 1.0 - WIDEN;

/// Factor of the reciprocal direction for exits: `fl(fl(plane - o) * inv)` is at least `(plane - o) / d` where that is not
/// negative, up to an underflow of 2^-150.
pub(super) const GROW: f32 = 1.0 + WIDEN;

/// Absolute slack of f32 node tests: above every underflow they may meet.
pub(super) const SLACK: f32 = f32::MIN_POSITIVE;

/// A ray with what traversals derive from it, made once a ray.
#[derive(Clone, Copy, Debug)]
pub struct TravRay {
    range: RayRange,
    ordinary: bool,
    /// See [`TravRay::is_steady`].
    steady: bool,
    forms: Forms,
}

impl TravRay {
    /// A ray for places that need one and never look at it.
    pub(crate) const STAND_IN: Self = Self {
        range: RayRange { origin: Vec3::ZERO, dir: Vec3::X, t_near: 0.0, t_far: 0.0 },
        ordinary: true,
        steady: true,
        forms: Forms::EXACT,
    };

    /// `None` when the ray can hit nothing: NaN or infinity in origin or direction, zero direction, empty range.
    ///
    /// A negative `t_near` counts as 0. Tests are exact.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<Self> {
        Self::with_forms(ray, Forms::EXACT)
    }

    /// As [`TravRay::new`], tested as `forms` says. Rays of a packet must agree in them.
    #[inline(always)]
    pub fn with_forms(ray: &Ray, forms: Forms) -> Option<Self> {
        let (t_near, t_far) = (ray.t_near, ray.t_far.min(f32::MAX));
        // Adding +0 turns -0 into +0.
        let dir = Vec3A::from(ray.dir) + Vec3A::ZERO;
        let (size, place) = (dir.abs(), Vec3A::from(ray.origin).abs());
        let slanted = size.cmpge(Vec3A::splat(1.0 / ORDINARY_MAX));
        // NaN fails every comparison. Ordinary numbers are finite.
        let moderate = size.cmple(Vec3A::splat(ORDINARY_MAX)) & place.cmple(Vec3A::splat(ORDINARY_MAX));
        // A NaN t_far would be lost in `min`, so it is looked at itself.
        if ray.t_far.is_nan() || !(t_near <= t_far && t_far >= 0.0) {
            return None;
        }
        let (mut ordinary, mut steady) = (true, true);
        if !(slanted & moderate).all() {
            if !(ray.origin.is_finite() && dir.is_finite()) || dir == Vec3A::ZERO {
                return None;
            }
            ordinary = ((slanted | size.cmpeq(Vec3A::ZERO)) & moderate).all();
            steady = ordinary && slabs::is_steady(size.max_element());
        }
        Some(Self {
            range: RayRange { origin: ray.origin, dir: dir.into(), t_near: t_near.max(0.0) + 0.0, t_far: t_far + 0.0 },
            ordinary,
            steady,
            forms,
        })
    }

    /// Line and range, canonical: no -0, range finite and not negative.
    #[inline(always)]
    pub fn range(&self) -> &RayRange {
        &self.range
    }

    /// Reciprocal direction; infinite where the direction is 0. See [`SHRINK`] and [`GROW`]. Divides at each call.
    #[inline(always)]
    pub(super) fn inv(&self) -> Vec3 {
        reciprocal(self.range.dir)
    }

    /// The greatest size of the origin's coordinates.
    #[inline(always)]
    pub(super) fn far(&self) -> f32 {
        Vec3A::from(self.range.origin).abs().max_element()
    }

    /// True when no coordinate of the origin is larger than this.
    #[inline(always)]
    pub(super) fn is_within(&self, reach: f32) -> bool {
        Vec3A::from(self.range.origin).abs().cmple(Vec3A::splat(reach)).all()
    }

    /// True for ordinary rays that run along no plane, or are neither very long nor very short.
    #[inline(always)]
    pub(super) fn is_steady(&self) -> bool {
        self.steady
    }

    /// How the ray is tested.
    #[inline(always)]
    pub fn forms(&self) -> Forms {
        self.forms
    }

    /// True when f32 node tests on boxes within 2^60 of 0 neither overflow nor lose precision by underflow.
    #[inline(always)]
    pub fn is_ordinary(&self) -> bool {
        self.ordinary
    }
}

/// As one vector: compilers may pair single divisions with others, and a reciprocal of a far `t` that underflows costs
/// more than a whole walk.
#[inline(always)]
fn reciprocal(dir: Vec3) -> Vec3 {
    (Vec3A::ONE / Vec3A::from(dir)).into()
}

/// The least exact hit so far, over any number of structures.
#[derive(Clone, Copy, Debug)]
pub struct Closest {
    best: Option<(TriangleHit, InstanceId, PrimId)>,
    /// At most the exact t of the best hit; looked at only if there is one.
    t_low: f64,
    /// At least the exact t of the best hit, or the ray's end.
    t_high: f64,
    /// At least `t_high`.
    cull: f32,
}

impl Closest {
    /// Nothing hit yet.
    #[inline(always)]
    pub fn new(ray: &TravRay) -> Self {
        Self { best: None, t_low: 0.0, t_high: f64::from(ray.range.t_far), cull: ray.range.t_far }
    }

    /// Nothing beyond this `t` can change the answer: at least the best hit's exact t, or the ray's end.
    #[inline(always)]
    pub fn t_cull(&self) -> f32 {
        self.cull
    }

    /// As [`Closest::t_cull`], tighter.
    #[inline(always)]
    pub fn t_high(&self) -> f64 {
        self.t_high
    }

    /// The answer, rounded; `ray` must be the one that the hits were offered with.
    #[inline(always)]
    pub fn hit(&self, ray: &TravRay) -> Option<Hit> {
        let (hit, instance, prim) = self.best.as_ref()?;
        Some(rounded(hit, ray, *instance, *prim))
    }

    /// Tests one triangle, as the ray's forms say, and keeps it when it beats the best.
    #[inline(always)]
    pub fn offer<K: HitSink>(&mut self, ray: &TravRay, prims: &Triangles<'_>, prim: PrimId, sink: &K) {
        if ray.forms.leaves == Precision::Fast {
            if let Some(tuv) = fast::test_one(&ray.range, prims.corners(prim), self.cull) {
                self.keep_fast(tuv, prim, sink);
            }
        } else if let Some(hit) = TriangleHit::test(&ray.range, prims.corners(prim)) {
            self.keep(hit, ray, prim, sink);
        }
    }

    /// As [`Closest::offer`], by integers alone.
    #[cold]
    #[inline(never)]
    pub(super) fn offer_exactly<K: HitSink>(&mut self, ray: &TravRay, corners: [Vec3; 3], prim: PrimId, sink: &K) {
        if let Some(hit) = TriangleHit::exactly(&ray.range, corners) {
            self.keep(hit, ray, prim, sink);
        }
    }

    /// Keeps `hit`, which lies in the ray's range, when it beats the best and `sink` accepts it.
    #[inline(always)]
    pub fn keep<K: HitSink>(&mut self, hit: TriangleHit, ray: &TravRay, prim: PrimId, sink: &K) {
        if self.best.is_some() && hit.t_high >= self.t_low {
            if hit.t_low > self.t_high {
                return;
            }
            // A copy, so that the hit itself can stay in registers.
            let copy = hit;
            if !self.wins_exactly(&copy, ray, prim, sink) {
                return;
            }
        }
        let (instance, prim) = sink.key(prim);
        if !K::ACCEPTS_ALL && !sink.accept(&rounded(&hit, ray, instance, prim)) {
            return;
        }
        self.best = Some((hit, instance, prim));
        self.t_low = hit.t_low;
        self.t_high = hit.t_high;
        self.cull = round_up(hit.t_high);
    }

    /// Keeps a hit of the fast test, at most [`Closest::t_cull`] away, when it beats the best and `sink` accepts it.
    #[inline(always)]
    pub(super) fn keep_fast<K: HitSink>(&mut self, [t, u, v]: [f32; 3], prim: PrimId, sink: &K) {
        let (instance, prim) = sink.key(prim);
        if let Some((_, best_instance, best_prim)) = self.best
            && t >= self.cull
            && (t > self.cull || (instance, prim) >= (best_instance, best_prim))
        {
            return;
        }
        if !K::ACCEPTS_ALL && !sink.accept(&Hit { t, u, v, prim, instance }) {
            return;
        }
        let (u, v) = (f64::from(u), f64::from(v));
        let t_known = f64::from(t);
        // Volumes over a D of 1, all without error: they round to what they are.
        let quotients = Quotients { inv_det: 1.0, u, v, det_error: 0.0, uv_error: 0.0 };
        let hit = TriangleHit { corners: [Vec3::ZERO; 3], t_low: t_known, t_high: t_known, quotients };
        self.best = Some((hit, instance, prim));
        (self.t_low, self.t_high, self.cull) = (t_known, t_known, t);
    }

    /// Decides between hits whose bounds on t overlap.
    #[cold]
    #[inline(never)]
    fn wins_exactly<K: HitSink>(&self, hit: &TriangleHit, ray: &TravRay, prim: PrimId, sink: &K) -> bool {
        let Some((best, best_instance, best_prim)) = &self.best else { return true };
        match hit.cmp_t(best, &ray.range) {
            Ordering::Less => true,
            Ordering::Greater => false,
            Ordering::Equal => sink.key(prim) < (*best_instance, *best_prim),
        }
    }
}

/// Tests one triangle, as the ray's forms say: whether it counts for an occlusion query.
#[inline(always)]
pub(super) fn is_blocked_by<K: HitSink>(ray: &TravRay, prims: &Triangles<'_>, prim: PrimId, sink: &K) -> bool {
    if ray.forms.leaves == Precision::Fast {
        let tuv = fast::test_one(&ray.range, prims.corners(prim), ray.range.t_far);
        tuv.is_some_and(|tuv| fast::accepts(tuv, prim, sink))
    } else {
        TriangleHit::test(&ray.range, prims.corners(prim)).is_some_and(|hit| blocks(&hit, ray, prim, sink))
    }
}

/// Whether a hit of one triangle counts for an occlusion query.
#[inline(always)]
pub(super) fn blocks<K: HitSink>(hit: &TriangleHit, ray: &TravRay, prim: PrimId, sink: &K) -> bool {
    if K::ACCEPTS_ALL {
        return true;
    }
    let (instance, prim) = sink.key(prim);
    sink.accept(&rounded(hit, ray, instance, prim))
}

#[inline(always)]
fn rounded(hit: &TriangleHit, ray: &TravRay, instance: InstanceId, prim: PrimId) -> Hit {
    let [t, u, v] = hit.tuv(&ray.range);
    Hit { t, u, v, prim, instance }
}

/// The least f32 that is not below `t`; `t` must not exceed the range of f32 by more than a rounding.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the rounding is what is asked for")]
pub(super) fn round_up(t: f64) -> f32 {
    let near = t as f32;
    // The next number up, without a branch: half of all numbers take it.
    let bits = near.to_bits().cast_signed();
    let step = i32::from(f64::from(near) < t) * (bits >> 31 | 1);
    f32::from_bits(bits.wrapping_add(step).cast_unsigned())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn number() -> impl Strategy<Value = f64> {
        let bits = any::<u32>().prop_map(|bits| f64::from(f32::from_bits(bits)));
        let near = (bits.clone(), -3_i64..4).prop_map(|(x, steps)| {
            f64::from_bits(x.to_bits().saturating_add_signed(steps)) // a few steps of f64 from an f32
        });
        prop_oneof![
            bits,
            near,
            any::<f64>(),
            Just(0.0),
            Just(-0.0),
            Just(1e-60),
            Just(-1e-60),
            Just(f64::from(f32::MAX))
        ]
    }

    proptest! {
        #[test]
        fn rounding_up_gives_the_least_number_that_is_not_below(t in number()) {
            prop_assume!(t.abs() <= f64::from(f32::MAX));
            let up = round_up(t);
            prop_assert!(f64::from(up) >= t && f64::from(up.next_down()) < t, "{} for {}", up, t);
        }
    }
}
