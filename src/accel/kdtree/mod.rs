//! Kd-tree with 8-byte nodes.
//!
//! Splits follow the surface-area heuristic with a bonus for cutting off empty space, and cut triangles, not their boxes, by default. A leaf
//! owns blocks of four triangles with their corners, so a triangle in several leaves is stored as often. Rays walk with a stack of
//! intervals (Ericson's and Havran's "interval" form); crossings are bounded on both sides, so no leaf is lost to rounding (see `traverse.rs`).
//!
//! Cost: build O(n log n), in the current rayon pool; memory linear in n (see `build.rs`). It cannot be refitted: every change of
//! positions or topology asks for a rebuild. Choose it for static geometry, and as what `grug` is measured against.
//!
//! # Source
//! Havran, "Heuristic Ray Shooting Algorithms", 2000 (traversal); Wald and Havran, "On building fast kd-trees for Ray Tracing, and on doing that
//! in O(N log N)", 2006 (costs, clipping).

pub(super) mod build;
pub(super) mod node;
pub(super) mod split;
pub(super) mod traverse;
pub(super) mod validate;

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation, Visitor,
    block::TriBlock,
    check_indices,
    leaves::{ByPointer, ClosestLeaves, Leaves, Line, Objects, OccludedLeaves, RareCounter, RareLeaves, pack},
    sah::{BLOCK, half_area},
    shapes::Shapes,
};
use crate::{
    geom::{Aabb, Triangles},
    simd::Simd,
};
use build::{Builder, Emitted, MAX_DEPTH, Params, Task};
use node::{KdNode, MAX_NUMBER};
use split::{Costs, MAX_BINS};
use traverse::{Fast, Wide};

/// Most objects: with every reference and split that [`build::room`] allows, nodes and units can still be numbered.
pub(super) const MAX_OBJECTS: usize = MAX_NUMBER / 34;

/// Build settings of `kdtree`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KdConfig {
    /// Bins an axis where many objects are split, 2 to 256.
    pub bins: usize,
    /// Cost of testing a block of four triangles, where passing a node costs 1; above 0, at most 1000.
    pub block_cost: f64,
    /// What a split that cuts off empty space saves beyond its areas: 0 to 1 of the cost below it.
    pub empty_bonus: f64,
    /// Cut triangles at splits; otherwise their boxes are cut.
    pub clip: bool,
}

impl Default for KdConfig {
    fn default() -> Self {
        Self { bins: 64, block_cost: 8.0, empty_bonus: 0.1, clip: true }
    }
}

impl KdConfig {
    /// `unit` objects are tested at once.
    pub(super) fn params(&self, unit: usize) -> Params {
        let costs = Costs { unit: self.block_cost, objects: unit, empty_bonus: self.empty_bonus };
        Params { costs, bins: self.bins, clip: self.clip }
    }
}

impl AccelConfig for KdConfig {
    const KEYS: &'static [&'static str] = &["bins", "block_cost", "empty_bonus", "clip"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let number = |low: f64, high: f64| {
            let found = value.parse::<f64>().ok().filter(|n| (low..=high).contains(n));
            found.ok_or_else(|| format!("`{value}` is not a number from {low} to {high}"))
        };
        match key {
            "bins" => {
                let bins = value.parse().ok().filter(|n| (2..=MAX_BINS).contains(n));
                self.bins = bins.ok_or_else(|| format!("`{value}` is not a number from 2 to {MAX_BINS}"))?;
            }
            "block_cost" => self.block_cost = number(0.001, 1000.0)?,
            "empty_bonus" => self.empty_bonus = number(0.0, 1.0)?,
            _ => self.clip = on_or_off(value)?,
        }
        Ok(())
    }
}

/// A switch's value.
pub(super) fn on_or_off(value: &str) -> Result<bool, String> {
    match value {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(format!("`{value}` is neither `on` nor `off`")),
    }
}

/// The tree alone, without what its leaves own.
#[derive(Clone, Debug)]
struct Tree {
    nodes: Vec<KdNode>,
    bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    reach: f32,
}

impl Tree {
    /// The tree and the objects of its leaves, `unit` to a unit.
    fn build(shapes: &(impl Shapes + ?Sized), config: &KdConfig, unit: usize) -> (Self, Vec<u32>) {
        let refs = build::refs(shapes);
        let bounds = build::bounds(&refs);
        let count = refs.len();
        let task = Task {
            refs,
            cell: bounds,
            depth: build::depth_limit(count),
            levels: MAX_DEPTH - 1,
            room: build::room(count),
        };
        let mut out = Emitted::default();
        Builder { shapes, params: config.params(unit), unit }.emit(task, &mut out);
        (Self { nodes: out.nodes, bounds, reach: bounds.reach() }, out.items)
    }

    #[inline(always)]
    fn walk<L: Leaves, C: Counter>(&self, ray: &TravRay, leaves: &mut L, count: &mut C) -> bool {
        let line = Line::new(ray.range());
        let Some(interval) = line.clip_to(&self.bounds, leaves.t_limit()) else { return false };
        if traverse::is_ordinary(ray, self.reach) {
            traverse::walk(&self.nodes, 0, traverse::outward(interval), &Fast::new(ray), leaves, count)
        } else {
            self.walk_wide(&line, interval, leaves.rare(), count)
        }
    }

    #[cold]
    #[inline(never)]
    fn walk_wide(
        &self,
        line: &Line,
        interval: (f64, f64),
        leaves: &mut dyn RareLeaves,
        count: &mut dyn Counter,
    ) -> bool {
        traverse::walk(&self.nodes, 0, interval, &Wide(line), &mut ByPointer(leaves), &mut RareCounter(count))
    }

    fn stats(&self, unit_cost: f64) -> AccelStats {
        let mut stats = AccelStats { nodes: self.nodes.len(), ..AccelStats::default() };
        stats.node_bytes = size_of_val(&self.nodes[..]);
        let root = half_area(self.bounds);
        let mut stack = vec![(0, self.bounds, 1)];
        while let Some((at, cell, depth)) = stack.pop() {
            let node = self.nodes[at];
            let part = if root > 0.0 { half_area(cell) / root } else { 0.0 };
            stats.depth = stats.depth.max(depth);
            if node.is_leaf() {
                stats.leaves += 1;
                stats.sah_cost += part * unit_cost * node.units().len() as f64;
            } else {
                stats.sah_cost += part;
                let (mut below, mut above) = (cell, cell);
                below.max[node.axis()] = node.split();
                above.min[node.axis()] = node.split();
                stack.extend([(at + 1, below, depth + 1), (node.upper(), above, depth + 1)]);
            }
        }
        stats
    }
}

/// A kd-tree over plain boxes, which leaves the objects to a [`Visitor`].
#[derive(Clone, Debug)]
pub struct BoxKdTree {
    tree: Tree,
    items: Vec<u32>,
}

impl BoxKdTree {
    /// Builds over `boxes`, in the current rayon pool; an object's number is its place there. Boxes that are empty or not finite are never
    /// visited. [`KdConfig::block_cost`] is the cost of one object.
    ///
    /// # Errors
    /// More boxes than can be numbered.
    pub fn build(boxes: &[Aabb], config: &KdConfig) -> Result<Self, BuildError> {
        let error = BuildError::TooMany { structure: KdTree::NAME, limit: MAX_OBJECTS, actual: boxes.len() };
        if boxes.len() > MAX_OBJECTS {
            return Err(error);
        }
        let (tree, items) = Tree::build(boxes, config, 1);
        Ok(Self { tree, items })
    }

    /// Visits the objects whose boxes the ray may meet, roughly front to back, some several times; true when a visit ended the walk.
    #[inline(always)]
    pub fn walk<V: Visitor, C: Counter>(&self, ray: &TravRay, visitor: &mut V, count: &mut C) -> bool {
        self.tree.walk(ray, &mut Objects { items: &self.items, visitor }, count)
    }

    /// Size and quality; O(nodes).
    pub fn stats(&self) -> AccelStats {
        let stats = self.tree.stats(1.0);
        AccelStats { total_bytes: size_of::<Self>() + stats.node_bytes + size_of_val(&self.items[..]), ..stats }
    }
}

/// A built kd-tree over triangles.
#[derive(Clone, Debug)]
pub struct KdTree {
    tree: Tree,
    blocks: Vec<TriBlock>,
    prim_count: usize,
    block_cost: f64,
}

impl Accel for KdTree {
    const NAME: &'static str = "kdtree";
    const NODE_FORMAT: &'static str = "split planes";
    type Config = KdConfig;
    const REFITS: bool = false;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &KdConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_OBJECTS)?;
        let (tree, items) = Tree::build(prims, config, BLOCK);
        let blocks = pack(&items, prims);
        Ok(Self { tree, blocks, prim_count: prims.len(), block_cost: config.block_cost })
    }

    /// Always [`Refit::NeedsRebuild`]: splits do not follow the triangles they cut.
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
        self.tree.walk(ray, &mut ClosestLeaves::<S, K>::new(&self.blocks, self.tree.reach, ray, best, sink), count);
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        _prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        self.tree.walk(ray, &mut OccludedLeaves::<S, K>::new(&self.blocks, self.tree.reach, ray, sink), count)
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        validate::validate(self, prims).map_err(Violation)
    }

    fn stats(&self) -> AccelStats {
        let stats = self.tree.stats(self.block_cost);
        AccelStats { total_bytes: size_of::<Self>() + stats.node_bytes + size_of_val(&self.blocks[..]), ..stats }
    }

    fn bounds(&self) -> Aabb {
        self.tree.bounds
    }
}
