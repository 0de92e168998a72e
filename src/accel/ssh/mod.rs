//! Single slab hierarchy: a binary tree whose nodes keep one plane of their box, in 8 bytes.
//!
//! # Source
//! Eisemann, Woizischke and Magnor, "Ray Tracing with the Single Slab Hierarchy", 2008. A ray keeps the segment that lies within all planes passed so
//! far; a node cuts it at one end. Departures: the cases of the paper's figure 4 stand the other way round, as its text and the geometry demand; a
//! leaf tells itself by its order axis, so that it can have a plane; indices count pairs, which doubles what 27 bits reach; rays are cut with
//! the root's box first, and the root has no node.
//!
//! The topology is that of `bvh2` with the same settings, so nodes take exactly a quarter of its bytes. Leaves are runs of blocks of four triangles
//! as there; with one triangle a leaf, four leaves share a block. Pairs and blocks stand in depth-first order: a subtree owns a contiguous run of
//! each, and subtrees are refitted in parallel without sharing.
//!
//! Before the exact test of a leaf's triangles their own boxes are tested, taken from the corners in the block: planes alone lead rays to three times
//! the leaves.
//!
//! Cost: build O(n log n), refit O(n) on the current rayon pool. A ray visits two to three times the nodes of `bvh2` and takes 1.1 to 2.3 times as long
//! (`benches/records/2026-11-22-ssh.md`). Choose it where the memory of nodes counts.

mod build;
mod choose;
mod node;
mod packet;
mod refit;
mod traverse;
mod validate;

use std::sync::atomic::{AtomicU64, Ordering};

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
    block::TriBlock,
    check_indices, sah,
    topology::{self, Cut},
};
use crate::{
    geom::{Aabb, Triangles},
    simd::Simd,
};
use node::{MAX_TRIANGLES, Pair, Word};
use refit::{Blocks, Boxes, Keep, Leaves, Measured, Slots, Store, Subtree, Swept};

/// Tells topologies apart: structures with equal numbers differ in planes and corners only.
static NEXT_TOPOLOGY: AtomicU64 = AtomicU64::new(0);

/// A built hierarchy.
#[derive(Debug)]
pub struct Ssh {
    root: Word,
    pairs: Vec<Pair>,
    blocks: Vec<TriBlock>,
    /// Blocks of the leaf that begins at a block; empty while no leaf has more than one.
    spans: Vec<u8>,
    /// The boxes of all nodes while sides are chosen; kept only when refits choose.
    boxes: Vec<[Aabb; 2]>,
    bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    reach: f32,
    /// Leaves are lanes of blocks.
    packed: bool,
    config: SshConfig,
    topology: u64,
    topology_epoch: u64,
    prim_count: usize,
    position_count: usize,
    measured: Measured,
    own_area: f64,
    /// Expected cost of a ray per own area of the triangles, right after the build.
    fresh_cost: f64,
}

impl Clone for Ssh {
    fn clone(&self) -> Self {
        Self {
            pairs: self.pairs.clone(),
            blocks: self.blocks.clone(),
            spans: self.spans.clone(),
            boxes: self.boxes.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, source: &Self) {
        let mut old = std::mem::replace(
            self,
            Self { pairs: Vec::new(), blocks: Vec::new(), spans: Vec::new(), boxes: Vec::new(), ..*source },
        );
        old.pairs.clone_from(&source.pairs);
        old.blocks.clone_from(&source.blocks);
        old.spans.clone_from(&source.spans);
        old.boxes.clone_from(&source.boxes);
        let Self { pairs, blocks, spans, boxes, .. } = old;
        (self.pairs, self.blocks, self.spans, self.boxes) = (pairs, blocks, spans, boxes);
    }
}

/// What a refit does with the sides that nodes keep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// They stay; planes move.
    #[default]
    Keep,
    /// They are chosen anew, in a second pass from the top. Takes 48 bytes a pair of nodes beside the structure.
    Rechoose,
}

/// Build settings of `ssh`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SshConfig {
    /// How nodes are cut.
    pub build: Cut,
    /// Bins an axis, 2 to 64.
    pub bins: usize,
    /// Most triangles in a leaf, 1 to 32.
    pub leaf: usize,
    /// Leaves have planes, not only inner nodes.
    pub leaf_planes: bool,
    /// What a refit does with the sides.
    pub refit: Sides,
}

impl Default for SshConfig {
    fn default() -> Self {
        Self { build: Cut::Sah, bins: 16, leaf: sah::BLOCK, leaf_planes: true, refit: Sides::Keep }
    }
}

impl AccelConfig for SshConfig {
    const KEYS: &'static [&'static str] = &["build", "bins", "leaf", "leaf_planes", "refit"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "build" => self.build = topology::parse_cut(value)?,
            "bins" => self.bins = topology::parse_bins(value)?,
            "leaf" => self.leaf = topology::parse_leaf(value)?,
            "leaf_planes" => self.leaf_planes = named(value, [("on", true), ("off", false)])?,
            _ => self.refit = named(value, [("keep", Sides::Keep), ("rechoose", Sides::Rechoose)])?,
        }
        Ok(())
    }
}

/// The value of one of two names.
fn named<T: Copy>(value: &str, names: [(&str, T); 2]) -> Result<T, String> {
    let found = names.iter().find(|(name, _)| *name == value);
    found.map(|(_, value)| *value).ok_or_else(|| format!("`{value}` is not one of {}, {}", names[0].0, names[1].0))
}

impl Ssh {
    /// Planes that take nothing off the box inherited from above: they cost a test and cull nothing.
    pub fn useless_planes(&self) -> usize {
        self.measured.useless
    }

    /// Blocks of the leaf that begins at a block.
    #[inline(always)]
    fn span(&self, first: usize) -> usize {
        if self.spans.is_empty() { 1 } else { usize::from(self.spans[first]) }
    }

    /// Blocks of a leaf, and which lane is its own where leaves share blocks; its triangles are counted.
    #[inline(always)]
    fn leaf_blocks<C: Counter>(&self, word: Word, count: &mut C) -> (&[TriBlock], Option<usize>) {
        let place = word.index();
        if self.packed {
            count.prim();
            return (std::slice::from_ref(&self.blocks[place / sah::BLOCK]), Some(place % sah::BLOCK));
        }
        let blocks = &self.blocks[place..place + self.span(place)];
        for block in blocks {
            block.prims().for_each(|_| count.prim());
        }
        (blocks, None)
    }

    /// Takes new positions into the tree; `choose` chooses the sides anew.
    fn take_positions(&mut self, prims: &Triangles<'_>, choose: bool) {
        let Self { pairs, blocks, spans, boxes, config, .. } = self;
        let leaf_planes = config.leaf_planes;
        if choose {
            boxes.resize(pairs.len(), [Aabb::EMPTY; 2]);
        }
        let keep = Keep { leaf_planes };
        let swept = if self.packed {
            refit::refit_blocks(blocks, prims);
            sweep(pairs, Slots(blocks), choose.then_some(boxes), keep, prims)
        } else {
            let leaves = Blocks { own: blocks, spans, first: 0 };
            sweep(pairs, leaves, choose.then_some(boxes), keep, prims)
        };
        self.measured = if choose {
            refit::rechoose(pairs, boxes, 0, &swept.aabb, spans, leaf_planes)
        } else {
            refit::measure(pairs, 0, &swept.aabb, spans, 0)
        };
        if config.refit == Sides::Keep {
            *boxes = Vec::new();
        }
        self.own_area = swept.own_area;
        self.bounds = swept.aabb;
        let reach = self.bounds.min.abs().max(self.bounds.max.abs()).max_element();
        self.reach = if self.bounds.is_empty() { 0.0 } else { reach };
    }

    /// Expected cost of a ray, in units of the triangles' own area.
    fn cost(&self) -> f64 {
        if self.own_area > 0.0 { self.measured.cost / self.own_area } else { 0.0 }
    }

    fn depth(&self) -> usize {
        let mut depths = vec![0_usize; self.pairs.len()];
        for (i, pair) in self.pairs.iter().enumerate().rev() {
            let below = pair.0.iter().map(|n| if n.word.is_leaf() { 1 } else { depths[n.word.index()] });
            depths[i] = 1 + below.max().unwrap_or(0);
        }
        depths[0]
    }
}

/// Carries boxes from the leaves upward: stored when there is a place for them, else into the planes that are there.
fn sweep<L: Leaves>(
    pairs: &mut [Pair],
    leaves: L,
    boxes: Option<&mut Vec<[Aabb; 2]>>,
    keep: Keep,
    prims: &Triangles<'_>,
) -> Swept {
    fn with<L: Leaves, B: Store>(pairs: &mut [Pair], leaves: L, store: B, prims: &Triangles<'_>) -> Swept {
        Subtree { pairs, first: 0, leaves, store }.refit(prims)
    }
    match boxes {
        Some(boxes) => with(pairs, leaves, Boxes { own: boxes, first: 0 }, prims),
        None => with(pairs, leaves, keep, prims),
    }
}

impl Accel for Ssh {
    const NAME: &'static str = "ssh";
    const NODE_FORMAT: &'static str = "slabs";
    type Config = SshConfig;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &SshConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_TRIANGLES)?;
        let settings = topology::Settings { cut: config.build, bins: config.bins, leaf: config.leaf };
        let packed = config.leaf == 1;
        let emitted = build::build(prims, &settings, packed);
        let mut out = Self {
            root: emitted.root,
            pairs: emitted.pairs,
            blocks: emitted.blocks,
            spans: emitted.spans,
            boxes: Vec::new(),
            bounds: Aabb::EMPTY,
            reach: 0.0,
            packed,
            config: *config,
            topology: NEXT_TOPOLOGY.fetch_add(1, Ordering::Relaxed),
            topology_epoch: prims.topology_epoch,
            prim_count: prims.len(),
            position_count: prims.positions.len(),
            measured: Measured::default(),
            own_area: 0.0,
            fresh_cost: 0.0,
        };
        out.take_positions(prims, true);
        out.fresh_cost = out.cost();
        Ok(out)
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        let same = prims.topology_epoch == self.topology_epoch
            && prims.len() == self.prim_count
            && prims.positions.len() == self.position_count;
        if !same {
            return Refit::NeedsRebuild;
        }
        if out.topology != self.topology {
            out.clone_from(self);
        }
        out.take_positions(prims, self.config.refit == Sides::Rechoose);
        Refit::Done
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
        self.walk_closest::<S, C, K>(ray, best, sink, count);
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        _prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        self.walk_occluded::<S, C, K>(ray, sink, count)
    }

    #[inline(always)]
    fn closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        self.walk_closest_packet::<S, C, K>(prims, rays, active, best, sinks, count);
    }

    #[inline(always)]
    fn occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        self.walk_occluded_packet::<S, C, K>(prims, rays, active, sinks, count)
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        validate::validate(self, prims).map_err(Violation)
    }

    fn stats(&self) -> AccelStats {
        let leaves = self.pairs.iter().flat_map(|p| p.0).filter(|n| n.word.is_leaf() && !n.word.is_none()).count();
        let node_bytes = size_of_val(&self.pairs[..]);
        let other = size_of_val(&self.blocks[..]) + self.spans.len() + size_of_val(&self.boxes[..]);
        let root = sah::half_area(self.bounds);
        AccelStats {
            nodes: 2 * self.pairs.len(),
            leaves,
            depth: self.depth(),
            node_bytes,
            total_bytes: size_of::<Self>() + node_bytes + other,
            sah_cost: sah::COST_TRAVERSE + if root > 0.0 { self.measured.cost / root } else { 0.0 },
        }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn decay(&self) -> f64 {
        if self.fresh_cost > 0.0 { self.cost() / self.fresh_cost } else { 1.0 }
    }
}

#[cfg(test)]
mod tests;
