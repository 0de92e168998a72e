//! The form of the paper: a binary tree with one plane a node.

use super::{
    Sides, SshConfig, build,
    node::{MAX_TRIANGLES, Pair, Word},
    refit::{self, Blocks, Boxes, Keep, Leaves, Measured, Slots, Store, Subtree, Swept},
    validate,
};
use crate::{
    accel::{
        Accel, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
        block::TriBlock,
        check_indices,
        lineage::{self, Lineage, Refittable},
        sah, topology,
    },
    geom::{Aabb, Triangles},
    simd::Simd,
};

/// A built hierarchy.
#[derive(Debug)]
pub(super) struct Narrow {
    pub(super) root: Word,
    pub(super) pairs: Vec<Pair>,
    pub(super) blocks: Vec<TriBlock>,
    /// Blocks of the leaf that begins at a block; empty while no leaf has more than one.
    pub(super) spans: Vec<u8>,
    /// The boxes of all nodes while sides are chosen; kept only when refits choose.
    pub(super) boxes: Vec<[Aabb; 2]>,
    pub(super) bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    pub(super) reach: f32,
    /// Leaves are lanes of blocks.
    pub(super) packed: bool,
    pub(super) config: SshConfig,
    pub(super) lineage: Lineage,
    pub(super) measured: Measured,
    pub(super) own_area: f64,
}

impl Clone for Narrow {
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

impl Narrow {
    /// Planes that take nothing off the box inherited from above: they cost a test and cull nothing.
    pub(super) fn useless_planes(&self) -> usize {
        self.measured.useless
    }

    /// Blocks of the leaf that begins at a block.
    #[inline(always)]
    pub(super) fn span(&self, first: usize) -> usize {
        if self.spans.is_empty() { 1 } else { usize::from(self.spans[first]) }
    }

    /// Blocks of a leaf, and which lane is its own where leaves share blocks; its triangles are counted.
    #[inline(always)]
    pub(super) fn leaf_blocks<C: Counter>(&self, word: Word, count: &mut C) -> (&[TriBlock], Option<usize>) {
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
        self.reach = self.bounds.reach();
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

impl Refittable for Narrow {
    fn lineage(&self) -> &Lineage {
        &self.lineage
    }

    fn retake(&mut self, prims: &Triangles<'_>) {
        self.take_positions(prims, self.config.refit == Sides::Rechoose);
    }
}

impl Accel for Narrow {
    const NAME: &'static str = "ssh";
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
            lineage: Lineage::new(prims),
            measured: Measured::default(),
            own_area: 0.0,
        };
        out.take_positions(prims, true);
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
        self.lineage.decay(self.cost())
    }
}
