use arrayvec::ArrayVec;

use super::{
    Ssh,
    node::{Node, Side, Word},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::{BlockRay, TriBlock},
        query::{GROW, ORDINARY_MAX, SHRINK},
        topology::MAX_DEPTH,
    },
    geom::Aabb,
    simd::{Lanes, Simd, branch_barrier},
};

/// Absolute slack of the f32 node test: above every underflow it may meet.
pub(super) const SLACK: f32 = f32::MIN_POSITIVE;

/// A node to visit and the part of the ray inside it. At most one a level, and the builder bounds the depth.
type Stack<T> = ArrayVec<(Word, [T; 2]), MAX_DEPTH>;

/// A way to cut a ray's segment with a plane: in f32 for ordinary rays, in f64 for all.
pub(super) trait SlabTest: Copy {
    type T: Copy;

    /// The part of the segment that may lie inside of the plane.
    fn cut(&self, plane: f32, side: Side, segment: [Self::T; 2]) -> [Self::T; 2];
    /// False when a segment is surely empty.
    fn is_open(segment: [Self::T; 2]) -> bool;
    /// The ray's range.
    fn range(&self) -> [Self::T; 2];
    /// Nothing beyond the best hit counts any more.
    fn limit(&mut self, best: &Closest);
    /// The segment up to the limit.
    fn limited(&self, segment: [Self::T; 2]) -> [Self::T; 2];
    /// False when the ray surely misses the boxes of all triangles of a block, or of one lane, within the segment.
    fn may_meet<S: Simd>(&self, block: &TriBlock, lanes: u32, segment: [Self::T; 2]) -> bool;
    /// True when the ray runs downward along an axis.
    fn is_backward(&self, axis: usize) -> bool;

    #[inline(always)]
    fn cut_by(&self, node: &Node, segment: [Self::T; 2]) -> [Self::T; 2] {
        self.cut(node.plane, node.word.side(), segment)
    }

    /// The range within the root's box.
    #[inline(always)]
    fn clipped(&self, bounds: &Aabb) -> [Self::T; 2] {
        let mut segment = self.range();
        for side in Side::ALL {
            segment = self.cut(side.of(bounds), side, segment);
        }
        segment
    }
}

/// What an axis and side make of a plane.
#[derive(Clone, Copy, Debug)]
struct Row<T> {
    origin: T,
    /// Factor for an entry; NaN when the ray leaves through this side.
    entry: T,
    /// Factor for an exit; NaN when the ray enters through this side.
    exit: T,
}

/// One plane at a time. A product with NaN loses in the minimum and maximum, so each plane moves one end of the segment without a branch.
///
/// # Proof that no half-space is missed
/// Take an ordinary ray ([`TravRay::is_ordinary`]) and a plane within 2^60 of 0. A ray enters a half-space through its plane when it runs
/// upward and the plane is a lower one, or downward and the plane is an upper one. For `d != 0` the row gives `a = fl(fl(p - o) * fl(inv * SHRINK))`
/// for an entry and `b = fl(fl(p - o) * fl(inv * GROW))` for an exit; by the bounds of [`SHRINK`] and [`GROW`], `a` is at most the exact t where that
/// is not negative, and negative or 0 elsewhere, where `t_near >= 0` takes its place; `b` is at least the exact t where that is not negative, and a
/// negative exit misses in truth. Only the products may underflow, by less than 2^-149: so with 2^-126 of slack on the
/// comparison a segment that holds a common point of the half-spaces is never found empty. With `d = 0` (always +0, so
/// never backward) the reciprocal is +inf: a plane on the wrong side gives +inf as an entry or -inf as an exit and the half-space is missed, as it
/// is in truth; on the right side -inf or +inf, and the origin on the plane 0 * inf = NaN: all lose. The infinite planes of leaves without planes
/// (+inf, upper) never cut and those of empty subtrees (-inf, upper) always do.
#[derive(Clone, Copy)]
struct FastSlabs {
    rows: [Row<f32>; Side::ROWS],
    near: f32,
    limit: f32,
    backward: [bool; 3],
}

impl FastSlabs {
    #[inline(always)]
    fn new(ray: &TravRay, limit: f32) -> Self {
        let range = ray.range();
        let mut out = Self {
            rows: [Row { origin: 0.0, entry: f32::NAN, exit: f32::NAN }; Side::ROWS],
            near: range.t_near,
            limit,
            backward: range.dir.to_array().map(|d| d < 0.0),
        };
        for side in Side::ALL {
            let (axis, inv) = (side.axis(), ray.inv()[side.axis()]);
            let enters = side.is_upper() == out.backward[axis];
            out.rows[side.row()] = Row {
                origin: range.origin[axis],
                entry: if enters { inv * SHRINK } else { f32::NAN },
                exit: if enters { f32::NAN } else { inv * GROW },
            };
        }
        out
    }
}

impl SlabTest for FastSlabs {
    type T = f32;

    #[inline(always)]
    fn cut(&self, plane: f32, side: Side, [near, far]: [f32; 2]) -> [f32; 2] {
        let row = &self.rows[side.row()];
        let distance = plane - row.origin;
        let (entry, exit) = (distance * row.entry, distance * row.exit);
        [if entry > near { entry } else { near }, if exit < far { exit } else { far }]
    }

    #[inline(always)]
    fn is_open([near, far]: [f32; 2]) -> bool {
        near <= far + SLACK
    }

    #[inline(always)]
    fn range(&self) -> [f32; 2] {
        [self.near, self.limit]
    }

    #[inline(always)]
    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_cull();
    }

    #[inline(always)]
    fn limited(&self, [near, far]: [f32; 2]) -> [f32; 2] {
        [near, if self.limit < far { self.limit } else { far }]
    }

    /// The triangles' boxes cost a third of the exact test, and nodes of one plane lead to leaves that most rays miss.
    #[inline(always)]
    fn may_meet<S: Simd>(&self, block: &TriBlock, lanes: u32, [near, far]: [f32; 2]) -> bool {
        let (mut near, mut far) = (S::F4::splat(near), S::F4::splat(far));
        let planes = block.boxes::<S>();
        for axis in 0..3 {
            let backward = self.backward[axis];
            let (entry, exit) = (&self.rows[axis + 4 * usize::from(backward)], &self.rows[axis + 4 * usize::from(!backward)]);
            let [low, high] = planes[axis];
            let (first, second) = if backward { (high, low) } else { (low, high) };
            let origin = S::F4::splat(entry.origin);
            near = ((first - origin) * S::F4::splat(entry.entry)).max(near);
            far = ((second - origin) * S::F4::splat(exit.exit)).min(far);
        }
        (near - far).le(S::F4::splat(SLACK)) & lanes != 0
    }

    #[inline(always)]
    fn is_backward(&self, axis: usize) -> bool {
        self.backward[axis]
    }
}

/// The same in f64, for every finite ray and plane.
///
/// Differences and products of f32 neither overflow nor underflow in f64 here; the relative errors are below 4 * 2^-53,
/// covered by the widening.
#[derive(Clone, Copy)]
struct WideSlabs {
    origin: [f64; 3],
    inv: [f64; 3],
    near: f64,
    limit: f64,
}

/// Relative widening of exits.
const WIDEN: f64 = 1.0 + 16.0 * f64::EPSILON;

impl WideSlabs {
    fn new(ray: &TravRay, limit: f64) -> Self {
        let range = ray.range();
        let inv = range.dir.to_array().map(|d| 1.0 / f64::from(d));
        Self { origin: range.origin.to_array().map(f64::from), inv, near: f64::from(range.t_near), limit }
    }
}

impl SlabTest for WideSlabs {
    type T = f64;

    fn cut(&self, plane: f32, side: Side, [near, far]: [f64; 2]) -> [f64; 2] {
        let axis = side.axis();
        let t = (f64::from(plane) - self.origin[axis]) * self.inv[axis];
        if side.is_upper() == self.is_backward(axis) {
            let entry = t * (2.0 - WIDEN);
            [if entry > near { entry } else { near }, far]
        } else {
            let exit = t * WIDEN;
            [near, if exit < far { exit } else { far }]
        }
    }

    fn is_open([near, far]: [f64; 2]) -> bool {
        near <= far
    }

    fn range(&self) -> [f64; 2] {
        [self.near, self.limit]
    }

    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_high();
    }

    fn limited(&self, [near, far]: [f64; 2]) -> [f64; 2] {
        [near, far.min(self.limit)]
    }

    fn may_meet<S: Simd>(&self, _block: &TriBlock, _lanes: u32, _segment: [f64; 2]) -> bool {
        true
    }

    fn is_backward(&self, axis: usize) -> bool {
        self.inv[axis] < 0.0
    }
}

/// The word, in a way that keeps the branch that led here: processors predict the child well, while choosing it by
/// arithmetic would make each step wait for the plane test of the one before.
#[inline(always)]
fn predicted(word: Word) -> Word {
    word.map_bits(branch_barrier)
}

impl Ssh {
    /// True when f32 node tests are proven for this ray and these planes.
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
            self.closest_with::<S, _, C, K>(FastSlabs::new(ray, best.t_cull()), ray, best, sink, count);
        } else {
            self.walk_closest_wide::<S, C, K>(ray, best, sink, count);
        }
    }

    #[cold]
    #[inline(never)]
    fn walk_closest_wide<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        self.closest_with::<S, _, C, K>(WideSlabs::new(ray, best.t_high()), ray, best, sink, count);
    }

    #[inline(always)]
    pub(super) fn walk_occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        if self.is_ordinary(ray) {
            self.occluded_with::<S, _, C, K>(&FastSlabs::new(ray, ray.range().t_far), ray, sink, count)
        } else {
            self.walk_occluded_wide::<S, C, K>(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    fn walk_occluded_wide<S: Simd, C: Counter, K: HitSink>(&self, ray: &TravRay, sink: &K, count: &mut C) -> bool {
        let test = WideSlabs::new(ray, f64::from(ray.range().t_far));
        self.occluded_with::<S, _, C, K>(&test, ray, sink, count)
    }

    /// Ordered walk: the child that comes first along the order axis first, the other on the stack with its segment.
    #[inline(always)]
    fn closest_with<S: Simd, N: SlabTest, C: Counter, K: HitSink>(
        &self,
        mut test: N,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        let mut segment = test.clipped(&self.bounds);
        if !N::is_open(segment) {
            return;
        }
        let block_ray = BlockRay::new(ray);
        let mut stack = Stack::<N::T>::new();
        let mut word = self.root;
        loop {
            if word.is_leaf() {
                let (blocks, lanes) = self.leaf_blocks(word, count);
                for block in blocks {
                    if !test.may_meet::<S>(block, lanes, segment) {
                        continue;
                    }
                    block.closest::<S, C, K>(ray, &block_ray, best, sink, count);
                }
                test.limit(best);
            } else if let Some(next) = self.descend(&test, &mut stack, word, segment, count) {
                (word, segment) = next;
                continue;
            }
            (word, segment) = loop {
                let Some((word, segment)) = stack.pop() else { return };
                let segment = test.limited(segment);
                if N::is_open(segment) {
                    break (word, segment);
                }
            };
        }
    }

    /// Any hit ends the walk.
    #[inline(always)]
    fn occluded_with<S: Simd, N: SlabTest, C: Counter, K: HitSink>(
        &self,
        test: &N,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        let mut segment = test.clipped(&self.bounds);
        if !N::is_open(segment) {
            return false;
        }
        let block_ray = BlockRay::new(ray);
        let mut stack = Stack::<N::T>::new();
        let mut word = self.root;
        loop {
            if word.is_leaf() {
                let (blocks, lanes) = self.leaf_blocks(word, count);
                for block in blocks {
                    if test.may_meet::<S>(block, lanes, segment)
                        && block.occluded::<S, C, K>(ray, &block_ray, sink, count)
                    {
                        return true;
                    }
                }
            } else if let Some(next) = self.descend(test, &mut stack, word, segment, count) {
                (word, segment) = next;
                continue;
            }
            match stack.pop() {
                Some(next) => (word, segment) = next,
                None => return false,
            }
        }
    }

    /// Cuts the segment with both children of an inner node: the one to visit next, if any; the other goes to the stack.
    #[inline(always)]
    fn descend<N: SlabTest, C: Counter>(
        &self,
        test: &N,
        stack: &mut Stack<N::T>,
        word: Word,
        segment: [N::T; 2],
        count: &mut C,
    ) -> Option<(Word, [N::T; 2])> {
        count.node();
        count.node();
        let nodes = &self.pairs[word.index()].0;
        let [first, second] = [0, 1].map(|i| (nodes[i].word, test.cut_by(&nodes[i], segment)));
        match (N::is_open(first.1), N::is_open(second.1)) {
            (true, true) if test.is_backward(word.order()) => {
                stack.push(first);
                Some((predicted(second.0), second.1))
            }
            (true, true) => {
                stack.push(second);
                Some((predicted(first.0), first.1))
            }
            (true, false) => Some((predicted(first.0), first.1)),
            (false, true) => Some((predicted(second.0), second.1)),
            (false, false) => None,
        }
    }
}
