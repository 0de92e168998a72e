//! Eight children against one ray.

use super::{
    Wide,
    node::{FOURTH, Node, UPPER, Word},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        query::{ORDINARY_MAX, SLACK},
        ssh::node::Side,
        wide::{
            WIDTH, WideNode,
            walk::{self, Kernel},
        },
    },
    geom::Aabb,
    simd::{Lanes, Scalar, Simd, Task},
};

/// The part of a ray inside a child.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment<T> {
    pub(super) near: T,
    pub(super) far: T,
}

/// Segments of all children.
pub(super) struct Segments<T> {
    pub(super) near: [T; WIDTH],
    pub(super) far: [T; WIDTH],
}

/// Relative slack between entries and exits: 8 * 2^-24.
pub(super) const GROW: f32 = 1.0 + 8.0 / 16_777_216.0;

/// What is needed of one end of a segment: `(plane - origin) * inv`, by axis and by [`Side::row`].
#[derive(Clone, Copy)]
pub(super) struct End<S: Simd> {
    pub(super) origin: [S::F8; 3],
    pub(super) inv: [S::F8; 3],
    /// For the fourth planes; the factor is NaN where a plane of that side moves the other end.
    pub(super) row_origin: S::F8,
    pub(super) row_inv: S::F8,
}

impl<S: Simd> End<S> {
    /// `exits` tells which end it is.
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], inv: [f32; 3], backward: [bool; 3], exits: bool) -> Self {
        let mut rows = [[0.0; Side::ROWS], [f32::NAN; Side::ROWS]];
        for axis in 0..3 {
            rows[0][axis] = origin[axis];
            rows[0][axis + 4] = origin[axis];
            // A ray enters through a lower plane when it runs upward, and leaves through the upper one.
            rows[1][axis + 4 * usize::from(backward[axis] != exits)] = inv[axis];
        }
        Self {
            origin: [S::F8::splat(origin[0]), S::F8::splat(origin[1]), S::F8::splat(origin[2])],
            inv: [S::F8::splat(inv[0]), S::F8::splat(inv[1]), S::F8::splat(inv[2])],
            row_origin: S::F8::load(&rows[0]),
            row_inv: S::F8::load(&rows[1]),
        }
    }

    #[inline(always)]
    fn at(&self, planes: S::F8, axis: usize) -> S::F8 {
        (planes - self.origin[axis]) * self.inv[axis]
    }

    #[inline(always)]
    fn at_row(&self, planes: S::F8, words: S::U8) -> S::F8 {
        (planes - S::picked::<FOURTH>(self.row_origin, words)) * S::picked::<FOURTH>(self.row_inv, words)
    }
}

/// Inverts the bits of [`UPPER`] planes where the ray runs upward: they then mark entries.
#[inline(always)]
pub(super) fn flips(backward: [bool; 3]) -> u32 {
    let [x, y, z] = [u32::from(!backward[0]), u32::from(!backward[1]), u32::from(!backward[2])];
    (x | y << 1 | z << 2) << UPPER
}

/// Segments of the children, from that of their node, and which of them are not surely empty. The two ends may belong to different
/// rays, the first and the last to pass each plane.
#[inline(always)]
pub(super) fn cut_all<S: Simd, const K: usize>(
    node: &Node<K>,
    entry: &End<S>,
    exit: &End<S>,
    flips: u32,
    segment: Segment<f32>,
    kids: &mut Segments<f32>,
) -> u32 {
    let raw = S::words(node.raw_words());
    let words = S::flipped(raw, flips);
    let (mut near, mut far) = (S::F8::splat(segment.near), S::F8::splat(segment.far));
    // One bit an axis, so the loop is written out.
    let planes = S::F8::load(&node.planes[0]);
    let enters = S::with_bit::<3>(words);
    near = S::max_where(enters, entry.at(planes, 0), near);
    far = S::min_unless(enters, exit.at(planes, 0), far);
    let planes = S::F8::load(&node.planes[1]);
    let enters = S::with_bit::<2>(words);
    near = S::max_where(enters, entry.at(planes, 1), near);
    far = S::min_unless(enters, exit.at(planes, 1), far);
    let planes = S::F8::load(&node.planes[2]);
    let enters = S::with_bit::<1>(words);
    near = S::max_where(enters, entry.at(planes, 2), near);
    far = S::min_unless(enters, exit.at(planes, 2), far);
    if K > 3 {
        let planes = S::F8::load(&node.planes[K - 1]);
        near = entry.at_row(planes, raw).max(near);
        far = exit.at_row(planes, raw).min(far);
    }
    near.store(&mut kids.near);
    far.store(&mut kids.far);
    near.le(far.mul_add_loose(S::F8::splat(GROW), S::F8::splat(SLACK)))
}

const _: () = assert!(UPPER == 28);

/// All planes of eight children at once, in f32.
///
/// # Proof that no half-space is missed
/// Take an ordinary ray ([`TravRay::is_ordinary`]) and planes within 2^60 of 0. For `d != 0` a plane gives
/// `t = fl(fl(p - o) * fl(1 / d))`, with three roundings within 3.01 u (u = 2^-24) of the exact t, but for an underflow of less than
/// 2^-149; nothing overflows (2^61 * 2^60). Where the exact entry is negative, so is the computed one or it is 0, and the segment's near end, which is not negative, takes its
/// place; a negative exit misses in truth. Ends that meet in truth thus satisfy `near <= far (1 + 8 u) + 2^-126`, also where one of them was inherited:
/// it was computed in the same way. With `d = 0` (always +0, so never backward) the factor is +inf: a plane on the wrong side gives +inf as an entry or -inf
/// as an exit and the half-space is missed, as it is in truth; on the right side -inf or +inf, and the origin on the plane 0 * inf = NaN: all lose, since
/// the running value is the second operand.
#[derive(Clone, Copy)]
struct FastKernel<S: Simd> {
    /// These differ in the factors of the fourth planes alone.
    entry: End<S>,
    exit: End<S>,
    origin: [f32; 3],
    inv: [f32; 3],
    backward: [bool; 3],
    flips: u32,
    limit: f32,
    /// The limit with slack.
    cull: f32,
}

#[inline(always)]
pub(super) fn padded(limit: f32) -> f32 {
    limit * GROW + SLACK
}

impl<S: Simd> FastKernel<S> {
    #[inline(always)]
    fn new(ray: &TravRay, limit: f32) -> Self {
        let range = ray.range();
        let (origin, inv) = (range.origin.to_array(), ray.inv().to_array());
        let backward = [range.dir.x < 0.0, range.dir.y < 0.0, range.dir.z < 0.0];
        let (entry, exit) = (End::new(origin, inv, backward, false), End::new(origin, inv, backward, true));
        Self { entry, exit, origin, inv, backward, flips: flips(backward), limit, cull: padded(limit) }
    }

    /// The ray's range within the root's box.
    #[inline(always)]
    fn clipped(&self, near: f32, bounds: &Aabb) -> Segment<f32> {
        let (mut near, mut far) = (near, self.limit);
        for axis in 0..3 {
            let (first, last) = if self.backward[axis] { (bounds.max, bounds.min) } else { (bounds.min, bounds.max) };
            let entry = (first[axis] - self.origin[axis]) * self.inv[axis];
            let exit = (last[axis] - self.origin[axis]) * self.inv[axis];
            near = if entry > near { entry } else { near };
            far = if exit < far { exit } else { far };
        }
        Segment { near, far }
    }
}

impl<S: Simd, const K: usize> Kernel<Wide<K>> for FastKernel<S> {
    type Mark = Segment<f32>;
    type Kids = Segments<f32>;

    #[inline(always)]
    fn kids() -> Segments<f32> {
        Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] }
    }

    #[inline(always)]
    fn test(&self, node: &Node<K>, mark: Segment<f32>, kids: &mut Segments<f32>) -> u32 {
        cut_all(node, &self.entry, &self.exit, self.flips, mark, kids)
    }

    #[inline(always)]
    fn mark(kids: &Segments<f32>, slot: usize) -> Segment<f32> {
        Segment { near: kids.near[slot], far: kids.far[slot] }
    }

    #[inline(always)]
    fn key(kids: &Segments<f32>, slot: usize) -> u64 {
        walk::key32(kids.near[slot], slot)
    }

    #[inline(always)]
    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_cull();
        self.cull = padded(self.limit);
    }

    #[inline(always)]
    fn reopened(&self, Segment { near, far }: Segment<f32>) -> Option<Segment<f32>> {
        (near <= self.cull).then_some(Segment { near, far: if self.limit < far { self.limit } else { far } })
    }

    /// Planes that are inherited lead to leaves that the ray misses, and the triangles' boxes cost a third of the exact test.
    #[inline(always)]
    fn may_meet<T: Simd>(&self, block: &TriBlock, Segment { near, far }: Segment<f32>) -> bool {
        let (mut near, mut far) = (T::F4::splat(near), T::F4::splat(far));
        for (axis, [low, high]) in block.boxes::<T>().into_iter().enumerate() {
            let (first, last) = if self.backward[axis] { (high, low) } else { (low, high) };
            let (origin, inv) = (T::F4::splat(self.origin[axis]), T::F4::splat(self.inv[axis]));
            near = ((first - origin) * inv).max(near);
            far = ((last - origin) * inv).min(far);
        }
        near.le(far.mul_add_loose(T::F4::splat(GROW), T::F4::splat(SLACK))) != 0
    }
}

/// The same in f64, one child after the other, for every finite ray and plane.
///
/// Differences and products of f32 neither overflow nor underflow in f64 here; the relative errors are below 4 * 2^-53,
/// covered by the widening.
#[derive(Clone, Copy)]
struct WideKernel {
    origin: [f64; 3],
    inv: [f64; 3],
    near: f64,
    limit: f64,
}

/// Relative widening of exits.
const WIDEN: f64 = 1.0 + 16.0 * f64::EPSILON;

impl WideKernel {
    fn new(ray: &TravRay, limit: f64) -> Self {
        let range = ray.range();
        let inv = range.dir.to_array().map(|d| 1.0 / f64::from(d));
        Self { origin: range.origin.to_array().map(f64::from), inv, near: f64::from(range.t_near), limit }
    }

    fn cut(&self, plane: f32, side: Side, Segment { near, far }: Segment<f64>) -> Segment<f64> {
        let axis = side.axis();
        let t = (f64::from(plane) - self.origin[axis]) * self.inv[axis];
        if side.is_upper() == (self.inv[axis] < 0.0) {
            let entry = t * (2.0 - WIDEN);
            Segment { near: if entry > near { entry } else { near }, far }
        } else {
            let exit = t * WIDEN;
            Segment { near, far: if exit < far { exit } else { far } }
        }
    }

    fn clipped(&self, bounds: &Aabb) -> Segment<f64> {
        let mut segment = Segment { near: self.near, far: self.limit };
        for side in Side::ALL {
            segment = self.cut(side.of(bounds), side, segment);
        }
        segment
    }
}

impl<const K: usize> Kernel<Wide<K>> for WideKernel {
    type Mark = Segment<f64>;
    type Kids = Segments<f64>;

    fn kids() -> Segments<f64> {
        Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] }
    }

    fn test(&self, node: &Node<K>, mark: Segment<f64>, kids: &mut Segments<f64>) -> u32 {
        let mut hits = 0;
        for slot in 0..WIDTH {
            let (word, mut segment) = (node.word(slot), mark);
            for (row, planes) in node.planes.iter().enumerate() {
                segment = self.cut(planes[slot], word.side(row), segment);
            }
            (kids.near[slot], kids.far[slot]) = (segment.near, segment.far);
            hits |= u32::from(segment.near <= segment.far) << slot;
        }
        hits
    }

    fn mark(kids: &Segments<f64>, slot: usize) -> Segment<f64> {
        Segment { near: kids.near[slot], far: kids.far[slot] }
    }

    fn key(kids: &Segments<f64>, slot: usize) -> u64 {
        walk::key64(kids.near[slot], slot)
    }

    fn limit(&mut self, best: &Closest) {
        self.limit = best.t_high();
    }

    fn reopened(&self, Segment { near, far }: Segment<f64>) -> Option<Segment<f64>> {
        (near <= self.limit).then_some(Segment { near, far: far.min(self.limit) })
    }

    fn may_meet<S: Simd>(&self, _block: &TriBlock, _mark: Segment<f64>) -> bool {
        true
    }
}

/// A node or leaf, and the part of the ray inside it.
pub(super) type Start = (Word, Segment<f32>);

/// The closest hit of one ray below a start, or of the whole tree.
pub(super) struct ClosestFrom<'a, const K: usize, C, H> {
    pub(super) tree: &'a Wide<K>,
    pub(super) start: Option<Start>,
    pub(super) ray: &'a TravRay,
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a H,
    pub(super) count: &'a mut C,
}

impl<const K: usize, C: Counter, H: HitSink> Task for ClosestFrom<'_, K, C, H> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, start, ray, best, sink, count } = self;
        let test = FastKernel::<S>::new(ray, best.t_cull());
        let start = start.unwrap_or_else(|| (Wide::<K>::root(), test.clipped(ray.range().t_near, &tree.bounds)));
        if start.1.near <= padded(start.1.far) {
            walk::closest::<S, _, _, C, H>(tree, test, start, ray, best, sink, count);
        }
    }
}

/// As [`ClosestFrom`]: whether anything is hit.
pub(super) struct OccludedFrom<'a, const K: usize, C, H> {
    pub(super) tree: &'a Wide<K>,
    pub(super) start: Option<Start>,
    pub(super) ray: &'a TravRay,
    pub(super) sink: &'a H,
    pub(super) count: &'a mut C,
}

impl<const K: usize, C: Counter, H: HitSink> Task for OccludedFrom<'_, K, C, H> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { tree, start, ray, sink, count } = self;
        let test = FastKernel::<S>::new(ray, ray.range().t_far);
        let start = start.unwrap_or_else(|| (Wide::<K>::root(), test.clipped(ray.range().t_near, &tree.bounds)));
        start.1.near <= padded(start.1.far) && walk::occluded::<S, _, _, C, H>(tree, &test, start, ray, sink, count)
    }
}

impl<const K: usize> Wide<K> {
    pub(super) fn root() -> Word {
        Word::inner(0)
    }

    /// True when f32 node tests are proven for this ray and these planes.
    #[inline(always)]
    pub(super) fn is_ordinary(&self, ray: &TravRay) -> bool {
        ray.is_ordinary() && self.reach <= ORDINARY_MAX
    }

    #[inline(always)]
    pub(super) fn walk_closest<S: Simd, C: Counter, H: HitSink>(
        &self,
        ray: &TravRay,
        best: &mut Closest,
        sink: &H,
        count: &mut C,
    ) {
        if self.is_ordinary(ray) {
            // Called, so that packets which fall apart share the code.
            S::call(ClosestFrom { tree: self, start: None, ray, best, sink, count });
        } else {
            self.closest_wide(ray, best, sink, count);
        }
    }

    /// Rare, so compiled once, not for every level.
    #[cold]
    #[inline(never)]
    fn closest_wide<C: Counter, H: HitSink>(&self, ray: &TravRay, best: &mut Closest, sink: &H, count: &mut C) {
        let test = WideKernel::new(ray, best.t_high());
        let segment = test.clipped(&self.bounds);
        if segment.near <= segment.far {
            walk::closest::<Scalar, _, _, C, H>(self, test, (Self::root(), segment), ray, best, sink, count);
        }
    }

    #[inline(always)]
    pub(super) fn walk_occluded<S: Simd, C: Counter, H: HitSink>(
        &self,
        ray: &TravRay,
        sink: &H,
        count: &mut C,
    ) -> bool {
        if self.is_ordinary(ray) {
            S::call(OccludedFrom { tree: self, start: None, ray, sink, count })
        } else {
            self.occluded_wide(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    fn occluded_wide<C: Counter, H: HitSink>(&self, ray: &TravRay, sink: &H, count: &mut C) -> bool {
        let test = WideKernel::new(ray, f64::from(ray.range().t_far));
        let segment = test.clipped(&self.bounds);
        segment.near <= segment.far
            && walk::occluded::<Scalar, _, _, C, H>(self, &test, (Self::root(), segment), ray, sink, count)
    }
}

/// The children of a node that a ray meets, in f32 and in f64.
#[cfg(test)]
#[inline(always)]
pub(super) fn met<S: Simd, const K: usize>(ray: &TravRay, node: &Node<K>) -> [u32; 2] {
    let t_far = ray.range().t_far;
    let (fast, wide) = (FastKernel::<S>::new(ray, t_far), WideKernel::new(ray, f64::from(t_far)));
    let mut kids = Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] };
    let mut wide_kids = Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] };
    let (segment, wide_segment) =
        (Segment { near: ray.range().t_near, far: t_far }, Segment { near: wide.near, far: wide.limit });
    let fast = Kernel::<Wide<K>>::test(&fast, node, segment, &mut kids);
    [fast, Kernel::<Wide<K>>::test(&wide, node, wide_segment, &mut wide_kids)]
}
