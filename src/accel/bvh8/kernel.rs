//! Eight boxes against one ray.

use super::{
    format::Format,
    node::{EightNode, Link},
    tree::Tree8,
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::{BlockRay, TriBlock},
        packet::PacketRays,
        query::SLACK,
        slabs::{self, Line},
        topology::MAX_DEPTH,
        wide::{
            Place, Tree, WIDTH, WideNode,
            walk::{self, Kernel},
        },
    },
    geom::Triangles,
    simd::{Lanes, Scalar, Simd, Stack, Task},
};

/// A ray against eight boxes at once, in f32. The proof at [`Slab`](crate::accel::slabs::Slab) holds lane by lane; with 2^-126 of slack on exits a box that the ray meets
/// within `[t_near, limit]` is never lost.
///
/// Numbers are spread over lanes where they are used: that is a load.
pub(super) struct Boxes {
    line: Line,
    /// Where the ray runs downward.
    backward: [bool; 3],
    t_near: f32,
    /// The limit with slack.
    limit: f32,
}

impl Boxes {
    /// No ray.
    pub(super) const IDLE: Self = Self {
        line: Line { entry_mul: [0.0; 4], entry_add: [0.0; 4], exit_mul: [0.0; 4], exit_add: [0.0; 4] },
        backward: [false; 3],
        t_near: 0.0,
        limit: 0.0,
    };

    /// Takes ray i of many.
    #[inline(always)]
    pub(super) fn take(&mut self, rays: &PacketRays, i: usize) {
        for axis in 0..3 {
            let rows = &rays.lines.rows[axis];
            self.line.entry_mul[axis] = rows[0][i];
            self.line.entry_add[axis] = rows[1][i];
            self.line.exit_mul[axis] = rows[2][i];
            self.line.exit_add[axis] = rows[3][i];
            self.backward[axis] = rays.backward[axis] >> i & 1 == 1;
        }
        self.t_near = rays.t_near32[i];
        self.set_limit(rays.t_cull[i]);
    }

    #[inline(always)]
    pub(super) fn new<S: Simd>(ray: &TravRay, reach: f32, limit: f32) -> Self {
        let dir = ray.range().dir;
        Self {
            line: Line::new::<S>(ray, reach),
            backward: [dir.x < 0.0, dir.y < 0.0, dir.z < 0.0],
            t_near: ray.range().t_near,
            limit: limit + SLACK,
        }
    }

    /// Nothing beyond counts any more. True where more did before.
    #[inline(always)]
    pub(super) fn set_limit(&mut self, limit: f32) -> bool {
        let before = self.limit;
        self.limit = limit + SLACK;
        self.limit < before
    }

    /// The greatest key whose [`key_floor`](crate::simd::key_floor) is within the limit.
    #[inline(always)]
    pub(super) fn last_key(&self) -> u32 {
        crate::simd::last_key(self.limit)
    }

    /// False when what the ray enters there lies beyond the limit.
    #[inline(always)]
    pub(super) fn reaches(&self, entry: f32) -> bool {
        entry <= self.limit
    }

    /// Where the ray enters each child, and bits of the children that it may meet before the limit. Each walk waits for this, so the chain of operations is as
    /// short as can be.
    #[inline(always)]
    pub(super) fn test<S: Simd>(&self, node: &impl EightNode) -> (S::F8, u32) {
        let (t_near, limit) = (S::F8::splat(self.t_near), S::F8::splat(self.limit));
        let (mut entries, mut exits) = ([t_near; 3], [limit; 3]);
        let Line { entry_mul, entry_add, exit_mul, exit_add } = &self.line;
        for axis in 0..3 {
            let backward = self.backward[axis];
            let (first, last) =
                (node.planes::<S>(axis, usize::from(backward)), node.planes::<S>(axis, usize::from(!backward)));
            entries[axis] = first.mul_add_loose(S::F8::splat(entry_mul[axis]), S::F8::splat(entry_add[axis]));
            exits[axis] = last.mul_add_loose(S::F8::splat(exit_mul[axis]), S::F8::splat(exit_add[axis]));
        }
        let near = entries[0].max(entries[1]).max(entries[2].max(t_near));
        let far = exits[0].min(exits[1]).min(exits[2].min(limit));
        (near, near.le(far) & node.present())
    }
}

/// A child to visit: its link below the bits of where the ray enters it, which order as the entries do, for they are not negative.
#[inline(always)]
fn due(entry: f32, link: Link) -> u64 {
    u64::from(entry.to_bits()) << 32 | u64::from(link.bits())
}

/// The link of a due child.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the lower half")]
fn link_of(due: u64) -> Link {
    Link::from_bits(due as u32)
}

/// Where the ray enters a due child.
#[inline(always)]
fn entry_of(due: u64) -> f32 {
    f32::from_bits((due >> 32) as u32)
}

/// Length of stacks: all children but one at every level, and room to add eight at once.
pub(super) const MAX_STACK: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

/// Number of the lowest set bit, in a form that bounds checks understand.
#[inline(always)]
fn first(hits: u32) -> usize {
    (hits.trailing_zeros() & 7) as usize
}

/// Offers the triangles of a leaf.
pub(super) struct ClosestLeaf<'a, F: Format, C, K> {
    pub(super) tree: &'a Tree8<F>,
    pub(super) link: Link,
    pub(super) ray: (&'a TravRay, &'a Triangles<'a>),
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<F: Format, C: Counter, K: HitSink> Task for ClosestLeaf<'_, F, C, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, link, ray: (ray, prims), best, sink, count } = self;
        let (block_ray, mut room) = (BlockRay::new(ray, tree.reach), TriBlock::EMPTY);
        for i in 0..tree.span(link) {
            let block = tree.block((link, i), prims, &mut room, count);
            block.closest::<S, C, K>(ray, &block_ray, best, sink, count);
        }
    }
}

/// Whether a triangle of a leaf blocks a ray.
pub(super) struct OccludedLeaf<'a, F: Format, C, K> {
    pub(super) tree: &'a Tree8<F>,
    pub(super) link: Link,
    pub(super) ray: (&'a TravRay, &'a Triangles<'a>),
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<F: Format, C: Counter, K: HitSink> Task for OccludedLeaf<'_, F, C, K> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { tree, link, ray: (ray, prims), sink, count } = self;
        let (block_ray, mut room) = (BlockRay::new(ray, tree.reach), TriBlock::EMPTY);
        for i in 0..tree.span(link) {
            let block = tree.block((link, i), prims, &mut room, count);
            if block.occluded::<S, C, K>(ray, &block_ray, sink, count) {
                return true;
            }
        }
        false
    }
}

/// Offers the triangles below a node or leaf to a ray whose f32 tests are proven, nearest children first.
#[inline(always)]
fn closest<S: Simd, F: Format, C: Counter, K: HitSink>(
    tree: &Tree8<F>,
    start: Link,
    ray: (&TravRay, &Triangles<'_>),
    best: &mut Closest,
    sink: &K,
    count: &mut C,
) {
    let mut boxes = Boxes::new::<S>(ray.0, tree.reach, best.t_cull());
    let mut stack = Stack::<u64, MAX_STACK>::new();
    let mut link = start;
    loop {
        if link.is_leaf() {
            // Called, so that it claims none of the walk's registers.
            S::call(ClosestLeaf { tree, link, ray, best, sink, count });
            boxes.set_limit(best.t_cull());
        } else {
            count.node();
            let node = &tree.nodes[link.index()];
            let (near, mut hits) = boxes.test::<S>(node);
            if hits != 0 {
                let mut entries = [0.0; WIDTH];
                near.store(&mut entries);
                let child = |slot: usize| due(entries[slot], node.word(slot));
                let slot = first(hits);
                hits &= hits - 1;
                if hits == 0 {
                    link = node.word(slot).predicted();
                    continue;
                }
                let (mut near, mut far) = (child(slot), child(first(hits)));
                hits &= hits - 1;
                if far < near {
                    (near, far) = (far, near);
                }
                if hits == 0 {
                    stack.push(far);
                    link = link_of(near).predicted();
                    continue;
                }
                let mut keys = [near, far, 0, 0, 0, 0, 0, 0];
                let mut len = 2;
                while hits != 0 {
                    keys[len & 7] = child(first(hits));
                    hits &= hits - 1;
                    len += 1;
                }
                walk::sort(&mut keys, len);
                for &key in keys[1..len].iter().rev() {
                    stack.push(key);
                }
                link = link_of(keys[0]);
                continue;
            }
        }
        link = loop {
            let Some(due) = stack.pop() else { return };
            if boxes.reaches(entry_of(due)) {
                break link_of(due);
            }
        };
    }
}

/// True when a triangle below a node or leaf blocks a ray whose f32 tests are proven.
#[inline(always)]
fn occluded<S: Simd, F: Format, C: Counter, K: HitSink>(
    tree: &Tree8<F>,
    start: Link,
    ray: (&TravRay, &Triangles<'_>),
    sink: &K,
    count: &mut C,
) -> bool {
    let boxes = Boxes::new::<S>(ray.0, tree.reach, ray.0.range().t_far);
    let mut stack = Stack::<Link, MAX_STACK>::new();
    let mut link = start;
    loop {
        if link.is_leaf() {
            if S::call(OccludedLeaf { tree, link, ray, sink, count }) {
                return true;
            }
        } else {
            count.node();
            let node = &tree.nodes[link.index()];
            let (_, mut hits) = boxes.test::<S>(node);
            if hits != 0 {
                link = node.word(first(hits)).predicted();
                hits &= hits - 1;
                while hits != 0 {
                    stack.push(node.word(first(hits)));
                    hits &= hits - 1;
                }
                continue;
            }
        }
        match stack.pop() {
            Some(next) => link = next,
            None => return false,
        }
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

impl<F: Format> Kernel<Tree8<F>> for WideKernel {
    type Mark = f64;
    type Kids = [f64; WIDTH];

    fn kids() -> [f64; WIDTH] {
        [0.0; WIDTH]
    }

    fn test(&self, node: &F::Node, _entry: f64, entries: &mut [f64; WIDTH]) -> u32 {
        let mut hits = 0;
        for (child, at) in entries.iter_mut().enumerate() {
            let (mut near, mut far) = (self.t_near, self.limit);
            for axis in 0..3 {
                let plane =
                    |side: usize| (f64::from(node.plane(axis, side, child)) - self.origin[axis]) * self.inv[axis];
                let backward = usize::from(self.inv[axis] < 0.0);
                let (entry, exit) = (plane(backward) * (2.0 - WIDEN), plane(1 - backward) * WIDEN);
                near = if entry > near { entry } else { near };
                far = if exit < far { exit } else { far };
            }
            hits |= u32::from(near <= far) << child;
            *at = near;
        }
        hits & node.present()
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
pub(super) struct ClosestFrom<'a, F: Format, C, K> {
    pub(super) tree: &'a Tree8<F>,
    pub(super) start: Link,
    pub(super) ray: (&'a TravRay, &'a Triangles<'a>),
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<F: Format, C: Counter, K: HitSink> Task for ClosestFrom<'_, F, C, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, start, ray, best, sink, count } = self;
        closest::<S, F, C, K>(tree, start, ray, best, sink, count);
    }
}

/// As [`ClosestFrom`]: whether anything is hit.
pub(super) struct OccludedFrom<'a, F: Format, C, K> {
    pub(super) tree: &'a Tree8<F>,
    pub(super) start: Link,
    pub(super) ray: (&'a TravRay, &'a Triangles<'a>),
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<F: Format, C: Counter, K: HitSink> Task for OccludedFrom<'_, F, C, K> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { tree, start, ray, sink, count } = self;
        occluded::<S, F, C, K>(tree, start, ray, sink, count)
    }
}

impl<F: Format> Tree8<F> {
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
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        if self.fits(ray.0) {
            closest::<S, F, C, K>(self, Self::root(), ray, best, sink, count);
        } else {
            self.closest_wide(ray, best, sink, count);
        }
    }

    /// Rare, so compiled once, not for every level.
    #[cold]
    #[inline(never)]
    pub(super) fn closest_wide<C: Counter, K: HitSink>(
        &self,
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        let (test, start) = (WideKernel::new(ray.0, best.t_high()), (Self::root(), f64::from(ray.0.range().t_near)));
        walk::closest::<Scalar, _, _, C, K>(self, test, start, ray, best, sink, count);
    }

    #[inline(always)]
    pub(super) fn walk_occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: (&TravRay, &Triangles<'_>),
        sink: &K,
        count: &mut C,
    ) -> bool {
        if self.fits(ray.0) {
            occluded::<S, F, C, K>(self, Self::root(), ray, sink, count)
        } else {
            self.occluded_wide(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    pub(super) fn occluded_wide<C: Counter, K: HitSink>(
        &self,
        ray: (&TravRay, &Triangles<'_>),
        sink: &K,
        count: &mut C,
    ) -> bool {
        let (near, far) = (f64::from(ray.0.range().t_near), f64::from(ray.0.range().t_far));
        walk::occluded::<Scalar, _, _, C, K>(self, &WideKernel::new(ray.0, far), (Self::root(), near), ray, sink, count)
    }
}

/// The children of a node that a ray meets, in f32 and in f64.
#[cfg(test)]
#[inline(always)]
pub(super) fn met<S: Simd, F: Format>(ray: &TravRay, node: &F::Node, reach: f32) -> [u32; 2] {
    let t_far = ray.range().t_far;
    let (fast, wide) = (Boxes::new::<S>(ray, reach, t_far), WideKernel::new(ray, f64::from(t_far)));
    let wide = Kernel::<Tree8<F>>::test(&wide, node, 0.0, &mut [0.0; WIDTH]);
    [fast.test::<S>(node).1 & 0xff, wide]
}
