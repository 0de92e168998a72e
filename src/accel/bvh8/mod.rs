//! Hierarchy of boxes with eight children a node, tested at once.
//!
//! A node holds its children's boxes in structure-of-arrays form and where they are, in 224 bytes. Leaves are runs of blocks of four triangles.
//! Nodes and blocks stand in depth-first order, so that a subtree owns a contiguous run of each: a refit takes new positions into both in one sweep
//! from the leaves upward, and subtrees are refitted in parallel without sharing.
//!
//! # Source
//! Wald, Benthin and Boulos, "Getting Rid of Packets", 2008, for nodes of many children against one ray; Ylitie, Karras and Laine, "Efficient Incoherent
//! Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, for the choice of the nodes. Departure: rays that lie close together go in packets, and of
//! many single rays several are in flight (`stream.rs`).
//!
//! Cost: build O(n log n) and refit O(n) on the current rayon pool; a block takes 160 bytes. Choose it for rays.

mod kernel;
mod node;
mod packet;
mod stream;
mod validate;

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
    block::TriBlock,
    check_indices,
    lineage::{self, Lineage, Refittable},
    sah,
    topology::{self, Child, Cut, wide::collapse},
    wide::{
        Place, Tree, WIDTH, coherent, packet as wide_packet,
        refit::{Store, Subtree},
    },
};
use crate::{
    geom::{Aabb, Forms, Hit, Ray, Triangles},
    simd::Simd,
};
use node::{Link, MAX_BLOCKS, Node};
use stream::{ClosestApart, OccludedApart};

/// A built hierarchy.
#[derive(Debug)]
pub struct Bvh8 {
    nodes: Vec<Node>,
    blocks: Vec<TriBlock>,
    bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    reach: f32,
    lineage: Lineage,
    /// Sums of half areas: of nodes and leaves times the cost of a visit, and of the triangles' own boxes.
    cost: f64,
    own_area: f64,
}

impl Clone for Bvh8 {
    fn clone(&self) -> Self {
        Self { nodes: self.nodes.clone(), blocks: self.blocks.clone(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        let (mut nodes, mut blocks) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.blocks));
        nodes.clone_from(&source.nodes);
        blocks.clone_from(&source.blocks);
        *self = Self { nodes, blocks, ..*source };
    }
}

/// Build settings of `bvh8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bvh8Config {
    /// How nodes are cut.
    pub build: Cut,
    /// Bins an axis, 2 to 64.
    pub bins: usize,
    /// Most triangles in a leaf, 1 to 32; leaves take whole blocks of four.
    pub leaf: usize,
}

impl Default for Bvh8Config {
    fn default() -> Self {
        Self { build: Cut::Sah, bins: 16, leaf: sah::BLOCK }
    }
}

impl AccelConfig for Bvh8Config {
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

impl Tree for Bvh8 {
    type Node = Node;

    #[inline(always)]
    fn reach(&self) -> f32 {
        self.reach
    }

    #[inline(always)]
    fn node(&self, number: usize) -> &Node {
        &self.nodes[number]
    }

    #[inline(always)]
    fn blocks(&self) -> &[TriBlock] {
        &self.blocks
    }

    #[inline(always)]
    fn leaf_blocks<C: Counter>(&self, link: Link, count: &mut C) -> &[TriBlock] {
        let blocks = &self.blocks[link.blocks()];
        for block in blocks {
            block.prims().for_each(|_| count.prim());
        }
        blocks
    }
}

/// Boxes go into the nodes.
#[derive(Clone, Copy)]
struct IntoNodes;

impl Store<Node> for IntoNodes {
    #[inline(always)]
    fn store(&mut self, _number: usize, aabbs: &[Aabb; WIDTH], node: &mut Node) {
        node.set_aabbs(aabbs);
    }

    fn split(self, _number: usize) -> (Self, Self) {
        (self, self)
    }
}

impl Bvh8 {
    /// Makes blocks and nodes over a wide topology.
    fn emit(&mut self, topology: &[[Child; WIDTH]], order: &[u32]) {
        let link =
            |child: &Child| if let Child::Inner(node) = *child { Link::inner(node as usize) } else { Link::NONE };
        self.nodes.extend(topology.iter().map(|children| Node::new(children.each_ref().map(link))));
        self.number_blocks(topology, order, 0);
    }

    /// Makes the blocks of all leaves below a node, depth first.
    fn number_blocks(&mut self, topology: &[[Child; WIDTH]], order: &[u32], number: usize) {
        for (slot, child) in topology[number].iter().enumerate() {
            match *child {
                Child::None => {}
                Child::Inner(below) => self.number_blocks(topology, order, below as usize),
                Child::Leaf { first, count } => {
                    let place = self.blocks.len();
                    self.blocks.extend(TriBlock::of(&order[first as usize..][..count as usize]));
                    self.nodes[number].links[slot] = Link::leaf(place, self.blocks.len() - place);
                }
            }
        }
    }

    fn take_positions(&mut self, prims: &Triangles<'_>) {
        let Self { nodes, blocks, .. } = self;
        let all = Subtree { nodes, blocks, first_node: 0, first_block: 0, store: IntoNodes, span: Link::span };
        let swept = all.refit(prims);
        (self.cost, self.own_area, self.bounds) = (swept.cost, swept.own_area, swept.aabb);
        self.reach = self.bounds.reach();
    }

    /// Expected cost of a ray, in units of the triangles' own area. The root's area, which an explosion makes grow as
    /// well, does not enter.
    fn relative_cost(&self) -> f64 {
        if self.own_area > 0.0 { self.cost / self.own_area } else { 0.0 }
    }

    fn depth(&self) -> usize {
        let mut depths = vec![0_usize; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            let below = node.links.iter().map(|l| if l.is_leaf() { 1 } else { depths[l.index()] });
            depths[i] = 1 + below.max().unwrap_or(0);
        }
        depths[0]
    }
}

impl Refittable for Bvh8 {
    fn lineage(&self) -> &Lineage {
        &self.lineage
    }

    fn retake(&mut self, prims: &Triangles<'_>) {
        self.take_positions(prims);
    }
}

impl Accel for Bvh8 {
    const NAME: &'static str = "bvh8";
    type Config = Bvh8Config;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &Bvh8Config) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_BLOCKS)?;
        let settings = topology::Settings { cut: config.build, bins: config.bins, leaf: config.leaf };
        let binary = topology::build(prims, &settings);
        let mut out = Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            bounds: Aabb::EMPTY,
            reach: 0.0,
            lineage: Lineage::new(prims),
            cost: 0.0,
            own_area: 0.0,
        };
        out.emit(&collapse(&binary, prims), &binary.prims);
        out.take_positions(prims);
        out.lineage.set_fresh_cost(out.relative_cost());
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
    fn closest_all<S: Simd>(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        forms: Forms,
        out: &mut [Option<Hit>],
    ) {
        if packet == 1 {
            S::call(ClosestApart { tree: self, prims, rays, forms, out });
        } else {
            let apart =
                |rays: &[Ray], out: &mut [Option<Hit>]| S::call(ClosestApart { tree: self, prims, rays, forms, out });
            coherent::closest::<S, Self>(self, prims, (rays, packet), forms, out, apart);
        }
    }

    #[inline(always)]
    fn occluded_all<S: Simd>(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        forms: Forms,
        out: &mut [bool],
    ) {
        if packet == 1 {
            S::call(OccludedApart { tree: self, prims, rays, forms, out });
        } else {
            let apart = |rays: &[Ray], out: &mut [bool]| S::call(OccludedApart { tree: self, prims, rays, forms, out });
            coherent::occluded::<S, Self>(self, prims, (rays, packet), forms, out, apart);
        }
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
        wide_packet::closest_packet::<S, Self, C, K>(self, prims, rays, active, best, sinks, count);
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
        wide_packet::occluded_packet::<S, Self, C, K>(self, prims, rays, active, sinks, count)
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        validate::validate(self, prims).map_err(Violation)
    }

    fn stats(&self) -> AccelStats {
        let leaves = self.nodes.iter().flat_map(|n| n.links).filter(|l| l.is_leaf() && !l.is_none()).count();
        let node_bytes = size_of_val(&self.nodes[..]);
        let root = sah::half_area(self.bounds);
        AccelStats {
            nodes: self.nodes.len() + leaves,
            leaves,
            depth: self.depth(),
            node_bytes,
            total_bytes: size_of::<Self>() + node_bytes + size_of_val(&self.blocks[..]),
            sah_cost: sah::COST_TRAVERSE + if root > 0.0 { self.cost / root } else { 0.0 },
        }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn decay(&self) -> f64 {
        self.lineage.decay(self.relative_cost())
    }
}

#[cfg(test)]
mod tests;
