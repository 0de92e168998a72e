//! Grouped uniform grid: a table from grid cells to the nodes of a kd-tree where rays begin.
//!
//! The upper part of a kd-tree may split only at planes of a grid with a power of two of cells along each axis. Its leaves, the groups, are
//! all that is kept of it: a table of u32 leads from every cell to the group that covers it. Below, splits are free. A group's six bounds (24 bytes)
//! stand before its root, so that one pointer gives both. A ray looks up its cell, walks the group's tree, leaves by a bound and
//! looks up the next cell: `mode=dda` steps there cell by cell as in the paper, `mode=exit` goes at once; both read and hit the same.
//!
//! The bounds cost three times what the removed nodes took, whatever the scene ([`GrugBytes`]), and the table more than all else: choose it to
//! study memory reads, on static geometry. It cannot be refitted: every change of positions or topology asks for a rebuild.
//!
//! # Source
//! Steffen and Zambreno, "Design and Evaluation of a Hardware Accelerated Ray Tracing Data Structure", 2009. Departures: crossings are
//! recomputed in f64, not accumulated in integers (see `grid/lattice.rs`); the resolution follows the number of groups unless given.

mod build;
mod config;
mod table;
mod validate;
mod walk;

use super::{
    Accel, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
    block::TriBlock,
    check_indices,
    grid::lattice::Lattice,
    kdtree::node::{KdNode, MAX_NUMBER},
    leaves::{ClosestLeaves, OccludedLeaves, pack},
};
use crate::{
    geom::{Aabb, Triangles},
    simd::Simd,
};
use build::{BOUNDS, Built};
pub use config::{GrugConfig, StepMode};
pub use table::CellOrder;
use table::Hash;

/// Most objects: `n` of them allow `S = 16 n + 1024` splits (see [`kdtree::build::room`]), so at most `2 S + 1` nodes and `S + 1` bounds.
const MAX_OBJECTS: usize = MAX_NUMBER / 82;

/// A built structure over triangles.
#[derive(Clone, Debug)]
pub struct Grug {
    bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    reach: f32,
    lattice: Lattice,
    hash: Hash,
    mode: StepMode,
    /// Where the bounds of each cell's group begin in `nodes`.
    table: Vec<u32>,
    /// For every group its bounds, then its tree.
    nodes: Vec<KdNode>,
    /// Where each group's bounds begin in `nodes`, ascending; rays need the table only.
    groups: Vec<u32>,
    blocks: Vec<TriBlock>,
    prim_count: usize,
}

/// Memory in bytes, by the columns of the paper's figure 5.
///
/// A binary tree with g leaves has g - 1 inner nodes, so `full_tree - tree = 8 (g - 1)` and `boundary = 24 g`: the bounds always take three
/// times what removing the upper nodes saves, and 24 bytes more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GrugBytes {
    /// Nodes of the kd-tree before its upper part was removed.
    pub full_tree: usize,
    /// Nodes kept.
    pub tree: usize,
    /// Bounds of groups.
    pub boundary: usize,
    /// The table.
    pub hash: usize,
}

impl Grug {
    /// Cells along each axis.
    pub fn resolution(&self) -> u32 {
        self.lattice.cells[0]
    }

    /// Number of groups.
    pub fn groups(&self) -> usize {
        self.groups.len()
    }

    /// Memory by kind.
    pub fn bytes(&self) -> GrugBytes {
        let node = size_of::<KdNode>();
        let tree = (self.nodes.len() - BOUNDS * self.groups.len()) * node;
        GrugBytes {
            full_tree: tree + (self.groups.len() - 1) * node,
            tree,
            boundary: BOUNDS * self.groups.len() * node,
            hash: size_of_val(&self.table[..]),
        }
    }

    /// Depth and number of leaves of the tree at a node.
    fn measure(&self, at: usize) -> (usize, usize) {
        let node = self.nodes[at];
        if node.is_leaf() {
            return (1, 1);
        }
        let (below, above) = (self.measure(at + 1), self.measure(node.upper()));
        (1 + below.0.max(above.0), below.1 + above.1)
    }
}

impl Accel for Grug {
    const NAME: &'static str = "grug";
    const NODE_FORMAT: &'static str = "cells over split planes";
    type Config = GrugConfig;
    const REFITS: bool = false;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &GrugConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_OBJECTS)?;
        let Built { bounds, lattice, hash, table, nodes, items, groups } = build::build(prims, config);
        let blocks = pack(&items, prims);
        let (reach, prim_count) = (bounds.reach(), prims.len());
        Ok(Self { bounds, reach, lattice, hash, mode: config.mode, table, nodes, groups, blocks, prim_count })
    }

    /// Always [`Refit::NeedsRebuild`]: splits and groups do not follow the triangles they cut.
    fn refit_into(&self, _out: &mut Self, _prims: &Triangles<'_>) -> Refit {
        Refit::NeedsRebuild
    }

    #[inline(always)]
    fn closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        _prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        self.walk(ray, &mut ClosestLeaves::<S, K>::new(&self.blocks, self.reach, ray, best, sink), count);
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        _prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        self.walk(ray, &mut OccludedLeaves::<S, K>::new(&self.blocks, self.reach, ray, sink), count)
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        validate::validate(self, prims).map_err(Violation)
    }

    /// Node bytes hold trees, bounds and table; depth is that of the deepest tree.
    fn stats(&self) -> AccelStats {
        let (depth, leaves) = self.groups.iter().fold((0, 0), |(depth, leaves), &group| {
            let (d, l) = self.measure(group as usize + BOUNDS);
            (depth.max(d), leaves + l)
        });
        let GrugBytes { tree, boundary, hash, .. } = self.bytes();
        let node_bytes = tree + boundary + hash;
        AccelStats {
            nodes: tree / size_of::<KdNode>(),
            leaves,
            depth,
            node_bytes,
            total_bytes: size_of::<Self>() + node_bytes + size_of_val(&self.groups[..]) + size_of_val(&self.blocks[..]),
            sah_cost: 0.0,
        }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }
}
