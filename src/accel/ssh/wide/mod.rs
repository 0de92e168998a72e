//! The wide form: eight children a node, tested at once, with three or four planes of each child's box.
//!
//! Every child has one plane on each axis, an upper or a lower one; the fourth is the other side of one axis. What is not stored is inherited, as in the binary
//! form: a ray keeps the segment that lies within all planes passed so far. A node takes 128 or 192 bytes. Leaves are runs of blocks as in `bvh2`.

mod kernel;
mod node;
mod packet;
mod refit;
mod validate;

use super::{Sides, SshConfig, refit::Measured};
use crate::{
    accel::{
        Accel, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
        block::TriBlock,
        check_indices,
        lineage::{self, Lineage, Refittable},
        sah,
        topology::{self, Child, wide::collapse},
        wide::{Place, Tree, WIDTH, packet as wide_packet, refit::Subtree},
    },
    geom::{Aabb, Triangles},
    simd::Simd,
};
use node::{MAX_TRIANGLES, Node, Word};

/// A built tree with `K` planes a child, 3 or 4.
#[derive(Debug)]
pub(super) struct Wide<const K: usize> {
    nodes: Vec<Node<K>>,
    blocks: Vec<TriBlock>,
    /// Blocks of the leaf that begins at a block; empty while no leaf has more than one.
    spans: Vec<u8>,
    /// The boxes of all children while sides are chosen; kept only when refits choose.
    boxes: Vec<[Aabb; WIDTH]>,
    bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    reach: f32,
    config: SshConfig,
    lineage: Lineage,
    measured: Measured,
    own_area: f64,
}

impl<const K: usize> Clone for Wide<K> {
    fn clone(&self) -> Self {
        Self {
            nodes: self.nodes.clone(),
            blocks: self.blocks.clone(),
            spans: self.spans.clone(),
            boxes: self.boxes.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, source: &Self) {
        let none = Self { nodes: Vec::new(), blocks: Vec::new(), spans: Vec::new(), boxes: Vec::new(), ..*source };
        let mut old = std::mem::replace(self, none);
        old.nodes.clone_from(&source.nodes);
        old.blocks.clone_from(&source.blocks);
        old.spans.clone_from(&source.spans);
        old.boxes.clone_from(&source.boxes);
        let Self { nodes, blocks, spans, boxes, .. } = old;
        (self.nodes, self.blocks, self.spans, self.boxes) = (nodes, blocks, spans, boxes);
    }
}

impl<const K: usize> Tree for Wide<K> {
    type Node = Node<K>;

    #[inline(always)]
    fn reach(&self) -> f32 {
        self.reach
    }

    #[inline(always)]
    fn node(&self, number: usize) -> &Node<K> {
        &self.nodes[number]
    }

    #[inline(always)]
    fn span(&self, word: Word) -> usize {
        span(&self.spans, word.index())
    }

    #[inline(always)]
    fn block<'a, C: Counter>(
        &'a self,
        (word, i): (Word, usize),
        _prims: &Triangles<'_>,
        _room: &'a mut TriBlock,
        count: &mut C,
    ) -> &'a TriBlock {
        let block = &self.blocks[word.index() + i];
        block.prims().for_each(|_| count.prim());
        block
    }
}

impl<const K: usize> Wide<K> {
    pub(super) fn useless_planes(&self) -> usize {
        self.measured.useless
    }

    /// Makes blocks and nodes over a wide topology.
    fn emit(&mut self, topology: &[[Child; WIDTH]], order: &[u32]) {
        for children in topology {
            let mut node = Node::new();
            for (slot, child) in children.iter().enumerate() {
                if let Child::Inner(below) = *child {
                    node.set_word(slot, Word::inner(below as usize));
                }
            }
            self.nodes.push(node);
        }
        self.number_blocks(topology, order, 0);
        if self.spans.iter().all(|&span| span <= 1) {
            self.spans = Vec::new();
        }
    }

    /// Makes the blocks of all leaves below a node, depth first.
    #[expect(clippy::cast_possible_truncation, reason = "a leaf has few blocks")]
    fn number_blocks(&mut self, topology: &[[Child; WIDTH]], order: &[u32], number: usize) {
        for (slot, child) in topology[number].iter().enumerate() {
            match *child {
                Child::None => {}
                Child::Inner(below) => self.number_blocks(topology, order, below as usize),
                Child::Leaf { first, count } => {
                    let place = self.blocks.len();
                    self.blocks.extend(TriBlock::of(&order[first as usize..][..count as usize]));
                    self.spans.resize(self.blocks.len(), 0);
                    self.spans[place] = (self.blocks.len() - place) as u8;
                    self.nodes[number].set_word(slot, Word::leaf(place));
                }
            }
        }
    }

    /// Takes new positions into the tree; `choose` chooses the sides anew.
    fn take_positions(&mut self, prims: &Triangles<'_>, choose: bool) {
        let Self { nodes, blocks, spans, boxes, config, .. } = self;
        let spans = &spans[..];
        let own = |word: Word| word.index()..word.index() + span(spans, word.index());
        let leaf_planes = config.leaf_planes;
        if choose {
            boxes.resize(nodes.len(), [Aabb::EMPTY; WIDTH]);
            let store = refit::Boxes { own: boxes, first: 0 };
            let swept = Subtree { nodes, items: blocks, first_node: 0, first_item: 0, store, own }.refit(prims);
            self.own_area = swept.own_area;
            self.bounds = swept.aabb;
            self.measured = refit::rechoose(nodes, boxes, 0, &swept.aabb, spans, leaf_planes);
        } else {
            let store = refit::Keep { leaf_planes };
            let swept = Subtree { nodes, items: blocks, first_node: 0, first_item: 0, store, own }.refit(prims);
            self.own_area = swept.own_area;
            self.bounds = swept.aabb;
            self.measured = refit::measure(nodes, 0, &swept.aabb, spans, 0);
        }
        if self.config.refit == Sides::Keep {
            self.boxes = Vec::new();
        }
        self.reach = self.bounds.reach();
    }

    /// Expected cost of a ray, in units of the triangles' own area.
    fn cost(&self) -> f64 {
        if self.own_area > 0.0 { self.measured.cost / self.own_area } else { 0.0 }
    }

    fn depth(&self) -> usize {
        let mut depths = vec![0_usize; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            let below = node.words().map(|w| if w.is_leaf() { 1 } else { depths[w.index()] });
            depths[i] = 1 + below.max().unwrap_or(0);
        }
        depths[0]
    }
}

/// Blocks of the leaf that begins at a block.
#[inline(always)]
fn span(spans: &[u8], first: usize) -> usize {
    if spans.is_empty() { 1 } else { usize::from(spans[first]) }
}

impl<const K: usize> Refittable for Wide<K> {
    fn lineage(&self) -> &Lineage {
        &self.lineage
    }

    fn retake(&mut self, prims: &Triangles<'_>) {
        self.take_positions(prims, self.config.refit == Sides::Rechoose);
    }
}

impl<const K: usize> Accel for Wide<K> {
    const NAME: &'static str = "ssh";
    type Config = SshConfig;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &SshConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_TRIANGLES)?;
        let settings = topology::Settings { cut: config.build, bins: config.bins, leaf: config.leaf };
        let binary = topology::build(prims, &settings);
        let mut out = Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            spans: Vec::new(),
            boxes: Vec::new(),
            bounds: Aabb::EMPTY,
            reach: 0.0,
            config: *config,
            lineage: Lineage::new(prims),
            measured: Measured::default(),
            own_area: 0.0,
        };
        out.emit(&collapse(&binary), &binary.prims);
        out.take_positions(prims, true);
        out.lineage.set_fresh_cost(out.cost());
        Ok(out)
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        lineage::refit_into(self, out, prims)
    }

    #[inline(always)]
    fn closest<S: Simd, C: Counter, K2: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K2,
        count: &mut C,
    ) {
        self.walk_closest::<S, C, K2>((ray, prims), best, sink, count);
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K2: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K2,
        count: &mut C,
    ) -> bool {
        self.walk_occluded::<S, C, K2>((ray, prims), sink, count)
    }

    #[inline(always)]
    fn closest_packet<S: Simd, C: Counter, K2: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K2],
        count: &mut C,
    ) {
        wide_packet::closest_packet::<S, Self, C, K2>(self, prims, rays, active, best, sinks, count);
    }

    #[inline(always)]
    fn occluded_packet<S: Simd, C: Counter, K2: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        sinks: &[K2],
        count: &mut C,
    ) -> u32 {
        wide_packet::occluded_packet::<S, Self, C, K2>(self, prims, rays, active, sinks, count)
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        validate::validate(self, prims).map_err(Violation)
    }

    fn stats(&self) -> AccelStats {
        let leaves = self.nodes.iter().flat_map(Node::words).filter(|w| w.is_leaf() && !w.is_none()).count();
        let node_bytes = size_of_val(&self.nodes[..]);
        let other = size_of_val(&self.blocks[..]) + self.spans.len() + size_of_val(&self.boxes[..]);
        let root = sah::half_area(self.bounds);
        AccelStats {
            nodes: self.nodes.len() + leaves,
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

#[cfg(test)]
mod tests;
