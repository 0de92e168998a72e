//! Eight children against one ray.

use super::{
    Wide,
    node::{FOURTH, Node, UPPER, Word},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        query::SLACK,
        slabs,
        ssh::node::Side,
        wide::{
            WIDTH, WideNode,
            walk::{self, Kernel},
        },
    },
    geom::{Aabb, Triangles},
    simd::{Halves, Lanes, Scalar, Simd, Task},
};

/// The part of a ray inside a child.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Segment<T> {
    pub(super) near: T,
    pub(super) far: T,
}

/// Segments of all children.
pub(in crate::accel) struct Segments<T> {
    pub(super) near: [T; WIDTH],
    pub(super) far: [T; WIDTH],
}

/// Where one end of a segment is cut.
pub(super) trait End<S: Simd>: Copy {
    /// t of the planes of an axis.
    fn at(&self, planes: S::F8, axis: usize) -> S::F8;
    /// t of the fourth planes; NaN for sides that cut the other end.
    fn at_row(&self, planes: S::F8, words: S::U8) -> S::F8;
}

/// One fused operation a plane: `plane * mul + add`.
#[derive(Clone, Copy)]
pub(super) struct Fused<S: Simd> {
    mul: [f32; 3],
    add: [f32; 3],
    row_mul: S::F8,
    row_add: S::F8,
}

impl<S: Simd> Fused<S> {
    #[inline(always)]
    fn new(mul: [f32; 3], add: [f32; 3], sides: [usize; 3]) -> Self {
        Self { mul, add, row_mul: by_row::<S>(mul, sides), row_add: by_row::<S>(add, sides) }
    }
}

impl<S: Simd> End<S> for Fused<S> {
    #[inline(always)]
    fn at(&self, planes: S::F8, axis: usize) -> S::F8 {
        planes.mul_add_loose(S::F8::splat(self.mul[axis]), S::F8::splat(self.add[axis]))
    }

    #[inline(always)]
    fn at_row(&self, planes: S::F8, words: S::U8) -> S::F8 {
        planes.mul_add_loose(S::picked::<FOURTH>(self.row_mul, words), S::picked::<FOURTH>(self.row_add, words))
    }
}

/// Rows of the sides that a ray enters through, or leaves through: the lower planes where it runs upward.
#[inline(always)]
pub(super) fn sides(backward: [bool; 3], exits: bool) -> [usize; 3] {
    let side = |axis: usize| axis + 4 * usize::from(backward[axis] != exits);
    [side(0), side(1), side(2)]
}

/// A table by [`Side::row`] with the numbers of these sides, NaN elsewhere.
#[inline(always)]
pub(super) fn by_row<S: Simd>(numbers: [f32; 3], sides: [usize; 3]) -> S::F8 {
    let mut rows = [f32::NAN; Side::ROWS];
    for (number, side) in numbers.into_iter().zip(sides) {
        rows[side & 7] = number;
    }
    S::F8::load(&rows)
}

/// Inverts the bits of [`UPPER`] planes where the ray runs upward: they then mark entries.
#[inline(always)]
pub(super) fn flips(backward: [bool; 3]) -> u32 {
    let [x, y, z] = [u32::from(!backward[0]), u32::from(!backward[1]), u32::from(!backward[2])];
    (x | y << 1 | z << 2) << UPPER
}

/// Segments of the children, from that of their node. The two ends may belong to different rays, the first and the last to pass each plane.
#[inline(always)]
pub(super) fn cut_all<S: Simd, E: End<S>, const K: usize>(
    node: &Node<K>,
    [entry, exit]: [&E; 2],
    flips: u32,
    segment: Segment<f32>,
    kids: &mut Segments<f32>,
) -> (S::F8, S::F8) {
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
    (near, far)
}

const _: () = assert!(UPPER == 28);

/// All planes of eight children at once, in f32. The proof at [`Slab`](slabs::Slab) holds lane by lane, for segments that were inherited too; with 2^-126 of slack on the
/// comparison a segment that holds a common point of the half-spaces is never found empty.
#[derive(Clone, Copy)]
struct FastKernel<S: Simd> {
    entry: Fused<S>,
    exit: Fused<S>,
    backward: [bool; 3],
    flips: u32,
    limit: f32,
}

impl<S: Simd> FastKernel<S> {
    #[inline(always)]
    fn new(ray: &TravRay, reach: f32, limit: f32) -> Self {
        let (range, [x, y, z]) = (ray.range(), slabs::of_ray::<S>(ray, reach));
        let backward = [range.dir.x < 0.0, range.dir.y < 0.0, range.dir.z < 0.0];
        let entry_mul = [x.entry_mul, y.entry_mul, z.entry_mul];
        let entry_add = [x.entry_add, y.entry_add, z.entry_add];
        let exit_mul = [x.exit_mul, y.exit_mul, z.exit_mul];
        let exit_add = [x.exit_add, y.exit_add, z.exit_add];
        Self {
            entry: Fused::new(entry_mul, entry_add, sides(backward, false)),
            exit: Fused::new(exit_mul, exit_add, sides(backward, true)),
            backward,
            flips: flips(backward),
            limit,
        }
    }

    /// The ray's range within the root's box.
    #[inline(always)]
    fn clipped(&self, near: f32, bounds: &Aabb) -> Segment<f32> {
        let (mut near, mut far) = (S::F4::splat(near), S::F4::splat(self.limit));
        for axis in 0..3 {
            let (low, high) = (S::F4::splat(bounds.min[axis]), S::F4::splat(bounds.max[axis]));
            (near, far) = self.cut_four::<S>([low, high], axis, near, far);
        }
        Segment { near: near.first(), far: far.first() }
    }

    /// Four slabs of one axis.
    #[inline(always)]
    fn cut_four<T: Simd>(&self, [low, high]: [T::F4; 2], axis: usize, near: T::F4, far: T::F4) -> (T::F4, T::F4) {
        let (first, last) = if self.backward[axis] { (high, low) } else { (low, high) };
        let entry = first.mul_add_loose(T::F4::splat(self.entry.mul[axis]), T::F4::splat(self.entry.add[axis]));
        let exit = last.mul_add_loose(T::F4::splat(self.exit.mul[axis]), T::F4::splat(self.exit.add[axis]));
        (entry.max(near), exit.min(far))
    }
}

#[inline(always)]
fn is_open(segment: Segment<f32>) -> bool {
    segment.near <= segment.far + SLACK
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
        let (near, far) = cut_all::<S, _, K>(node, [&self.entry, &self.exit], self.flips, mark, kids);
        (near - far).le(S::F8::splat(SLACK))
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
    }

    #[inline(always)]
    fn reopened(&self, Segment { near, far }: Segment<f32>) -> Option<Segment<f32>> {
        let segment = Segment { near, far: if self.limit < far { self.limit } else { far } };
        is_open(segment).then_some(segment)
    }

    /// Planes that are inherited lead to leaves that the ray misses, and the triangles' boxes cost a third of the exact test.
    #[inline(always)]
    fn may_meet<T: Simd>(&self, block: &TriBlock, Segment { near, far }: Segment<f32>) -> bool {
        let (mut near, mut far) = (T::F4::splat(near), T::F4::splat(far));
        for (axis, planes) in block.boxes::<T>().into_iter().enumerate() {
            (near, far) = self.cut_four::<T>(planes, axis, near, far);
        }
        (near - far).le(T::F4::splat(SLACK)) != 0
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
    pub(super) ray: (&'a TravRay, &'a Triangles<'a>),
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a H,
    pub(super) count: &'a mut C,
}

impl<const K: usize, C: Counter, H: HitSink> Task for ClosestFrom<'_, K, C, H> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, start, ray, best, sink, count } = self;
        let test = FastKernel::<S>::new(ray.0, tree.reach, best.t_cull());
        let start = start.unwrap_or_else(|| (Wide::<K>::root(), test.clipped(ray.0.range().t_near, &tree.bounds)));
        if is_open(start.1) {
            walk::closest::<S, _, _, C, H>(tree, test, start, ray, best, sink, count);
        }
    }
}

/// As [`ClosestFrom`]: whether anything is hit.
pub(super) struct OccludedFrom<'a, const K: usize, C, H> {
    pub(super) tree: &'a Wide<K>,
    pub(super) start: Option<Start>,
    pub(super) ray: (&'a TravRay, &'a Triangles<'a>),
    pub(super) sink: &'a H,
    pub(super) count: &'a mut C,
}

impl<const K: usize, C: Counter, H: HitSink> Task for OccludedFrom<'_, K, C, H> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { tree, start, ray, sink, count } = self;
        let test = FastKernel::<S>::new(ray.0, tree.reach, ray.0.range().t_far);
        let start = start.unwrap_or_else(|| (Wide::<K>::root(), test.clipped(ray.0.range().t_near, &tree.bounds)));
        is_open(start.1) && walk::occluded::<S, _, _, C, H>(tree, &test, start, ray, sink, count)
    }
}

impl<const K: usize> Wide<K> {
    pub(super) fn root() -> Word {
        Word::inner(0)
    }

    /// True when f32 node tests are proven for this ray and these planes.
    #[inline(always)]
    pub(super) fn fits(&self, ray: &TravRay) -> bool {
        slabs::fits(ray, self.reach)
    }

    #[inline(always)]
    pub(super) fn walk_closest<S: Simd, C: Counter, H: HitSink>(
        &self,
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &H,
        count: &mut C,
    ) {
        if self.fits(ray.0) {
            // Called, so that packets which fall apart share the code.
            S::call(ClosestFrom { tree: self, start: None, ray, best, sink, count });
        } else {
            self.closest_wide(ray, best, sink, count);
        }
    }

    /// Rare, so compiled once, not for every level.
    #[cold]
    #[inline(never)]
    fn closest_wide<C: Counter, H: HitSink>(
        &self,
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &H,
        count: &mut C,
    ) {
        let test = WideKernel::new(ray.0, best.t_high());
        let segment = test.clipped(&self.bounds);
        if segment.near <= segment.far {
            walk::closest::<Scalar, _, _, C, H>(self, test, (Self::root(), segment), ray, best, sink, count);
        }
    }

    #[inline(always)]
    pub(super) fn walk_occluded<S: Simd, C: Counter, H: HitSink>(
        &self,
        ray: (&TravRay, &Triangles<'_>),
        sink: &H,
        count: &mut C,
    ) -> bool {
        if self.fits(ray.0) {
            S::call(OccludedFrom { tree: self, start: None, ray, sink, count })
        } else {
            self.occluded_wide(ray, sink, count)
        }
    }

    #[cold]
    #[inline(never)]
    fn occluded_wide<C: Counter, H: HitSink>(&self, ray: (&TravRay, &Triangles<'_>), sink: &H, count: &mut C) -> bool {
        let test = WideKernel::new(ray.0, f64::from(ray.0.range().t_far));
        let segment = test.clipped(&self.bounds);
        segment.near <= segment.far
            && walk::occluded::<Scalar, _, _, C, H>(self, &test, (Self::root(), segment), ray, sink, count)
    }
}

/// The children of a node that a ray meets, in f32 and in f64.
#[cfg(test)]
#[inline(always)]
pub(super) fn met<S: Simd, const K: usize>(ray: &TravRay, node: &Node<K>, reach: f32) -> [u32; 2] {
    let t_far = ray.range().t_far;
    let (fast, wide) = (FastKernel::<S>::new(ray, reach, t_far), WideKernel::new(ray, f64::from(t_far)));
    let mut kids = Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] };
    let mut wide_kids = Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] };
    let (segment, wide_segment) =
        (Segment { near: ray.range().t_near, far: t_far }, Segment { near: wide.near, far: wide.limit });
    let fast = Kernel::<Wide<K>>::test(&fast, node, segment, &mut kids);
    [fast, Kernel::<Wide<K>>::test(&wide, node, wide_segment, &mut wide_kids)]
}
