//! The fast builder: neighbours along a space-filling curve are merged from the bottom up.
//!
//! # Source
//! Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", 2018; Benthin, Meister, Barczak, Mehalwal,
//! Tsakok and Kensler, "H-PLOC: Hierarchical Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", 2024, for merging within
//! growing pieces of the order, so that all is done in the fastest memory. Departures: pieces are halves of the order; triangles are
//! merged to leaves first; of equal distances the one between numbers whose lowest bits differ counts, which makes balanced trees of equal boxes.
//!
//! Cost: O(n) after the sort.

mod emit;
mod work;

use super::{Child, MAX_DEPTH, Settings, Siblings, Topology, bounds::PrimRef, morton::Order};
use crate::simd::{Simd, SimdLevel, Task, dispatch};
use emit::{Emitter, Target};
use work::Work;

/// Triangles of the smallest pieces.
const PIECE: usize = 64;

/// Clusters that a piece leaves to be merged with those of its neighbour.
const LEFT: usize = 16;

/// Triangles of a task's piece.
const TASK: usize = 128 * PIECE;

/// A subtree that is still to be merged.
#[derive(Clone, Copy, Debug)]
struct Cluster {
    low: [f32; 3],
    high: [f32; 3],
    prims: u32,
    rest: Rest,
}

/// What a search does not need of a cluster.
#[derive(Clone, Copy, Debug)]
struct Rest {
    area: f32,
    /// Expected cost of testing it, relative to a traversal step at a box of area 1.
    cost: f32,
    child: Child,
    pairs: u32,
    /// Most pairs on a path down.
    height: u32,
}

impl Rest {
    const NONE: Self = Self { area: 0.0, cost: 0.0, child: Child::None, pairs: 0, height: 0 };
}

/// A pair whose place is not yet known.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Merger {
    /// Its children: their first places and numbers of triangles for leaves, mergers by their number and 0 else.
    children: [[u32; 2]; 2],
    area: f32,
    axis: u16,
    /// 1 when the children are to be one leaf.
    is_leaf: u16,
    /// What is below the first child.
    pairs: u32,
    prims: u32,
}

/// Words of a [`Merger`].
const WORDS: usize = size_of::<Merger>() / 4;

const _: () = assert!(WORDS * 4 == size_of::<Merger>());

fn packed(child: Child) -> [u32; 2] {
    match child {
        Child::None => [0, 0],
        Child::Inner(number) => [number, 0],
        Child::Leaf { first, count } => [first, count],
    }
}

fn unpacked([first, count]: [u32; 2]) -> Child {
    if count == 0 { Child::Inner(first) } else { Child::Leaf { first, count } }
}

/// Mergers that are made of what the pieces of two tasks leave, at most.
const SLACK: usize = 2 * LEFT;

/// Places for the mergers over so many triangles: fewer than those for each task, and those of what it leaves.
fn slots(count: usize) -> usize {
    count + SLACK * count.div_ceil(TASK)
}

/// Builds the topology; `None` without triangles, and where a path would be too long.
pub(super) fn build(refs: &[PrimRef], settings: &Settings) -> Option<Topology> {
    let count = refs.len();
    if count == 0 {
        return None;
    }
    let builder = Builder { settings, refs, curve: &Order::new(refs) };
    let mut leaves = vec![0; count];
    // Zeros come from the system when they are first needed, which for most of these is never.
    let mut words = vec![0_u32; slots(count) * WORDS];
    let mergers: &mut [Merger] = bytemuck::cast_slice_mut(&mut words);
    let mut clusters = builder.range(0, &mut leaves, Slots { mergers: &mut *mergers, first: 0 });
    let free = mergers.len() - SLACK;
    builder.merge(&mut clusters, 1, Slots { mergers: &mut mergers[free..], first: free });
    let root = *clusters.first()?;
    let root = root.rest;
    if root.height as usize > MAX_DEPTH {
        return None;
    }
    let mut pairs = vec![Siblings::NONE; root.pairs as usize];
    let mut prims = vec![0; count];
    let emitter = Emitter { leaves: &leaves, mergers };
    let child = emitter.emit(root.child, Target { pairs: &mut pairs, prims: &mut prims, pair: 0, first: 0 });
    if !matches!(child, Child::Inner(_)) {
        pairs = vec![Siblings { children: [child, Child::None], area: root.area, axis: 0 }];
    }
    Some(Topology { pairs, prims })
}

/// Places for mergers, the first with this number.
struct Slots<'a> {
    mergers: &'a mut [Merger],
    first: usize,
}

struct Builder<'a> {
    settings: &'a Settings,
    refs: &'a [PrimRef],
    curve: &'a Order,
}

impl Builder<'_> {
    /// The clusters that are left of the triangles from a place of the order on; `leaves` is that part of their final order.
    fn range(&self, first: usize, leaves: &mut [u32], slots: Slots<'_>) -> Vec<Cluster> {
        let count = leaves.len();
        if count <= TASK {
            return dispatch(SimdLevel::best(), Pieces { builder: self, first, leaves, slots });
        }
        let half = (count / 2).next_multiple_of(TASK);
        let (leaves0, leaves1) = leaves.split_at_mut(half);
        let middle = slots.first + self::slots(half);
        let (mergers0, mergers1) = slots.mergers.split_at_mut(self::slots(half));
        let (mut clusters, others) = rayon::join(
            || self.range(first, leaves0, Slots { mergers: &mut *mergers0, first: slots.first }),
            || self.range(first + half, leaves1, Slots { mergers: mergers1, first: middle }),
        );
        clusters.extend_from_slice(&others);
        // Each end of a task's places but the last serves for one merge.
        let free = mergers0.len() - SLACK;
        let slots = Slots { mergers: &mut mergers0[free..], first: slots.first + free };
        self.merge(&mut clusters, LEFT, slots);
        clusters
    }

    /// Merges until at most so many clusters are left.
    fn merge(&self, clusters: &mut Vec<Cluster>, left: usize, slots: Slots<'_>) {
        dispatch(SimdLevel::best(), Merge { settings: self.settings, clusters, left, slots });
    }
}

/// Merges the clusters of two pieces.
struct Merge<'a> {
    settings: &'a Settings,
    clusters: &'a mut Vec<Cluster>,
    left: usize,
    slots: Slots<'a>,
}

impl Task for Merge<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut work = Work::new(self.settings, self.slots);
        work.load(self.clusters, 0);
        work.merge(self.left);
        work.store(self.clusters);
    }
}

/// Merges what is below a task.
struct Pieces<'a> {
    builder: &'a Builder<'a>,
    first: usize,
    leaves: &'a mut [u32],
    slots: Slots<'a>,
}

impl Task for Pieces<'_> {
    type Output = Vec<Cluster>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Cluster> {
        let Self { builder, first, leaves, slots } = self;
        let mut work = Work::new(builder.settings, slots);
        let mut clusters = Vec::with_capacity(2 * PIECE);
        let mut starts = Vec::with_capacity(2 * PIECE);
        let pieces = leaves.len().div_ceil(PIECE);
        for piece in 0..pieces {
            let start = piece * PIECE;
            let end = leaves.len().min(start + PIECE);
            work.take(builder, first + start, end - start);
            work.merge_leaves(&mut leaves[start..end], first + start);
            work.merge(LEFT);
            starts.push(clusters.len());
            work.store(&mut clusters);
            // As many pieces of equal size end here as the number of pieces so far is even.
            let merges = if piece + 1 == pieces { starts.len() - 1 } else { (piece + 1).trailing_zeros() as usize };
            for _ in 0..merges {
                starts.pop();
                work.load(&mut clusters, starts[starts.len() - 1]);
                work.merge(LEFT);
                work.store(&mut clusters);
            }
        }
        clusters
    }
}

#[cfg(test)]
mod tests;
