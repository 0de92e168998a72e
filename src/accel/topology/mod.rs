//! Binary topologies over triangles: which triangles share a leaf and which subtrees are siblings, without any boxes.
//!
//! `bvh2` and `ssh` are built over the same topology and differ in what a node stores, so that comparing them compares nodes. Trees of eight children
//! a node are made of it as well.
//!
//! # Source
//! Binned splits: Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007. Departures: all three axes
//! are tried; leaves cost by blocks of four; nodes of few triangles are swept exactly over orders sorted once; the depth is bounded by falling
//! back to medians. Spatial median: Lauterbach et al., "RT-DEFORM", 2006, as Eisemann et al. use it ("Single Slab Hierarchy", 2008): the middle of the
//! longest axis of the node's own box, by centres; half of the triangles where that leaves a side empty. Fast: `linear.rs`.
//!
//! Cost: O(n log n) in the current rayon pool, 36 bytes a triangle beside the result; fast: O(n), 60. The result does not depend on the number of threads.

mod binned;
mod bounds;
mod linear;
mod morton;
mod small;
pub(super) mod wide;

use rayon::prelude::*;

use super::sah::{BLOCK, COST_BLOCK};
use crate::geom::Triangles;
use bounds::{Bounds, Choose, PrimRef};

/// Most pairs on a path from the root: the length of traversal stacks.
pub(super) const MAX_DEPTH: usize = 64;

/// Most triangles that a leaf may be allowed to hold.
pub(super) const MAX_LEAF: usize = 32;

/// Most bins an axis may have.
pub(super) const MAX_BINS: usize = 64;

/// Nodes have a bin for so many triangles, unless that is fewer bins than these.
const PER_BIN: usize = 8;
const LEAST_BINS: usize = 8;

/// Nodes of fewer triangles are built by one task.
const TASK: usize = 8192;

/// Triangles that one task of a large node takes.
const CHUNK: usize = 16384;

/// How nodes are cut in two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Cut {
    /// By the surface-area heuristic.
    #[default]
    Sah,
    /// In the middle of the node's box along its longest axis, down to the largest leaf allowed.
    Median,
    /// Where the cells of a space-filling curve are: the fastest to build. Leaves hold one block at most.
    Fast,
}

/// What shapes a topology.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    pub(super) cut: Cut,
    /// Bins an axis, 2 to [`MAX_BINS`].
    pub(super) bins: usize,
    /// Most triangles a leaf, 1 to [`MAX_LEAF`].
    pub(super) leaf: usize,
}

/// The value of a `build` setting.
///
/// # Errors
/// What is wrong with it.
pub(super) fn parse_cut(value: &str) -> Result<Cut, String> {
    match value {
        "sah" => Ok(Cut::Sah),
        "median" => Ok(Cut::Median),
        "fast" => Ok(Cut::Fast),
        _ => Err(format!("`{value}` is not one of sah, median, fast")),
    }
}

/// The value of a `bins` setting.
///
/// # Errors
/// What is wrong with it.
pub(super) fn parse_bins(value: &str) -> Result<usize, String> {
    parse_number(value, 2, MAX_BINS)
}

/// The value of a `leaf` setting.
///
/// # Errors
/// What is wrong with it.
pub(super) fn parse_leaf(value: &str) -> Result<usize, String> {
    parse_number(value, 1, MAX_LEAF)
}

fn parse_number(value: &str, least: usize, most: usize) -> Result<usize, String> {
    let number = value.parse().ok().filter(|n| (least..=most).contains(n));
    number.ok_or_else(|| format!("`{value}` is not a number from {least} to {most}"))
}

/// What a node of a pair is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Child {
    /// Nothing: beside a root that is a leaf.
    None,
    /// The pair with this number.
    Inner(u32),
    /// Triangles from place `first` of [`Topology::prims`] on.
    Leaf { first: u32, count: u32 },
}

/// Two siblings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Siblings {
    pub(super) children: [Child; 2],
    /// Half the area of the box around both, relative to those of other pairs.
    pub(super) area: f32,
    /// The axis they were cut along: the first has the lower centres.
    pub(super) axis: u8,
}

impl Siblings {
    const NONE: Self = Self { children: [Child::None; 2], area: 0.0, axis: 0 };
}

/// A tree of pairs, root first, in depth-first order: a subtree owns contiguous runs of pairs and places.
#[derive(Debug)]
pub(super) struct Topology {
    /// At least one.
    pub(super) pairs: Vec<Siblings>,
    /// Triangle numbers in the order of the leaves, ascending within each.
    pub(super) prims: Vec<u32>,
}

/// Builds the topology over all triangles.
///
/// # Panics
/// With 2^28 triangles or more: structures have lower limits.
#[expect(clippy::cast_possible_truncation, reason = "checked first")]
pub(super) fn build(prims: &Triangles<'_>, settings: &Settings) -> Topology {
    assert!(prims.len() <= bounds::MAX_NUMBER as usize, "more triangles than references can number");
    let numbers = (0..prims.len() as u32).into_par_iter().with_min_len(CHUNK);
    let mut refs: Vec<PrimRef> = numbers.map(|id| PrimRef::new(prims, id)).collect();
    let centers = bounds::normalize(&mut refs);
    if settings.cut == Cut::Fast && !refs.is_empty() {
        return linear::build(&refs, &centers, settings);
    }
    let mut order = vec![0; refs.len()];
    let mut pairs = Vec::new();
    let root = match refs.len() {
        0 => Child::None,
        _ => {
            Builder::new(settings).child(Run { refs: &mut refs, order: &mut order, first: 0 }, &centers, 0, &mut pairs)
        }
    };
    if !matches!(root, Child::Inner(_)) {
        // A walk begins at a pair, so a lone leaf gets one.
        pairs.push(Siblings { children: [root, Child::None], ..Siblings::NONE });
    }
    Topology { pairs, prims: order }
}

/// The triangles of a subtree and their places in the result.
struct Run<'a> {
    refs: &'a mut [PrimRef],
    order: &'a mut [u32],
    first: u32,
}

impl Run<'_> {
    #[expect(clippy::cast_possible_truncation, reason = "places are counted in u32")]
    fn split(self, middle: usize) -> (Self, Self) {
        let (refs0, refs1) = self.refs.split_at_mut(middle);
        let (order0, order1) = self.order.split_at_mut(middle);
        let second = self.first + middle as u32;
        (Self { refs: refs0, order: order0, first: self.first }, Self { refs: refs1, order: order1, first: second })
    }

    /// Writes a leaf.
    fn leaf(self) -> Child {
        for (place, prim) in self.order.iter_mut().zip(&*self.refs) {
            *place = prim.id();
        }
        self.order.sort_unstable();
        Child::leaf(self.first, self.order.len())
    }
}

impl Child {
    #[expect(clippy::cast_possible_truncation, reason = "leaves are small")]
    fn leaf(first: u32, count: usize) -> Self {
        Self::Leaf { first, count: count as u32 }
    }

    #[expect(clippy::cast_possible_truncation, reason = "there are fewer pairs than triangles")]
    fn inner(pair: usize) -> Self {
        Self::Inner(pair as u32)
    }

    /// The child when its pair number counts from `pairs` on.
    #[inline(always)]
    fn moved(self, pairs: usize) -> Self {
        match self {
            Self::Inner(pair) => Self::inner(pair as usize + pairs),
            other => other,
        }
    }
}

/// Where a node was cut, along which axis, the boxes of the centres on both sides, and half the area of its box.
struct Halves {
    middle: usize,
    axis: usize,
    centers: [Bounds; 2],
    area: f32,
}

struct Builder<'a> {
    settings: &'a Settings,
    /// Cost of a leaf of so many triangles.
    costs: [f32; small::SMALL + 1],
}

impl<'a> Builder<'a> {
    fn new(settings: &'a Settings) -> Self {
        let mut costs = [0.0; small::SMALL + 1];
        for (count, cost) in (0..).zip(&mut costs) {
            *cost = settings.leaf_cost(count);
        }
        Self { settings, costs }
    }

    /// Emits the subtree over `run`; `depth` is the number of pairs above it.
    fn child(&self, run: Run<'_>, centers: &Bounds, depth: usize, out: &mut Vec<Siblings>) -> Child {
        let count = run.refs.len();
        let halves = match self.settings.cut {
            Cut::Sah | Cut::Fast if count <= small::SMALL => return small::build(self, run, depth, out),
            Cut::Median if count <= self.settings.leaf => return run.leaf(),
            Cut::Sah | Cut::Fast => self.binned(run.refs, centers),
            Cut::Median => spatial_median(run.refs),
        };
        let room = self.settings.room(depth);
        let halves = halves.filter(|h| h.middle.max(count - h.middle) <= room);
        let Halves { middle, axis, centers, area } = halves.unwrap_or_else(|| self.median(run.refs, centers));
        let parent = out.len();
        out.push(Siblings { area, axis: low_bits(axis), ..Siblings::NONE });
        let (left, right) = run.split(middle);
        let children = if count < TASK {
            [self.child(left, &centers[0], depth + 1, out), self.child(right, &centers[1], depth + 1, out)]
        } else {
            let mut other = Vec::new();
            let (first, second) = rayon::join(
                || self.child(left, &centers[0], depth + 1, out),
                || self.child(right, &centers[1], depth + 1, &mut other),
            );
            [first, append(out, second, &other)]
        };
        out[parent].children = children;
        Child::inner(parent)
    }

    fn binned(&self, refs: &mut [PrimRef], centers: &Bounds) -> Option<Halves> {
        match self.settings.bins.min(LEAST_BINS.max(refs.len() / PER_BIN)) {
            bins @ ..=16 => binned::split::<16>(refs, centers, bins, self.settings),
            bins @ ..=32 => binned::split::<32>(refs, centers, bins, self.settings),
            bins => binned::split::<MAX_BINS>(refs, centers, bins, self.settings),
        }
    }

    /// Cuts in the middle of the order by centre along the longest axis of the centres, then by number.
    fn median(&self, refs: &mut [PrimRef], centers: &Bounds) -> Halves {
        let axis = centers.longest_axis() & 3;
        let middle = self.settings.half(refs.len());
        refs.select_nth_unstable_by(middle, |a, b| {
            a.center()[axis].total_cmp(&b.center()[axis]).then(a.id().cmp(&b.id()))
        });
        let (left, right) = refs.split_at(middle);
        Halves {
            middle,
            axis,
            centers: [Bounds::of_centers(left), Bounds::of_centers(right)],
            area: bounds::reduce(refs, Bounds::around, Bounds::union).half_area(),
        }
    }
}

impl Settings {
    /// Half of `count`, 2 at least; whole blocks where leaves are.
    fn half(&self, count: usize) -> usize {
        let half = count / 2;
        let blocks = half.next_multiple_of(BLOCK);
        if self.leaf.is_multiple_of(BLOCK) && blocks < count { blocks } else { half }
    }
    /// Triangles that a child of a pair at `depth` may have so that halving reaches leaves within [`MAX_DEPTH`].
    fn room(&self, depth: usize) -> usize {
        let levels = MAX_DEPTH.saturating_sub(depth + 1);
        if levels >= 40 { usize::MAX } else { self.leaf << levels }
    }

    /// Cost of testing a leaf, per unit of area: blocks count, which hold one triangle where leaves do.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
    fn leaf_cost(&self, count: u32) -> f32 {
        let blocks = match self.leaf {
            1 => count,
            2 => count.div_ceil(2),
            3 => count.div_ceil(3),
            _ => count.div_ceil(BLOCK as u32),
        };
        COST_BLOCK as f32 * blocks as f32
    }
}

#[expect(clippy::cast_possible_truncation, reason = "an axis is below 3")]
fn low_bits(axis: usize) -> u8 {
    axis as u8
}

/// Appends a subtree emitted apart.
fn append(out: &mut Vec<Siblings>, child: Child, part: &[Siblings]) -> Child {
    let base = out.len();
    out.reserve(part.len());
    for siblings in part {
        let [first, second] = siblings.children;
        out.push(Siblings { children: [first.moved(base), second.moved(base)], ..*siblings });
    }
    child.moved(base)
}

/// Cuts at the middle of the longest axis of the triangles' box, by centres; `None` when a side stays empty.
fn spatial_median(refs: &mut [PrimRef]) -> Option<Halves> {
    let all = bounds::reduce(refs, Bounds::around, Bounds::union);
    if all.is_empty() {
        return None;
    }
    let axis = all.longest_axis();
    let (count, centers) = bounds::partition(refs, &Before { axis, middle: all.center()[axis] });
    (count != 0 && count != refs.len()).then_some(Halves { middle: count, axis, centers, area: all.half_area() })
}

/// Chooses what lies before the middle of an axis.
struct Before {
    axis: usize,
    middle: f32,
}

impl Choose for Before {
    #[inline(always)]
    fn chooses(&self, prim: &PrimRef) -> bool {
        prim.center()[self.axis & 3] < self.middle
    }
}
