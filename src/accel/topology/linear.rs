//! The fast builder: nodes are cut where the cells of a space-filling curve are.
//!
//! # Source
//! Lauterbach, Garland, Sengupta, Luebke and Manocha, "Fast BVH Construction on GPUs", 2009. Departures: a cell holds one block of triangles where it can; two
//! blocks are cut where their boxes have the least area; triangles of one cell are halved.
//!
//! Cost: O(n) after the sort, which takes 16 bytes a triangle. The depth is at most the number of bits of a word of [`Order`], of which each cut uses one up.

use rayon::prelude::*;

use super::{
    Child, MAX_DEPTH, Settings, Siblings, Topology,
    bounds::{Bounds, PrimRef},
    low_bits,
    morton::Order,
};
use crate::{
    accel::sah::BLOCK,
    simd::{Simd, SimdLevel, Task, dispatch, prefetch},
};

const _: () = assert!(u64::BITS as usize <= MAX_DEPTH);

/// Runs of fewer triangles are built by one task.
const TASK: usize = 8192;

/// How many places ahead triangles are asked for.
const AHEAD: usize = 48;

/// Builds the topology over triangles of which there are some, given the box of the centres of those that may be hit.
pub(super) fn build(refs: &[PrimRef], centers: &Bounds, settings: &Settings) -> Topology {
    let order = Order::new(refs, centers);
    let mut prims = vec![0; refs.len()];
    let numbers = prims.par_chunks_mut(TASK).enumerate();
    numbers.for_each(|(chunk, prims)| {
        for (i, prim) in prims.iter_mut().enumerate() {
            *prim = order.number(chunk * TASK + i);
        }
    });
    let builder = Builder { refs, order: &order, most: settings.leaf.min(BLOCK) };
    let mut pairs = Vec::with_capacity(refs.len() / builder.most + 1);
    let (root, _) = builder.run(0, &mut prims, &mut pairs);
    if !matches!(root, Child::Inner(_)) {
        pairs.push(Siblings { children: [root, Child::None], ..Siblings::NONE });
    }
    Topology { pairs, prims }
}

struct Builder<'a> {
    refs: &'a [PrimRef],
    order: &'a Order,
    /// Most triangles a leaf.
    most: usize,
}

impl Builder<'_> {
    /// Emits the subtree over the triangles from place `first` of the order on; itself and its box.
    fn run(&self, first: usize, prims: &mut [u32], out: &mut Vec<Siblings>) -> (Child, Bounds) {
        if prims.len() < TASK {
            return dispatch(SimdLevel::best(), Small { builder: self, first, prims, out });
        }
        let (middle, axis) = self.cut(first, prims.len());
        let own = out.len();
        out.push(Siblings::NONE);
        let (prims0, prims1) = prims.split_at_mut(middle);
        let mut other = Vec::new();
        let ((child0, box0), (child1, box1)) =
            rayon::join(|| self.run(first, prims0, out), || self.run(first + middle, prims1, &mut other));
        let all = box0.union(box1);
        let children = [child0, super::append(out, child1, &other)];
        out[own] = Siblings { children, area: all.half_area(), axis: low_bits(axis) };
        (Child::inner(own), all)
    }

    /// Where a run of the order leaves the cell of its first triangle, and the axis; half of the run where it is one cell.
    #[inline(always)]
    fn cut(&self, first: usize, count: usize) -> (usize, usize) {
        let (low, high) = (self.order.code(first), self.order.code(first + count - 1));
        if low == high {
            let half = (count / 2).next_multiple_of(self.most);
            return (if half < count { half } else { count / 2 }, 0);
        }
        let bit = u64::BITS - 1 - (low ^ high).leading_zeros();
        let (mut start, mut end) = (1, count - 1);
        while start < end {
            let middle = start.midpoint(end);
            if self.order.code(first + middle) >> bit & 1 == 1 {
                end = middle;
            } else {
                start = middle + 1;
            }
        }
        (start, bit as usize % 3)
    }

    #[inline(always)]
    fn bounds(&self, prim: u32) -> Bounds {
        self.refs[prim as usize].bounds()
    }

    /// Where the boxes of two blocks have the least area.
    #[inline(always)]
    fn cut_blocks(&self, prims: &[u32]) -> usize {
        let count = prims.len();
        let (least, most) = (count - self.most, self.most);
        let mut areas = [0.0; 2 * BLOCK];
        let mut right = Bounds::EMPTY;
        for i in (least..count).rev() {
            right = right.union(self.bounds(prims[i]));
            areas[i & (2 * BLOCK - 1)] = right.half_area();
        }
        let (mut best, mut left) = ((f32::INFINITY, most), Bounds::EMPTY);
        for i in 0..most {
            left = left.union(self.bounds(prims[i]));
            if i + 1 >= least {
                let area = left.half_area() + areas[(i + 1) & (2 * BLOCK - 1)];
                best = if area < best.0 { (area, i + 1) } else { best };
            }
        }
        best.1
    }
}

/// A part of the order that is still to be built, and whose child it is.
#[derive(Clone, Copy)]
struct Part {
    start: usize,
    end: usize,
    parent: usize,
    side: usize,
}

/// No pair.
const ROOT: usize = usize::MAX;

/// A run that one task builds.
struct Small<'a> {
    builder: &'a Builder<'a>,
    first: usize,
    prims: &'a mut [u32],
    out: &'a mut Vec<Siblings>,
}

impl Task for Small<'_> {
    type Output = (Child, Bounds);

    #[inline(always)]
    fn run<S: Simd>(self) -> (Child, Bounds) {
        let Self { builder, first, prims, out } = self;
        let base = out.len();
        let mut boxes =
            Boxes { all: Vec::with_capacity(prims.len() / builder.most + 1), parents: Vec::new(), root: Bounds::EMPTY };
        boxes.parents.reserve(boxes.all.capacity());
        let mut root = Child::None;
        // A part waits for each cut above the one at hand.
        let mut parts = [Part { start: 0, end: prims.len(), parent: ROOT, side: 0 }; MAX_DEPTH + 2];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let part = parts[waiting];
            let count = part.end - part.start;
            let child = if count <= builder.most {
                boxes.add(part.parent, base, builder.leaf(first, part, prims));
                Child::leaf(low_word(first + part.start), count)
            } else {
                let (middle, axis) = if count <= 2 * builder.most {
                    (builder.cut_blocks(&prims[part.start..part.end]), builder.cut(first + part.start, count).1)
                } else {
                    builder.cut(first + part.start, count)
                };
                let own = out.len();
                out.push(Siblings { axis: low_bits(axis), ..Siblings::NONE });
                boxes.all.push(Bounds::EMPTY);
                boxes.parents.push(part.parent);
                // The first child is taken next.
                parts[waiting] = Part { start: part.start + middle, parent: own, side: 1, ..part };
                parts[waiting + 1] = Part { end: part.start + middle, parent: own, side: 0, ..part };
                waiting += 2;
                Child::inner(own)
            };
            if part.parent == ROOT {
                root = child;
            } else {
                out[part.parent].children[part.side] = child;
            }
        }
        for i in (0..boxes.all.len()).rev() {
            let own = boxes.all[i];
            out[base + i].area = own.half_area();
            boxes.add(boxes.parents[i], base, own);
        }
        (root, boxes.root)
    }
}

impl Builder<'_> {
    /// Orders the triangles of a leaf; the box around them.
    #[inline(always)]
    fn leaf(&self, first: usize, part: Part, prims: &mut [u32]) -> Bounds {
        let mut all = Bounds::EMPTY;
        for i in part.start..part.end {
            let ahead = (first + i + AHEAD).min(self.refs.len() - 1);
            prefetch(self.refs, self.order.number(ahead) as usize);
            let prim = prims[i];
            all = all.union(self.bounds(prim));
            let mut at = i;
            while at > part.start && prims[at - 1] > prim {
                prims[at] = prims[at - 1];
                at -= 1;
            }
            prims[at] = prim;
        }
        all
    }
}

/// The boxes of pairs, and the pairs above them.
struct Boxes {
    all: Vec<Bounds>,
    parents: Vec<usize>,
    root: Bounds,
}

impl Boxes {
    /// Adds a box to that of a pair, whose number counts from `base` on.
    #[inline(always)]
    fn add(&mut self, pair: usize, base: usize, bounds: Bounds) {
        let to = if pair == ROOT { &mut self.root } else { &mut self.all[pair - base] };
        *to = to.union(bounds);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "triangles are counted in u32")]
fn low_word(place: usize) -> u32 {
    place as u32
}

#[cfg(test)]
mod tests;
