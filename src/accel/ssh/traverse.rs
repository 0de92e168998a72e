use arrayvec::ArrayVec;

use super::{
    narrow::Narrow,
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
    simd::{Lanes, Scalar, Simd, branch_barrier},
};

/// Absolute slack of the f32 node test: above every underflow it may meet.
pub(super) const SLACK: f32 = f32::MIN_POSITIVE;

/// The part of a ray inside a node, from `near` to `far`. Two fields, not an array: those are kept in registers.
#[derive(Clone, Copy)]
pub(super) struct Segment<T> {
    near: T,
    far: T,
}

/// A node to visit and the part of the ray inside it. At most one a level, and the builder bounds the depth.
type Stack<T> = ArrayVec<(Word, Segment<T>), MAX_DEPTH>;

/// A way to cut a ray's segment with a plane: in f32 for ordinary rays, in f64 for all.
pub(super) trait SlabTest: Copy {
    type T: Copy;

    /// The part of the segment that may lie inside of the plane.
    fn cut(&self, plane: f32, side: Side, segment: Segment<Self::T>) -> Segment<Self::T>;
    /// False when a segment is surely empty.
    fn is_open(segment: Segment<Self::T>) -> bool;
    /// The ray's range.
    fn range(&self) -> Segment<Self::T>;
    /// Nothing beyond the best hit counts any more.
    fn limit(&mut self, best: &Closest);
    /// The segment up to the limit.
    fn limited(&self, segment: Segment<Self::T>) -> Segment<Self::T>;
    /// False when the ray surely misses the boxes of all triangles of a block, or of one lane, within the segment.
    fn may_meet<S: Simd>(&self, block: &TriBlock, lane: Option<usize>, segment: Segment<Self::T>) -> bool;
    /// True when the ray runs downward along an axis.
    fn is_backward(&self, axis: usize) -> bool;

    #[inline(always)]
    fn cut_by(&self, node: Node, segment: Segment<Self::T>) -> Segment<Self::T> {
        self.cut(node.plane, node.word.side(), segment)
    }

    /// The range within the root's box.
    #[inline(always)]
    fn clipped(&self, bounds: &Aabb) -> Segment<Self::T> {
        let mut segment = self.range();
        for side in Side::ALL {
            segment = self.cut(side.of(bounds), side, segment);
        }
        segment
    }
}

/// What an axis and side make of a plane.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug)]
struct Row {
    origin: f32,
    /// Factor for an entry; NaN when the ray leaves through this side.
    entry: f32,
    /// Factor for an exit; NaN when the ray enters through this side.
    exit: f32,
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
    rows: [Row; Side::ROWS],
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
    fn cut(&self, plane: f32, side: Side, Segment { near, far }: Segment<f32>) -> Segment<f32> {
        let row = &self.rows[side.row()];
        let distance = plane - row.origin;
        let (entry, exit) = (distance * row.entry, distance * row.exit);
        Segment { near: if entry > near { entry } else { near }, far: if exit < far { exit } else { far } }
    }

    #[inline(always)]
    fn is_open(Segment { near, far }: Segment<f32>) -> bool {
        near <= far + SLACK
    }

    #[inline(always)]
    fn range(&self) -> Segment<f32> {
        Segment { near: self.near, far: self.limit }
    }

    #[inline(always)]
    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_cull();
    }

    #[inline(always)]
    fn limited(&self, Segment { near, far }: Segment<f32>) -> Segment<f32> {
        Segment { near, far: if self.limit < far { self.limit } else { far } }
    }

    /// The triangles' boxes cost a third of the exact test, and nodes of one plane lead to leaves that most rays miss.
    #[inline(always)]
    fn may_meet<S: Simd>(&self, block: &TriBlock, lane: Option<usize>, Segment { near, far }: Segment<f32>) -> bool {
        let (mut near, mut far) = (S::F4::splat(near), S::F4::splat(far));
        for (axis, [low, high]) in block.boxes::<S>().into_iter().enumerate() {
            let backward = self.backward[axis];
            let (entry, exit) =
                (&self.rows[axis + 4 * usize::from(backward)], &self.rows[axis + 4 * usize::from(!backward)]);
            let (first, second) = if backward { (high, low) } else { (low, high) };
            let origin = S::F4::splat(entry.origin);
            near = ((first - origin) * S::F4::splat(entry.entry)).max(near);
            far = ((second - origin) * S::F4::splat(exit.exit)).min(far);
        }
        (near - far).le(S::F4::splat(SLACK)) & lane.map_or(15, |lane| 1 << lane) != 0
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

    fn cut(&self, plane: f32, side: Side, Segment { near, far }: Segment<f64>) -> Segment<f64> {
        let axis = side.axis();
        let t = (f64::from(plane) - self.origin[axis]) * self.inv[axis];
        if side.is_upper() == self.is_backward(axis) {
            let entry = t * (2.0 - WIDEN);
            Segment { near: if entry > near { entry } else { near }, far }
        } else {
            let exit = t * WIDEN;
            Segment { near, far: if exit < far { exit } else { far } }
        }
    }

    fn is_open(Segment { near, far }: Segment<f64>) -> bool {
        near <= far
    }

    fn range(&self) -> Segment<f64> {
        Segment { near: self.near, far: self.limit }
    }

    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_high();
    }

    fn limited(&self, Segment { near, far }: Segment<f64>) -> Segment<f64> {
        Segment { near, far: far.min(self.limit) }
    }

    fn may_meet<S: Simd>(&self, _block: &TriBlock, _lane: Option<usize>, _segment: Segment<f64>) -> bool {
        true
    }

    fn is_backward(&self, axis: usize) -> bool {
        self.inv[axis] < 0.0
    }
}

/// The word, in a way that keeps the branch that led here: processors predict the child well, while choosing it by
/// arithmetic would make each step wait for the plane test of the one before.
#[inline(always)]
pub(super) fn predicted(word: Word) -> Word {
    word.map_bits(branch_barrier)
}

impl Narrow {
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
            self.walk_closest_wide(ray, best, sink, count);
        }
    }

    /// Rare, so compiled once, not for every level.
    #[cold]
    #[inline(never)]
    fn walk_closest_wide<C: Counter, K: HitSink>(&self, ray: &TravRay, best: &mut Closest, sink: &K, count: &mut C) {
        self.closest_with::<Scalar, _, C, K>(WideSlabs::new(ray, best.t_high()), ray, best, sink, count);
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
            self.walk_occluded_wide(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    fn walk_occluded_wide<C: Counter, K: HitSink>(&self, ray: &TravRay, sink: &K, count: &mut C) -> bool {
        let test = WideSlabs::new(ray, f64::from(ray.range().t_far));
        self.occluded_with::<Scalar, _, C, K>(&test, ray, sink, count)
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
        let block_ray = BlockRay::new(ray, self.reach);
        let mut stack = Stack::<N::T>::new();
        let mut word = self.root;
        loop {
            if word.is_leaf() {
                let (blocks, lane) = self.leaf_blocks(word, count);
                for block in blocks {
                    if !test.may_meet::<S>(block, lane, segment) {
                        continue;
                    }
                    block.closest::<S, C, K>(ray, &block_ray, best, sink, count);
                }
                test.limit(best);
            } else {
                count.node();
                count.node();
                let pair = &self.pairs[word.index()].0;
                if let Some(next) = descend(&test, &mut stack, pair, word.order(), segment) {
                    (word, segment) = next;
                    continue;
                }
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
        let block_ray = BlockRay::new(ray, self.reach);
        let mut stack = Stack::<N::T>::new();
        let mut word = self.root;
        loop {
            if word.is_leaf() {
                let (blocks, lane) = self.leaf_blocks(word, count);
                for block in blocks {
                    if test.may_meet::<S>(block, lane, segment)
                        && block.occluded::<S, C, K>(ray, &block_ray, sink, count)
                    {
                        return true;
                    }
                }
            } else {
                count.node();
                count.node();
                let pair = &self.pairs[word.index()].0;
                if let Some(next) = descend(test, &mut stack, pair, word.order(), segment) {
                    (word, segment) = next;
                    continue;
                }
            }
            match stack.pop() {
                Some(next) => (word, segment) = next,
                None => return false,
            }
        }
    }
}

/// Cuts a ray by two siblings; the one that comes first along the order axis is next, the other goes to the stack.
#[inline(always)]
fn descend<N: SlabTest>(
    test: &N,
    stack: &mut Stack<N::T>,
    nodes: &[Node; 2],
    order: usize,
    segment: Segment<N::T>,
) -> Option<(Word, Segment<N::T>)> {
    let nearer = usize::from(test.is_backward(order));
    let (first, second) = (nodes[nearer], nodes[1 - nearer]);
    let (segment1, segment2) = (test.cut_by(first, segment), test.cut_by(second, segment));
    let (open1, open2) = (N::is_open(segment1), N::is_open(segment2));
    if open1 {
        if open2 {
            stack.push((second.word, segment2));
        }
        return Some((predicted(first.word), segment1));
    }
    if open2 { Some((predicted(second.word), segment2)) } else { None }
}

/// What is left of a ray's range after one plane, by both kernels; `None` when nothing is.
#[cfg(test)]
pub(super) fn cut_once(ray: &TravRay, plane: f32, side: Side) -> [Option<[f64; 2]>; 2] {
    let far = ray.range().t_far;
    let (fast, wide) = (FastSlabs::new(ray, far), WideSlabs::new(ray, f64::from(far)));
    let fast = fast.cut(plane, side, fast.range());
    let wide = wide.cut(plane, side, wide.range());
    [
        FastSlabs::is_open(fast).then(|| [fast.near.into(), fast.far.into()]),
        WideSlabs::is_open(wide).then_some([wide.near, wide.far]),
    ]
}
