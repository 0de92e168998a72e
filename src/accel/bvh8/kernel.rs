//! Eight boxes against one ray.

use super::{
    Bvh8,
    node::{Link, Node},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        query::SLACK,
        slabs::{self, Slab},
        wide::{
            WIDTH,
            walk::{self, Kernel},
        },
    },
    simd::{Lanes, Scalar, Simd, Task},
};

/// All boxes at once, in f32. The proof at [`Slab`] holds lane by lane; with 2^-126 of slack on the comparison a box that the ray meets within
/// `[t_near, limit]` is never lost.
struct FastKernel<S: Simd> {
    slabs: [Slab<f32>; 3],
    /// 1 where the ray runs downward.
    backward: [usize; 3],
    t_near: S::F8,
    limit: S::F8,
    /// The limit with slack.
    cull: f32,
}

impl<S: Simd> FastKernel<S> {
    #[inline(always)]
    fn new(ray: &TravRay, reach: f32, limit: f32) -> Self {
        let (range, slabs) = (ray.range(), slabs::of_ray::<S>(ray, reach));
        let dir = range.dir;
        Self {
            slabs,
            backward: [usize::from(dir.x < 0.0), usize::from(dir.y < 0.0), usize::from(dir.z < 0.0)],
            t_near: S::F8::splat(range.t_near),
            limit: S::F8::splat(limit),
            cull: limit + SLACK,
        }
    }
}

impl<S: Simd> Kernel<Bvh8> for FastKernel<S> {
    type Mark = f32;
    type Kids = [f32; WIDTH];

    #[inline(always)]
    fn kids() -> [f32; WIDTH] {
        [0.0; WIDTH]
    }

    #[inline(always)]
    fn test(&self, node: &Node, _entry: f32, entries: &mut [f32; WIDTH]) -> u32 {
        let (mut near, mut far) = (self.t_near, self.limit);
        for axis in 0..3 {
            let (side, slab) = (self.backward[axis] & 1, &self.slabs[axis]);
            let (first, last) = (S::F8::load(&node.planes[axis][side]), S::F8::load(&node.planes[axis][side ^ 1]));
            let entry = first.mul_add_loose(S::F8::splat(slab.entry_mul), S::F8::splat(slab.entry_add));
            let exit = last.mul_add_loose(S::F8::splat(slab.exit_mul), S::F8::splat(slab.exit_add));
            near = entry.max(near);
            far = exit.min(far);
        }
        near.store(entries);
        (near - far).le(S::F8::splat(SLACK))
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
        let limit = best.t_cull();
        self.cull = limit + SLACK;
        self.limit = S::F8::splat(limit);
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
        let test = FastKernel::<S>::new(ray, tree.reach, best.t_cull());
        walk::closest::<S, _, _, C, K>(tree, test, (start, ray.range().t_near), ray, best, sink, count);
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
        let test = FastKernel::<S>::new(ray, tree.reach, ray.range().t_far);
        walk::occluded::<S, _, _, C, K>(tree, &test, (start, ray.range().t_near), ray, sink, count)
    }
}

impl Bvh8 {
    pub(super) fn root() -> Link {
        Link::inner(0)
    }

    /// True when f32 node tests are proven for this ray and these boxes.
    #[inline(always)]
    pub(super) fn fits(&self, ray: &TravRay) -> bool {
        slabs::fits(ray, self.reach)
    }

    #[inline(always)]
    pub(super) fn walk_closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        if self.fits(ray) {
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
        if self.fits(ray) {
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

/// The children of a node that a ray meets, in f32 and in f64.
#[cfg(test)]
#[inline(always)]
pub(super) fn met<S: Simd>(ray: &TravRay, node: &Node, reach: f32) -> [u32; 2] {
    let t_far = ray.range().t_far;
    let (fast, wide) = (FastKernel::<S>::new(ray, reach, t_far), WideKernel::new(ray, f64::from(t_far)));
    let (mut entries, mut wide_entries) = ([0.0; WIDTH], [0.0; WIDTH]);
    [fast.test(node, 0.0, &mut entries), wide.test(node, 0.0, &mut wide_entries)]
}
