//! Eight boxes against one ray.

use super::{
    Bvh8,
    node::{Link, Node},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        query::{ORDINARY_MAX, SLACK},
        wide::{
            WIDTH,
            walk::{self, Kernel},
        },
    },
    simd::{Lanes, Scalar, Simd, Task},
};

/// Half a unit in the last place of 1.
const U: f32 = 1.0 / 16_777_216.0;

/// Relative slack between entries and exits.
pub(super) const GROW: f32 = 1.0 + 8.0 * U;

/// The limit with all slack. At most `f32::MAX`, or infinite, which no finite product exceeds.
#[inline(always)]
pub(super) fn padded(limit: f32) -> f32 {
    limit * GROW + SLACK
}

/// What a ray or several are to a plane: two numbers an axis and end, and which plane of an axis is the nearer.
///
/// With `FUSED` a plane is passed at `p inv - offset`, else at `(p - offset) inv`.
pub(super) struct Ends<S: Simd, const FUSED: bool> {
    pub(super) near_inv: [S::F8; 3],
    pub(super) near_offset: [S::F8; 3],
    pub(super) far_inv: [S::F8; 3],
    pub(super) far_offset: [S::F8; 3],
    /// 1 where rays run downward.
    pub(super) backward: [usize; 3],
}

/// Entries into all boxes, from `near` on, and exits, up to `far`.
#[inline(always)]
pub(super) fn slabs<S: Simd, const FUSED: bool>(
    node: &Node,
    ends: &Ends<S, FUSED>,
    mut near: S::F8,
    mut far: S::F8,
) -> (S::F8, S::F8) {
    for axis in 0..3 {
        let side = ends.backward[axis] & 1;
        let (first, last) = (S::F8::load(&node.planes[axis][side]), S::F8::load(&node.planes[axis][side ^ 1]));
        let (entry, exit) = if FUSED {
            (
                first.mul_sub_loose(ends.near_inv[axis], ends.near_offset[axis]),
                last.mul_sub_loose(ends.far_inv[axis], ends.far_offset[axis]),
            )
        } else {
            (
                (first - ends.near_offset[axis]) * ends.near_inv[axis],
                (last - ends.far_offset[axis]) * ends.far_inv[axis],
            )
        };
        near = entry.max(near);
        far = exit.min(far);
    }
    (near, far)
}

/// All boxes at once, in f32.
///
/// # Proof that no box is missed, with one fused multiply-add a plane
/// For an ordinary ray ([`TravRay::is_ordinary`]) without a zero in its direction and boxes within 2^60 of 0, with r = fl(1/d) = (1 + e) / d,
/// |e| <= u: the near offsets are at least o r and the far ones at most o r, since fl(o r) is off by at most u |fl(o r)| (1 + u) and
/// 2 u |fl(o r)| is added or taken away, rounded itself by another u. So before its one rounding an entry is at most (p - o) r and an
/// exit at least (p - o) r. Where these are not negative they are t (1 + e) with the t of exact arithmetic, and with the
/// rounding of the result within 2.01 u of it; products that underflow are off by less than 2^-126. Where the exact entry is negative the
/// computed one is not positive, and `t_near` takes its place. So entries and exits that meet in truth satisfy entry <= exit (1 + 8 u) +
/// 2^-126. Nothing overflows: |p r| <= 2^120.
///
/// # With a subtraction and a product
/// For directions with zeros, and for levels without fused multiply-add, (p - o) is rounded first, which costs one more u. On an axis with `d = 0` (always
/// +0) the reciprocal is +inf: a plane on the wrong side gives an infinity that misses the box, as the ray does in truth; one on the right
/// side an infinity that does not count, and the origin on a plane 0 * inf = NaN, which loses in the minimum and the maximum, whose second operand is the
/// running value.
struct FastKernel<S: Simd, const FUSED: bool> {
    ends: Ends<S, FUSED>,
    t_near: S::F8,
    /// With slack.
    limit: S::F8,
    cull: f32,
}

impl<S: Simd, const FUSED: bool> FastKernel<S, FUSED> {
    #[inline(always)]
    fn new(ray: &TravRay, limit: f32) -> Self {
        let range = ray.range();
        let inv = ray.inv();
        let (near, far) = if FUSED {
            let offset = range.origin * inv;
            let pad = offset.abs() * (2.0 * U);
            (offset + pad, offset - pad)
        } else {
            (range.origin, range.origin)
        };
        let inv = [S::F8::splat(inv.x), S::F8::splat(inv.y), S::F8::splat(inv.z)];
        let dir = range.dir;
        let cull = padded(limit);
        Self {
            ends: Ends {
                near_inv: inv,
                near_offset: [S::F8::splat(near.x), S::F8::splat(near.y), S::F8::splat(near.z)],
                far_inv: inv,
                far_offset: [S::F8::splat(far.x), S::F8::splat(far.y), S::F8::splat(far.z)],
                backward: [usize::from(dir.x < 0.0), usize::from(dir.y < 0.0), usize::from(dir.z < 0.0)],
            },
            t_near: S::F8::splat(range.t_near),
            limit: S::F8::splat(cull),
            cull,
        }
    }
}

impl<S: Simd, const FUSED: bool> Kernel<Bvh8> for FastKernel<S, FUSED> {
    type Mark = f32;
    type Kids = [f32; WIDTH];

    #[inline(always)]
    fn kids() -> [f32; WIDTH] {
        [0.0; WIDTH]
    }

    #[inline(always)]
    fn test(&self, node: &Node, _entry: f32, entries: &mut [f32; WIDTH]) -> u32 {
        let (near, far) = slabs(node, &self.ends, self.t_near, self.limit);
        near.store(entries);
        near.le(far.mul_add_loose(S::F8::splat(GROW), S::F8::splat(SLACK)))
    }

    #[inline(always)]
    fn mark(entries: &[f32; WIDTH], slot: usize) -> f32 {
        entries[slot]
    }

    #[inline(always)]
    fn key(entries: &[f32; WIDTH], slot: usize) -> u64 {
        walk::key32(entries[slot], slot)
    }

    #[inline(always)]
    fn limit(&mut self, best: &Closest) {
        self.cull = padded(best.t_cull());
        self.limit = S::F8::splat(self.cull);
    }

    #[inline(always)]
    fn reopened(&self, entry: f32) -> Option<f32> {
        (entry <= self.cull).then_some(entry)
    }

    #[inline(always)]
    fn may_meet<T: Simd>(&self, _block: &TriBlock, _entry: f32) -> bool {
        true
    }
}

/// The same test in f64, one box after the other, for every finite ray and box.
///
/// Differences and products of f32 neither overflow nor underflow in f64 here; the relative errors are below 4 * 2^-53,
/// covered by the widening.
struct WideKernel {
    origin: [f64; 3],
    inv: [f64; 3],
    t_near: f64,
    limit: f64,
}

/// Relative widening of exits.
const WIDEN: f64 = 1.0 + 16.0 * f64::EPSILON;

impl WideKernel {
    fn new(ray: &TravRay, limit: f64) -> Self {
        let range = ray.range();
        let inv = range.dir.to_array().map(|d| 1.0 / f64::from(d));
        Self { origin: range.origin.to_array().map(f64::from), inv, t_near: f64::from(range.t_near), limit }
    }
}

impl Kernel<Bvh8> for WideKernel {
    type Mark = f64;
    type Kids = [f64; WIDTH];

    fn kids() -> [f64; WIDTH] {
        [0.0; WIDTH]
    }

    fn test(&self, node: &Node, _entry: f64, entries: &mut [f64; WIDTH]) -> u32 {
        let mut hits = 0;
        for (child, at) in entries.iter_mut().enumerate() {
            let (mut near, mut far) = (self.t_near, self.limit);
            for axis in 0..3 {
                let plane =
                    |side: usize| (f64::from(node.planes[axis][side][child]) - self.origin[axis]) * self.inv[axis];
                let backward = usize::from(self.inv[axis] < 0.0);
                let (entry, exit) = (plane(backward) * (2.0 - WIDEN), plane(1 - backward) * WIDEN);
                near = if entry > near { entry } else { near };
                far = if exit < far { exit } else { far };
            }
            hits |= u32::from(near <= far) << child;
            *at = near;
        }
        hits
    }

    fn mark(entries: &[f64; WIDTH], slot: usize) -> f64 {
        entries[slot]
    }

    fn key(entries: &[f64; WIDTH], slot: usize) -> u64 {
        walk::key64(entries[slot], slot)
    }

    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_high();
    }

    fn reopened(&self, entry: f64) -> Option<f64> {
        (entry <= self.limit).then_some(entry)
    }

    fn may_meet<S: Simd>(&self, _block: &TriBlock, _entry: f64) -> bool {
        true
    }
}

/// The closest hit of one ordinary ray below a node.
pub(super) struct ClosestFrom<'a, C, K> {
    pub(super) tree: &'a Bvh8,
    pub(super) start: Link,
    pub(super) ray: &'a TravRay,
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<C: Counter, K: HitSink> Task for ClosestFrom<'_, C, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, start, ray, best, sink, count } = self;
        let start = (start, ray.range().t_near);
        if S::FUSED && is_slanted(ray) {
            let test = FastKernel::<S, true>::new(ray, best.t_cull());
            walk::closest::<S, _, _, C, K>(tree, test, start, ray, best, sink, count);
        } else {
            let test = FastKernel::<S, false>::new(ray, best.t_cull());
            walk::closest::<S, _, _, C, K>(tree, test, start, ray, best, sink, count);
        }
    }
}

/// As [`ClosestFrom`]: whether anything is hit.
pub(super) struct OccludedFrom<'a, C, K> {
    pub(super) tree: &'a Bvh8,
    pub(super) start: Link,
    pub(super) ray: &'a TravRay,
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<C: Counter, K: HitSink> Task for OccludedFrom<'_, C, K> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { tree, start, ray, sink, count } = self;
        let (start, t_far) = ((start, ray.range().t_near), ray.range().t_far);
        if S::FUSED && is_slanted(ray) {
            walk::occluded::<S, _, _, C, K>(tree, &FastKernel::<S, true>::new(ray, t_far), start, ray, sink, count)
        } else {
            walk::occluded::<S, _, _, C, K>(tree, &FastKernel::<S, false>::new(ray, t_far), start, ray, sink, count)
        }
    }
}

/// True when the ray is parallel to no plane of a box.
#[inline(always)]
pub(super) fn is_slanted(ray: &TravRay) -> bool {
    !ray.range().dir.cmpeq(glam::Vec3::ZERO).any()
}

impl Bvh8 {
    pub(super) fn root() -> Link {
        Link::inner(0)
    }

    /// True when f32 node tests are proven for this ray and these boxes.
    #[inline(always)]
    pub(super) fn is_ordinary(&self, ray: &TravRay) -> bool {
        ray.is_ordinary() && self.reach <= ORDINARY_MAX
    }

    #[inline(always)]
    pub(super) fn walk_closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        if self.is_ordinary(ray) {
            // Called, so that packets which fall apart share the code.
            S::call(ClosestFrom { tree: self, start: Self::root(), ray, best, sink, count });
        } else {
            self.closest_wide(ray, best, sink, count);
        }
    }

    /// Rare, so compiled once, not for every level.
    #[cold]
    #[inline(never)]
    fn closest_wide<C: Counter, K: HitSink>(&self, ray: &TravRay, best: &mut Closest, sink: &K, count: &mut C) {
        let (test, start) = (WideKernel::new(ray, best.t_high()), (Self::root(), f64::from(ray.range().t_near)));
        walk::closest::<Scalar, _, _, C, K>(self, test, start, ray, best, sink, count);
    }

    #[inline(always)]
    pub(super) fn walk_occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        if self.is_ordinary(ray) {
            S::call(OccludedFrom { tree: self, start: Self::root(), ray, sink, count })
        } else {
            self.occluded_wide(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    fn occluded_wide<C: Counter, K: HitSink>(&self, ray: &TravRay, sink: &K, count: &mut C) -> bool {
        let (near, far) = (f64::from(ray.range().t_near), f64::from(ray.range().t_far));
        walk::occluded::<Scalar, _, _, C, K>(self, &WideKernel::new(ray, far), (Self::root(), near), ray, sink, count)
    }
}

/// The children of a node that a ray meets: fused, plain and in f64.
#[cfg(test)]
#[inline(always)]
pub(super) fn met<S: Simd>(ray: &TravRay, node: &Node) -> [u32; 3] {
    let t_far = ray.range().t_far;
    let (fused, plain) = (FastKernel::<S, true>::new(ray, t_far), FastKernel::<S, false>::new(ray, t_far));
    let wide = WideKernel::new(ray, f64::from(t_far));
    let (mut entries, mut wide_entries) = ([0.0; WIDTH], [0.0; WIDTH]);
    [fused.test(node, 0.0, &mut entries), plain.test(node, 0.0, &mut entries), wide.test(node, 0.0, &mut wide_entries)]
}
