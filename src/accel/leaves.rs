//! What partitions of space do with a ray's line and with the objects it comes upon; shared by `grid`, `kdtree` and `grug`.
//!
//! Their cells and leaves own runs of *units*: single objects, tested by a [`Visitor`], or blocks of four triangles. The walk is
//! the same.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    Closest, Counter, HitSink, TravRay, Visitor,
    block::{BlockRay, NO_PRIM, TriBlock},
    query::round_up,
    sah::BLOCK,
};
use crate::{
    geom::{Aabb, Triangles, exact::RayRange},
    simd::{Scalar, Simd},
};

/// Tests the units that a walk comes upon.
pub(super) trait Leaves {
    /// Nothing beyond this t can change the answer any more.
    fn t_limit(&self) -> f64;
    /// At least [`Leaves::t_limit`].
    fn t_cull(&self) -> f32;
    /// Tests a run of units. True ends the walk.
    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool;
    /// The same for walks that few rays need.
    fn rare(&mut self) -> &mut dyn RareLeaves;
}

/// [`Leaves`] by pointer and without SIMD, so that a walk that few rays need is compiled once.
pub(super) trait RareLeaves {
    /// [`Leaves::t_limit`] and [`Leaves::t_cull`].
    fn limits(&self) -> (f64, f32);
    /// As [`Leaves::leaf`].
    fn test(&mut self, units: Range<usize>, count: &mut dyn Counter) -> bool;
}

impl<L: Leaves> RareLeaves for L {
    fn limits(&self) -> (f64, f32) {
        (self.t_limit(), self.t_cull())
    }

    fn test(&mut self, units: Range<usize>, count: &mut dyn Counter) -> bool {
        self.leaf(units, &mut RareCounter(count))
    }
}

/// A counter by pointer.
pub(super) struct RareCounter<'a>(pub(super) &'a mut dyn Counter);

impl Counter for RareCounter<'_> {
    fn node(&mut self) {
        self.0.node();
    }
    fn prim(&mut self) {
        self.0.prim();
    }
    fn block(&mut self) {
        self.0.block();
    }
    fn step(&mut self) {
        self.0.step();
    }
    fn event(&mut self) {
        self.0.event();
    }
    fn skip(&mut self) {
        self.0.skip();
    }
    fn read(&mut self, address: usize, bytes: usize) {
        self.0.read(address, bytes);
    }
}

/// Leaves by pointer, for walks that are generic over them.
pub(super) struct ByPointer<'a>(pub(super) &'a mut dyn RareLeaves);

impl Leaves for ByPointer<'_> {
    fn t_limit(&self) -> f64 {
        self.0.limits().0
    }

    fn t_cull(&self) -> f32 {
        self.0.limits().1
    }

    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool {
        self.0.test(units, count)
    }

    fn rare(&mut self) -> &mut dyn RareLeaves {
        self.0
    }
}

/// Single objects, left to a [`Visitor`].
pub(super) struct Objects<'a, V> {
    pub(super) items: &'a [u32],
    pub(super) visitor: &'a mut V,
}

impl<V: Visitor> Leaves for Objects<'_, V> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        self.visitor.t_limit()
    }

    #[inline(always)]
    fn t_cull(&self) -> f32 {
        round_up(self.visitor.t_limit().min(f64::from(f32::MAX)))
    }

    #[inline(always)]
    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool {
        for &object in &self.items[units] {
            count.prim();
            if self.visitor.visit(object) {
                return true;
            }
        }
        false
    }

    fn rare(&mut self) -> &mut dyn RareLeaves {
        self
    }
}

/// Blocks of triangles, for the closest hit; `reach` as in [`BlockRay::new`].
pub(super) struct ClosestBlocks<'a, K> {
    pub(super) blocks: &'a [TriBlock],
    pub(super) ray: &'a TravRay,
    pub(super) block_ray: BlockRay,
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a K,
}

/// [`ClosestBlocks`] at one SIMD level.
pub(super) struct ClosestLeaves<'a, S, K>(pub(super) ClosestBlocks<'a, K>, pub(super) std::marker::PhantomData<S>);

impl<'a, S, K> ClosestLeaves<'a, S, K> {
    #[inline(always)]
    pub(super) fn new(
        blocks: &'a [TriBlock],
        reach: f32,
        ray: &'a TravRay,
        best: &'a mut Closest,
        sink: &'a K,
    ) -> Self {
        let block_ray = BlockRay::new(ray, reach);
        Self(ClosestBlocks { blocks, ray, block_ray, best, sink }, std::marker::PhantomData)
    }
}

impl<S: Simd, K: HitSink> Leaves for ClosestLeaves<'_, S, K> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        self.0.best.t_high()
    }

    #[inline(always)]
    fn t_cull(&self) -> f32 {
        self.0.best.t_cull()
    }

    #[inline(always)]
    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool {
        let ClosestBlocks { blocks, ray, block_ray, best, sink } = &mut self.0;
        for block in &blocks[units] {
            block.closest::<S, C, K>(ray, block_ray, best, sink, count);
        }
        false
    }

    fn rare(&mut self) -> &mut dyn RareLeaves {
        &mut self.0
    }
}

impl<K: HitSink> RareLeaves for ClosestBlocks<'_, K> {
    fn limits(&self) -> (f64, f32) {
        (self.best.t_high(), self.best.t_cull())
    }

    fn test(&mut self, units: Range<usize>, count: &mut dyn Counter) -> bool {
        let Self { blocks, ray, block_ray, best, sink } = self;
        for block in &blocks[units] {
            block.closest::<Scalar, _, K>(ray, block_ray, best, sink, &mut RareCounter(count));
        }
        false
    }
}

/// Blocks of triangles, for any hit.
pub(super) struct OccludedBlocks<'a, K> {
    blocks: &'a [TriBlock],
    ray: &'a TravRay,
    block_ray: BlockRay,
    sink: &'a K,
}

/// [`OccludedBlocks`] at one SIMD level.
pub(super) struct OccludedLeaves<'a, S, K>(OccludedBlocks<'a, K>, std::marker::PhantomData<S>);

impl<'a, S, K> OccludedLeaves<'a, S, K> {
    #[inline(always)]
    pub(super) fn new(blocks: &'a [TriBlock], reach: f32, ray: &'a TravRay, sink: &'a K) -> Self {
        let block_ray = BlockRay::new(ray, reach);
        Self(OccludedBlocks { blocks, ray, block_ray, sink }, std::marker::PhantomData)
    }
}

impl<S: Simd, K: HitSink> Leaves for OccludedLeaves<'_, S, K> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        f64::from(self.t_cull())
    }

    #[inline(always)]
    fn t_cull(&self) -> f32 {
        self.0.ray.range().t_far
    }

    #[inline(always)]
    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool {
        let OccludedBlocks { blocks, ray, block_ray, sink } = &self.0;
        for block in &blocks[units] {
            if block.occluded::<S, C, K>(ray, block_ray, *sink, count) {
                return true;
            }
        }
        false
    }

    fn rare(&mut self) -> &mut dyn RareLeaves {
        &mut self.0
    }
}

impl<K: HitSink> RareLeaves for OccludedBlocks<'_, K> {
    fn limits(&self) -> (f64, f32) {
        let t_far = self.ray.range().t_far;
        (f64::from(t_far), t_far)
    }

    fn test(&mut self, units: Range<usize>, count: &mut dyn Counter) -> bool {
        let Self { blocks, ray, block_ray, sink } = self;
        let mut count = RareCounter(count);
        blocks[units].iter().any(|block| block.occluded::<Scalar, _, K>(ray, block_ray, *sink, &mut count))
    }
}

/// Blocks of `items`, four to a block, with the corners of `prims`. [`NO_PRIM`] leaves a lane empty.
pub(super) fn pack(items: &[u32], prims: &Triangles<'_>) -> Vec<TriBlock> {
    let (quads, rest) = items.as_chunks::<BLOCK>();
    debug_assert!(rest.is_empty());
    let block = |&quad: &[u32; BLOCK]| {
        let mut block = TriBlock::new(quad);
        block.refit(prims);
        block
    };
    quads.par_iter().with_min_len(4096).map(block).collect()
}

/// Appends the objects of a leaf, filled up to whole units; the units' numbers.
#[inline(always)]
pub(super) fn append_leaf(items: &mut Vec<u32>, objects: impl Iterator<Item = u32>, unit: usize) -> Range<usize> {
    let first = items.len() / unit;
    items.extend(objects);
    items.resize(items.len().next_multiple_of(unit), NO_PRIM);
    first..items.len() / unit
}

/// A ray's line in f64, where differences and products of f32 neither overflow nor underflow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) origin: [f64; 3],
    pub(super) dir: [f64; 3],
    pub(super) inv: [f64; 3],
    pub(super) t_near: f64,
}

/// In f64. Written out: `array::map` stays a call here.
#[inline(always)]
fn widened(v: Vec3) -> [f64; 3] {
    [f64::from(v.x), f64::from(v.y), f64::from(v.z)]
}

/// Relative widening that covers the roundings of `(plane - origin) * inv`.
pub(super) const WIDEN: f64 = 1.0 + 16.0 * f64::EPSILON;

/// The other way.
pub(super) const NARROW: f64 = 2.0 - WIDEN;

impl Line {
    #[inline(always)]
    pub(super) fn new(range: &RayRange) -> Self {
        let dir = widened(range.dir);
        Self {
            origin: widened(range.origin),
            dir,
            inv: [1.0 / dir[0], 1.0 / dir[1], 1.0 / dir[2]],
            t_near: f64::from(range.t_near),
        }
    }

    /// Where the ray crosses a plane, rounded; infinite or NaN where it runs along it.
    #[inline(always)]
    pub(super) fn t(&self, axis: usize, plane: f64) -> f64 {
        (plane - self.origin[axis]) * self.inv[axis]
    }

    /// The range of t in which the ray may be inside the box, rounded outward, up to `t_far`. An origin on a plane that the ray runs along
    /// gives NaN, which loses in both comparisons.
    #[inline(always)]
    pub(super) fn clip(&self, low: [f64; 3], high: [f64; 3], t_far: f64) -> Option<(f64, f64)> {
        let (mut near, mut far) = (self.t_near, t_far);
        for axis in 0..3 {
            let (t0, t1) = (self.t(axis, low[axis]), self.t(axis, high[axis]));
            let (entry, exit) = if self.inv[axis] < 0.0 { (t1, t0) } else { (t0, t1) };
            let (entry, exit) = (entry * NARROW, exit * WIDEN);
            near = if entry > near { entry } else { near };
            far = if exit < far { exit } else { far };
        }
        (near <= far).then_some((near, far))
    }

    /// [`Line::clip`] to an f32 box; `None` for an empty one.
    #[inline(always)]
    pub(super) fn clip_to(&self, aabb: &Aabb, t_far: f64) -> Option<(f64, f64)> {
        if aabb.is_empty() {
            return None;
        }
        self.clip(widened(aabb.min), widened(aabb.max), t_far)
    }
}
