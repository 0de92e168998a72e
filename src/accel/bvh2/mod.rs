//! Binary hierarchy of boxes with 32-byte nodes.
//!
//! Siblings share a 64-byte cache line in structure-of-arrays form and are tested at once; leaves are runs of blocks of
//! four triangles. Pairs and blocks stand in depth-first order, so that a subtree owns a contiguous run of each: refits
//! sweep backward over them, and subtrees are refitted in parallel without sharing.
//!
//! Cost: build O(n log n) and refit O(n) on the current rayon pool; a block takes 160 bytes. Choose it for few
//! triangles, for frequent refits, and as the measure of other structures.

mod build;
mod node;
mod packet;
mod refit;
mod traverse;
mod validate;

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
    block::TriBlock,
    check_indices,
    lineage::{self, Lineage, Refittable},
    sah,
    topology::{self, Cut, MAX_DEPTH, MAX_LEAF},
};
use crate::{
    geom::{Aabb, Triangles},
    simd::Simd,
};
use node::{Link, MAX_BLOCKS, Pair};
use refit::Swept;

/// A built hierarchy.
#[derive(Debug)]
pub struct Bvh2 {
    pairs: Vec<Pair>,
    blocks: Vec<TriBlock>,
    bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    reach: f32,
    lineage: Lineage,
    swept: Swept,
}

impl Clone for Bvh2 {
    fn clone(&self) -> Self {
        Self { pairs: self.pairs.clone(), blocks: self.blocks.clone(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        let (mut pairs, mut blocks) = (std::mem::take(&mut self.pairs), std::mem::take(&mut self.blocks));
        pairs.clone_from(&source.pairs);
        blocks.clone_from(&source.blocks);
        *self = Self { pairs, blocks, ..*source };
    }
}

/// Build settings of `bvh2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bvh2Config {
    /// How nodes are cut.
    pub build: Cut,
    /// Bins an axis, 2 to 64.
    pub bins: usize,
    /// Most triangles in a leaf, 1 to 32; leaves take whole blocks of four.
    pub leaf: usize,
}

impl Default for Bvh2Config {
    fn default() -> Self {
        Self { build: Cut::Sah, bins: 32, leaf: MAX_LEAF }
    }
}

impl AccelConfig for Bvh2Config {
    const KEYS: &'static [&'static str] = &["build", "bins", "leaf"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "build" => self.build = topology::parse_cut(value)?,
            "bins" => self.bins = topology::parse_bins(value)?,
            _ => self.leaf = topology::parse_leaf(value)?,
        }
        Ok(())
    }
}

impl Bvh2 {
    fn take_positions(&mut self, prims: &Triangles<'_>) {
        self.swept = refit::refit(&mut self.pairs, &mut self.blocks, prims);
        self.bounds = self.pairs[0].union();
        self.reach = self.bounds.reach();
    }

    /// Expected cost of a ray, in units of the triangles' own area. The root's area, which an explosion makes grow as
    /// well, does not enter.
    fn cost(&self) -> f64 {
        let Swept { cost, own_area } = self.swept;
        if own_area > 0.0 { cost / own_area } else { 0.0 }
    }

    /// Blocks of a leaf that has some; its triangles are counted.
    #[inline(always)]
    fn leaf_blocks<C: Counter>(&self, link: Link, count: &mut C) -> &[TriBlock] {
        let blocks = &self.blocks[link.leaf_blocks()];
        for block in blocks {
            block.prims().for_each(|_| count.prim());
        }
        blocks
    }

    fn depth(&self) -> usize {
        let mut depths = vec![0_usize; self.pairs.len()];
        for (i, pair) in self.pairs.iter().enumerate().rev() {
            let below = pair.links.iter().map(|l| if l.is_leaf() { 1 } else { depths[l.pair()] });
            depths[i] = 1 + below.max().unwrap_or(0);
        }
        depths[0]
    }
}

impl Refittable for Bvh2 {
    fn lineage(&self) -> &Lineage {
        &self.lineage
    }

    fn retake(&mut self, prims: &Triangles<'_>) {
        self.take_positions(prims);
    }
}

impl Accel for Bvh2 {
    const NAME: &'static str = "bvh2";
    type Config = Bvh2Config;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &Bvh2Config) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_BLOCKS)?;
        let settings = topology::Settings { cut: config.build, bins: config.bins, leaf: config.leaf };
        let emitted = build::build(prims, &settings);
        let mut out = Self {
            pairs: emitted.pairs,
            blocks: emitted.blocks,
            bounds: Aabb::EMPTY,
            reach: 0.0,
            lineage: Lineage::new(prims),
            swept: Swept::default(),
        };
        out.take_positions(prims);
        out.lineage.set_fresh_cost(out.cost());
        Ok(out)
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        lineage::refit_into(self, out, prims)
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
        let leaves = self.pairs.iter().flat_map(|p| p.links).filter(|l| l.is_leaf() && !l.blocks().is_empty()).count();
        let node_bytes = size_of_val(&self.pairs[..]);
        let root = sah::half_area(self.bounds);
        AccelStats {
            nodes: 2 * self.pairs.len(),
            leaves,
            depth: self.depth(),
            node_bytes,
            total_bytes: size_of::<Self>() + node_bytes + size_of_val(&self.blocks[..]),
            sah_cost: sah::COST_TRAVERSE + if root > 0.0 { self.swept.cost / root } else { 0.0 },
        }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn decay(&self) -> f64 {
        self.lineage.decay(self.cost())
    }
}
