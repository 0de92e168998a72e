//! Top-down build by the surface-area heuristic, binned for many triangles and by full sweeps for few.
//!
//! # Source
//! Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007. Departures: all three axes are tried;
//! leaves cost by blocks of four; small nodes are split by sorting; the depth is bounded by falling back to medians.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "triangles are counted in u32, checked before; places of bins saturate and are clamped"
)]

use glam::Vec3A;
use rayon::prelude::*;

use super::{
    Bvh2Config, MAX_DEPTH,
    node::{Link, Pair},
};
use crate::{
    accel::{
        block::{NO_PRIM, TriBlock},
        sah::{BLOCK, COST_BLOCK, COST_TRAVERSE},
    },
    geom::{PrimId, Triangles},
};

/// Nodes of fewer triangles are split by sorting.
const SWEEP: usize = 24;

/// Nodes of fewer triangles are built by one task.
const TASK: usize = 8192;

/// Triangles that one task puts into bins.
const BIN_CHUNK: usize = 16384;

/// Most bins an axis may have.
pub(super) const MAX_BINS: usize = 64;

/// A triangle's box and number while the tree is built.
#[derive(Clone, Copy)]
struct PrimRef {
    min: Vec3A,
    max: Vec3A,
    id: u32,
}

impl PrimRef {
    fn new(prims: &Triangles<'_>, id: u32) -> Self {
        let aabb = prims.finite_aabb(PrimId(id));
        Self { min: aabb.min.into(), max: aabb.max.into(), id }
    }

    /// Midpoint of the box; 0 for a triangle that is never hit. Halved first: the sum may overflow.
    #[inline(always)]
    fn center(&self) -> Vec3A {
        if self.min.x > self.max.x { Vec3A::ZERO } else { self.min * 0.5 + self.max * 0.5 }
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    min: Vec3A,
    max: Vec3A,
}

impl Bounds {
    const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    #[inline(always)]
    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline(always)]
    fn of(prim: &PrimRef) -> Self {
        Self { min: prim.min, max: prim.max }
    }

    #[inline(always)]
    fn half_area(self) -> f64 {
        let e = self.max.as_dvec3() - self.min.as_dvec3();
        if e.x < 0.0 { 0.0 } else { e.x * e.y + e.y * e.z + e.z * e.x }
    }
}

/// Pairs and blocks of a subtree; links count from its own first pair and block.
#[derive(Default)]
pub(super) struct Emitted {
    pub(super) pairs: Vec<Pair>,
    pub(super) blocks: Vec<TriBlock>,
}

/// A subtree's link and how many blocks are below it.
type Child = (Link, u32);

/// Builds the topology over all triangles; boxes and corners are left to a refit.
pub(super) fn build(prims: &Triangles<'_>, config: &Bvh2Config) -> Emitted {
    let mut refs: Vec<PrimRef> =
        (0..prims.len() as u32).into_par_iter().with_min_len(BIN_CHUNK).map(|id| PrimRef::new(prims, id)).collect();
    let mut out = Emitted::default();
    let (link, blocks) = match refs.len() {
        0 => (Link::NONE, 0),
        _ => Builder { config }.child(&mut refs, 0, &mut out),
    };
    if link.is_leaf() {
        // A walk begins at a pair, so a lone leaf gets one.
        out.pairs.push(Pair::new([link, Link::NONE], [blocks, 0]));
    }
    out
}

struct Builder<'a> {
    config: &'a Bvh2Config,
}

impl Builder<'_> {
    /// Emits the subtree over `refs`, which may be reordered; `depth` is the number of pairs above it.
    fn child(&self, refs: &mut [PrimRef], depth: usize, out: &mut Emitted) -> Child {
        let Some(middle) = self.split(refs, depth) else {
            return leaf(refs, out);
        };
        let parent = out.pairs.len();
        out.pairs.push(Pair::new([Link::NONE; 2], [0; 2]));
        let count = refs.len();
        let (left, right) = refs.split_at_mut(middle);
        let (first, second) = if count < TASK {
            (self.child(left, depth + 1, out), self.child(right, depth + 1, out))
        } else {
            let fresh = |refs| {
                let mut out = Emitted::default();
                let child = self.child(refs, depth + 1, &mut out);
                (child, out)
            };
            let (first, second) = rayon::join(|| fresh(left), || fresh(right));
            (append(out, first), append(out, second))
        };
        out.pairs[parent] = Pair::new([first.0, second.0], [first.1, second.1]);
        (Link::inner(parent), first.1 + second.1)
    }

    /// Where to cut `refs` after reordering them; `None` makes a leaf.
    fn split(&self, refs: &mut [PrimRef], depth: usize) -> Option<usize> {
        let count = refs.len();
        let leaf_max = self.config.leaf_blocks * BLOCK;
        if count <= 1 {
            return None;
        }
        let found = if count <= SWEEP { sweep(refs) } else { self.binned(refs) };
        if count <= leaf_max && found.is_none_or(|split| split.cost >= leaf_cost(count)) {
            return None;
        }
        // Halving from here on must reach leaves within the depth that is left.
        let room =
            leaf_max.checked_shl((MAX_DEPTH - depth - 1) as u32).filter(|r| r >> (MAX_DEPTH - depth - 1) == leaf_max);
        let room = room.unwrap_or(usize::MAX);
        if let Some(split) = found {
            let middle = split.apply(refs);
            if middle.max(count - middle) <= room {
                return Some(middle);
            }
        }
        Some(median(refs))
    }

    fn binned(&self, refs: &mut [PrimRef]) -> Option<Split> {
        let centers = reduce(
            refs,
            |refs| {
                refs.iter().fold(Bounds::EMPTY, |b, r| {
                    let c = r.center();
                    b.union(Bounds { min: c, max: c })
                })
            },
            Bounds::union,
        );
        let bins = self.config.bins;
        let binning = Binning::new(centers, bins);
        let filled = reduce(refs, |refs| Bins::fill(refs, &binning), Bins::merge);
        filled.best(&binning, refs)
    }
}

/// Runs `work` over chunks of a fixed size and merges the results; the order does not matter to `merge`.
fn reduce<T: Send>(
    refs: &[PrimRef],
    work: impl Fn(&[PrimRef]) -> T + Sync,
    merge: impl Fn(T, T) -> T + Sync + Send,
) -> T {
    if refs.len() <= 2 * BIN_CHUNK {
        return work(refs);
    }
    refs.par_chunks(BIN_CHUNK).map(&work).reduce_with(&merge).unwrap_or_else(|| work(&[]))
}

fn leaf_cost(count: usize) -> f64 {
    COST_BLOCK * count.div_ceil(BLOCK) as f64
}

/// Writes the blocks of a leaf, triangles in ascending order.
fn leaf(refs: &mut [PrimRef], out: &mut Emitted) -> Child {
    refs.sort_unstable_by_key(|r| r.id);
    let first = out.blocks.len();
    for chunk in refs.chunks(BLOCK) {
        let mut prims = [NO_PRIM; BLOCK];
        for (lane, prim) in prims.iter_mut().zip(chunk) {
            *lane = prim.id;
        }
        out.blocks.push(TriBlock::new(prims));
    }
    let count = out.blocks.len() - first;
    (Link::leaf(first, count), count as u32)
}

/// Moves a subtree emitted apart behind what is there.
fn append(out: &mut Emitted, ((link, blocks), part): (Child, Emitted)) -> Child {
    let (pair_base, block_base) = (out.pairs.len(), out.blocks.len());
    out.pairs.extend(part.pairs.into_iter().map(|mut pair| {
        pair.links = pair.links.map(|link| link.moved(pair_base, block_base));
        pair
    }));
    out.blocks.extend(part.blocks);
    (link.moved(pair_base, block_base), blocks)
}

/// Cuts in the middle of the order by centre along the longest axis of the centres, then by number.
fn median(refs: &mut [PrimRef]) -> usize {
    let centers = refs.iter().fold(Bounds::EMPTY, |b, r| b.union(Bounds { min: r.center(), max: r.center() }));
    let e = centers.max.as_dvec3() - centers.min.as_dvec3();
    let axis = if e.x >= e.y && e.x >= e.z {
        0
    } else if e.y >= e.z {
        1
    } else {
        2
    };
    let middle = (refs.len() / 2).next_multiple_of(BLOCK).min(refs.len() - 1);
    refs.select_nth_unstable_by(middle, |a, b| a.center()[axis].total_cmp(&b.center()[axis]).then(a.id.cmp(&b.id)));
    middle
}

/// A way to cut a node in two.
#[derive(Clone, Copy)]
struct Split {
    cost: f64,
    how: How,
}

#[derive(Clone, Copy)]
enum How {
    /// The first `count` by (centre on `axis`, number).
    Sorted { axis: usize, count: usize },
    /// The bins of `axis` before `bin`, which hold `count` triangles.
    Binned { axis: usize, bin: usize, count: usize, binning: Binning },
}

impl Split {
    /// Reorders `refs` so that the first part comes first; returns its length.
    fn apply(self, refs: &mut [PrimRef]) -> usize {
        match self.how {
            How::Sorted { axis, count } => {
                sort(refs, axis);
                count
            }
            How::Binned { axis, bin, count, binning } => {
                partition(refs, |r| binning.bins_of(r.center())[axis] < bin);
                count
            }
        }
    }
}

fn sort(refs: &mut [PrimRef], axis: usize) {
    refs.sort_unstable_by(|a, b| a.center()[axis].total_cmp(&b.center()[axis]).then(a.id.cmp(&b.id)));
}

/// Moves the elements that satisfy `first` to the front, in one pass from both ends.
fn partition(refs: &mut [PrimRef], first: impl Fn(&PrimRef) -> bool) {
    let (mut low, mut high) = (0, refs.len());
    while low < high {
        if first(&refs[low]) {
            low += 1;
        } else {
            high -= 1;
            refs.swap(low, high);
        }
    }
}

/// The best cut of a small node over all axes, by the areas on both sides of every place in the sorted order.
fn sweep(refs: &mut [PrimRef]) -> Option<Split> {
    let count = refs.len();
    let mut best: Option<Split> = None;
    let mut suffix = [0.0; SWEEP];
    let mut total = Bounds::EMPTY;
    for axis in 0..3 {
        sort(refs, axis);
        let mut right = Bounds::EMPTY;
        for i in (1..count).rev() {
            right = right.union(Bounds::of(&refs[i]));
            suffix[i] = right.half_area();
        }
        total = right.union(Bounds::of(&refs[0]));
        let mut left = Bounds::EMPTY;
        for i in 1..count {
            left = left.union(Bounds::of(&refs[i - 1]));
            let cost = left.half_area() * leaf_cost(i) + suffix[i] * leaf_cost(count - i);
            if best.is_none_or(|b| cost < b.cost) {
                best = Some(Split { cost, how: How::Sorted { axis, count: i } });
            }
        }
    }
    best.map(|split| split.relative_to(total.half_area()))
}

impl Split {
    /// Turns a sum of areas times costs into the cost of a visit to the node.
    fn relative_to(self, area: f64) -> Self {
        let below = if area > 0.0 { self.cost / area } else { f64::INFINITY };
        Self { cost: COST_TRAVERSE + below, ..self }
    }
}

/// How centres map to bins.
#[derive(Clone, Copy)]
struct Binning {
    low: Vec3A,
    scale: Vec3A,
    bins: usize,
}

impl Binning {
    fn new(centers: Bounds, bins: usize) -> Self {
        let extent = centers.max - centers.min;
        // An extent of 0, or one that overflows, puts everything into one bin.
        let scale = |e: f32| {
            let s = bins as f32 / e;
            if e.is_finite() && s.is_finite() { s } else { 0.0 }
        };
        Self { low: centers.min, scale: Vec3A::new(scale(extent.x), scale(extent.y), scale(extent.z)), bins }
    }

    #[inline(always)]
    fn bins_of(&self, center: Vec3A) -> [usize; 3] {
        let place = (center - self.low) * self.scale;
        // Float to integer saturates, NaN becomes 0.
        place.to_array().map(|p| (p as usize).min(self.bins - 1))
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    count: usize,
}

struct Bins {
    axes: [[Bin; MAX_BINS]; 3],
    used: usize,
}

impl Bins {
    fn fill(refs: &[PrimRef], binning: &Binning) -> Self {
        let mut out = Self { axes: [[Bin { bounds: Bounds::EMPTY, count: 0 }; MAX_BINS]; 3], used: binning.bins };
        for prim in refs {
            for (axis, bin) in binning.bins_of(prim.center()).into_iter().enumerate() {
                let bin = &mut out.axes[axis][bin];
                bin.bounds = bin.bounds.union(Bounds::of(prim));
                bin.count += 1;
            }
        }
        out
    }

    fn merge(mut self, Self { axes, .. }: Self) -> Self {
        for (axis, from) in self.axes.iter_mut().zip(axes) {
            for (bin, from) in axis[..self.used].iter_mut().zip(from) {
                bin.bounds = bin.bounds.union(from.bounds);
                bin.count += from.count;
            }
        }
        self
    }

    /// The best cut between bins that leaves triangles on both sides.
    fn best(&self, binning: &Binning, refs: &[PrimRef]) -> Option<Split> {
        let total = refs.len();
        let mut best: Option<Split> = None;
        let mut area = 0.0;
        for (axis, bins) in self.axes.iter().enumerate() {
            let bins = &bins[..self.used];
            let mut suffix = [0.0; MAX_BINS];
            let mut right = Bounds::EMPTY;
            for (i, bin) in bins.iter().enumerate().rev() {
                right = right.union(bin.bounds);
                suffix[i] = right.half_area();
            }
            area = suffix[0];
            let (mut left, mut count) = (Bounds::EMPTY, 0);
            for i in 1..self.used {
                left = left.union(bins[i - 1].bounds);
                count += bins[i - 1].count;
                if count == 0 || count == total {
                    continue;
                }
                let cost = left.half_area() * leaf_cost(count) + suffix[i] * leaf_cost(total - count);
                if best.is_none_or(|b| cost < b.cost) {
                    best = Some(Split { cost, how: How::Binned { axis, bin: i, count, binning: *binning } });
                }
            }
        }
        best.map(|split| split.relative_to(area))
    }
}
