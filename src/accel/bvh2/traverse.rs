use arrayvec::ArrayVec;

use super::{
    Bvh2, MAX_DEPTH,
    node::{Link, Pair},
};
use crate::{
    accel::{Closest, Counter, HitSink, TravRay, block::BlockRay, query::SLACK, slabs},
    simd::{Halves, Lanes, Scalar, Simd, branch_barrier},
};

/// Far children to visit: a link and a lower bound of the t at which the ray enters.
///
/// A walk keeps at most one entry a level and the builder bounds the depth, so it cannot overflow.
type Stack<T> = ArrayVec<(Link, T), MAX_DEPTH>;

/// A way to test a pair of nodes: by f32 vectors for ordinary rays, by f64 scalars for all.
trait NodeTest: Copy {
    type T: Copy + PartialOrd;

    /// Bits of the children whose boxes the ray may meet before the limit, and where it enters each, rounded down.
    fn test(&self, pair: &Pair) -> (u32, [Self::T; 2]);
    /// Nothing beyond the best hit counts any more.
    fn limit(&mut self, best: &Closest);
    /// True when what begins at `t_entry` may still matter.
    fn may_matter(&self, t_entry: Self::T) -> bool;
}

/// Both boxes of a pair at once, in four lanes: entry into 0, entry into 1, and the negated exits. The proof at [`slabs::Slab`] holds lane by
/// lane; with 2^-126 of slack on the comparison an exact meeting within `[t_near, limit]` is never lost.
#[derive(Clone, Copy)]
struct FastNode<S: Simd> {
    mul: [S::F4; 3],
    add: [S::F4; 3],
    swap: [<S::F4 as Halves>::Swap; 3],
    /// `[t_near, t_near, -limit, -limit]`.
    limits: S::F4,
    t_near: f32,
    /// The limit with slack.
    cull: f32,
}

/// Entries, then negated exits.
#[inline(always)]
fn lanes<S: Simd>(entry: f32, exit: f32) -> S::F4 {
    S::F4::load(&[entry, entry, -exit, -exit])
}

impl<S: Simd> FastNode<S> {
    #[inline(always)]
    fn new(ray: &TravRay, reach: f32, limit: f32) -> Self {
        let (range, (mul, add)) = (ray.range(), slabs::of_pair::<S>(ray, reach));
        let dir = range.dir;
        Self {
            mul,
            add,
            swap: [S::F4::swap(dir.x < 0.0), S::F4::swap(dir.y < 0.0), S::F4::swap(dir.z < 0.0)],
            limits: lanes::<S>(range.t_near, limit),
            t_near: range.t_near,
            cull: limit + SLACK,
        }
    }
}

impl<S: Simd> NodeTest for FastNode<S> {
    type T = f32;

    #[inline(always)]
    fn test(&self, pair: &Pair) -> (u32, [f32; 2]) {
        let mut t = self.limits;
        for axis in 0..3 {
            let planes = S::F4::load(&pair.planes[axis]).swapped(self.swap[axis]);
            t = planes.mul_add_loose(self.mul[axis], self.add[axis]).max(t);
        }
        let hits = (t + t.high_half()).le(S::F4::splat(SLACK)) & 3;
        (hits, [t.first(), t.second()])
    }

    #[inline(always)]
    fn limit(&mut self, best: &Closest) {
        let limit = best.t_cull();
        self.limits = lanes::<S>(self.t_near, limit);
        self.cull = limit + SLACK;
    }

    #[inline(always)]
    fn may_matter(&self, t_entry: f32) -> bool {
        t_entry <= self.cull
    }
}

/// The same test in f64, one box after the other, for every finite ray and box.
///
/// Differences and products of f32 neither overflow nor underflow in f64 here; the relative errors are below 4 * 2^-53,
/// covered by the widening.
#[derive(Clone, Copy)]
struct WideNode {
    origin: [f64; 3],
    inv: [f64; 3],
    t_near: f64,
    limit: f64,
}

/// Relative widening of exits.
const WIDEN: f64 = 1.0 + 16.0 * f64::EPSILON;

impl WideNode {
    fn new(ray: &TravRay, limit: f64) -> Self {
        let range = ray.range();
        let inv = range.dir.to_array().map(|d| 1.0 / f64::from(d));
        Self { origin: range.origin.to_array().map(f64::from), inv, t_near: f64::from(range.t_near), limit }
    }

    fn test_child(&self, pair: &Pair, child: usize) -> (bool, f64) {
        let (mut near, mut far) = (self.t_near, self.limit);
        for axis in 0..3 {
            let plane = |i: usize| (f64::from(pair.planes[axis][i]) - self.origin[axis]) * self.inv[axis];
            let backward = self.inv[axis] < 0.0;
            let (entry, exit) =
                if backward { (plane(child + 2), plane(child)) } else { (plane(child), plane(child + 2)) };
            let (entry, exit) = (entry * (2.0 - WIDEN), exit * WIDEN);
            near = if entry > near { entry } else { near };
            far = if exit < far { exit } else { far };
        }
        (near <= far, near)
    }
}

impl NodeTest for WideNode {
    type T = f64;

    fn test(&self, pair: &Pair) -> (u32, [f64; 2]) {
        let ((hit0, t0), (hit1, t1)) = (self.test_child(pair, 0), self.test_child(pair, 1));
        (u32::from(hit0) | u32::from(hit1) << 1, [t0, t1])
    }

    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_high();
    }

    fn may_matter(&self, t_entry: f64) -> bool {
        t_entry <= self.limit
    }
}

/// The link, in a way that keeps the branch that led here: processors predict the child well, while choosing it by
/// arithmetic would make each step wait for the box test of the one before.
#[inline(always)]
fn predicted(link: Link) -> Link {
    link.map_bits(branch_barrier)
}

impl Bvh2 {
    #[inline(always)]
    pub(super) fn walk_closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        if slabs::fits(ray, self.reach) {
            self.closest_with::<S, _, C, K>(FastNode::<S>::new(ray, self.reach, best.t_cull()), ray, best, sink, count);
        } else {
            self.walk_closest_wide(ray, best, sink, count);
        }
    }

    /// Rare, so compiled once, not for every level.
    #[cold]
    #[inline(never)]
    fn walk_closest_wide<C: Counter, K: HitSink>(&self, ray: &TravRay, best: &mut Closest, sink: &K, count: &mut C) {
        self.closest_with::<Scalar, _, C, K>(WideNode::new(ray, best.t_high()), ray, best, sink, count);
    }

    #[inline(always)]
    pub(super) fn walk_occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        if slabs::fits(ray, self.reach) {
            self.occluded_with::<S, _, C, K>(&FastNode::<S>::new(ray, self.reach, ray.range().t_far), ray, sink, count)
        } else {
            self.walk_occluded_wide(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    fn walk_occluded_wide<C: Counter, K: HitSink>(&self, ray: &TravRay, sink: &K, count: &mut C) -> bool {
        let test = WideNode::new(ray, f64::from(ray.range().t_far));
        self.occluded_with::<Scalar, _, C, K>(&test, ray, sink, count)
    }

    /// Ordered walk: the nearer child first, the farther one on the stack with its entry.
    #[inline(always)]
    fn closest_with<S: Simd, N: NodeTest, C: Counter, K: HitSink>(
        &self,
        mut test: N,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        let block_ray = BlockRay::new(ray, self.reach);
        let mut stack = Stack::<N::T>::new();
        let mut link = Link::inner(0);
        loop {
            if link.is_leaf() {
                for block in self.leaf_blocks(link, count) {
                    block.closest::<S, C, K>(ray, &block_ray, best, sink, count);
                }
                test.limit(best);
            } else {
                count.node();
                count.node();
                let pair = &self.pairs[link.pair()];
                let (hits, entries) = test.test(pair);
                let [first, second] = pair.links;
                if hits == 3 {
                    if entries[0] <= entries[1] {
                        stack.push((second, entries[1]));
                        link = predicted(first);
                    } else {
                        stack.push((first, entries[0]));
                        link = predicted(second);
                    }
                    continue;
                }
                if hits == 1 {
                    link = predicted(first);
                    continue;
                }
                if hits == 2 {
                    link = predicted(second);
                    continue;
                }
            }
            link = loop {
                match stack.pop() {
                    None => return,
                    Some((link, t_entry)) if test.may_matter(t_entry) => break link,
                    Some(_) => {}
                }
            };
        }
    }

    /// Any hit ends the walk; leaves are tested before nodes are followed.
    #[inline(always)]
    fn occluded_with<S: Simd, N: NodeTest, C: Counter, K: HitSink>(
        &self,
        test: &N,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        let block_ray = BlockRay::new(ray, self.reach);
        let mut stack = Stack::<()>::new();
        let mut link = Link::inner(0);
        loop {
            if link.is_leaf() {
                for block in self.leaf_blocks(link, count) {
                    if block.occluded::<S, C, K>(ray, &block_ray, sink, count) {
                        return true;
                    }
                }
            } else {
                count.node();
                count.node();
                let pair = &self.pairs[link.pair()];
                let (hits, entries) = test.test(pair);
                let [first, second] = pair.links;
                if hits == 3 {
                    if entries[0] <= entries[1] {
                        stack.push((second, ()));
                        link = predicted(first);
                    } else {
                        stack.push((first, ()));
                        link = predicted(second);
                    }
                    continue;
                }
                if hits == 1 {
                    link = predicted(first);
                    continue;
                }
                if hits == 2 {
                    link = predicted(second);
                    continue;
                }
            }
            match stack.pop() {
                Some((next, ())) => link = next,
                None => return false,
            }
        }
    }
}
