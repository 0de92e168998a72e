//! The tree of any format: build, refit and queries.

use rayon::prelude::*;

use super::{
    Bvh8Config,
    format::Format,
    node::{EightNode, Link},
    validate,
};
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
    geom::{Aabb, Forms, Hit, Ray, Triangles},
    simd::Simd,
};

/// A built hierarchy.
#[derive(Debug)]
pub(in crate::accel) struct Tree8<F: Format> {
    pub(super) nodes: Vec<F::Node>,
    /// What the leaves are made of.
    pub(super) items: Vec<F::Item>,
    pub(super) bounds: Aabb,
    /// Greatest absolute coordinate of the bounds.
    pub(super) reach: f32,
    pub(super) lineage: Lineage,
    /// Sums of half areas: of nodes and leaves times the cost of a visit, and of the triangles' own boxes.
    cost: f64,
    own_area: f64,
}

impl<F: Format> Clone for Tree8<F> {
    fn clone(&self) -> Self {
        Self { nodes: self.nodes.clone(), items: self.items.clone(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        let (mut nodes, mut items) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.items));
        nodes.clone_from(&source.nodes);
        items.clone_from(&source.items);
        *self = Self { nodes, items, ..*source };
    }
}

impl<F: Format> Tree for Tree8<F> {
    type Node = F::Node;

    #[inline(always)]
    fn reach(&self) -> f32 {
        self.reach
    }

    #[inline(always)]
    fn node(&self, number: usize) -> &F::Node {
        &self.nodes[number]
    }

    #[inline(always)]
    fn span(&self, link: Link) -> usize {
        F::span(link)
    }

    #[inline(always)]
    fn block<'a, C: Counter>(
        &'a self,
        place: (Link, usize),
        prims: &Triangles<'_>,
        room: &'a mut TriBlock,
        count: &mut C,
    ) -> &'a TriBlock {
        let block = F::block(&self.items, place, prims, room);
        block.prims().for_each(|_| count.prim());
        block
    }
}

impl<F: Format> Tree8<F> {
    /// Makes leaves and nodes over a wide topology, whose leaves own all triangles in order.
    fn emit(&mut self, topology: &[[Child; WIDTH]], order: &[u32], prims: &Triangles<'_>) {
        topology.par_iter().map(node_of::<F>).collect_into_vec(&mut self.nodes);
        let mut starts = Vec::with_capacity(order.len() / F::RUN + topology.len());
        self.number_leaves(topology, &mut starts, 0);
        let items = starts.par_iter().enumerate().map(|(i, &start)| {
            let end = starts.get(i + 1).map_or(order.len(), |&next| next as usize);
            F::item(&order[start as usize..end], prims)
        });
        items.collect_into_vec(&mut self.items);
    }

    /// Links all leaves below a node, depth first; `starts` are the first triangles of the items so far.
    fn number_leaves(&mut self, topology: &[[Child; WIDTH]], starts: &mut Vec<u32>, number: usize) {
        for (slot, child) in topology[number].iter().enumerate() {
            match *child {
                Child::None => {}
                Child::Inner(below) => self.number_leaves(topology, starts, below as usize),
                Child::Leaf { first, count } => {
                    self.nodes[number].set_link(slot, F::leaf(starts.len(), count as usize));
                    starts.extend((first..first + count).step_by(F::RUN));
                }
            }
        }
    }

    fn take_positions(&mut self, prims: &Triangles<'_>) {
        let Self { nodes, items, .. } = self;
        let all = Subtree { nodes, items, first_node: 0, first_item: 0, store: F::STORE, own: F::own };
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
            let below = node.links().iter().map(|l| if l.is_leaf() { 1 } else { depths[l.index()] });
            depths[i] = 1 + below.max().unwrap_or(0);
        }
        depths[0]
    }
}

/// A node whose boxes and leaves are still to come.
fn node_of<F: Format>(children: &[Child; WIDTH]) -> F::Node {
    let mut links = [Link::NONE; WIDTH];
    for slot in 0..WIDTH {
        if let Child::Inner(node) = children[slot] {
            links[slot] = Link::inner(node as usize);
        }
    }
    F::Node::new(links)
}

impl<F: Format> Refittable for Tree8<F> {
    fn lineage(&self) -> &Lineage {
        &self.lineage
    }

    fn retake(&mut self, prims: &Triangles<'_>) {
        self.take_positions(prims);
    }
}

impl<F: Format> Accel for Tree8<F> {
    const NAME: &'static str = "bvh8";
    const NODE_FORMAT: &'static str = F::NODE_FORMAT;
    type Config = Bvh8Config;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &Bvh8Config) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, F::MOST)?;
        let settings = topology::Settings { cut: config.build, bins: config.bins, leaf: config.leaf };
        let binary = topology::build(prims, &settings);
        let mut out = Self {
            nodes: Vec::new(),
            items: Vec::new(),
            bounds: Aabb::EMPTY,
            reach: 0.0,
            lineage: Lineage::new(prims),
            cost: 0.0,
            own_area: 0.0,
        };
        out.emit(&collapse(&binary), &binary.prims, prims);
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
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        self.walk_closest::<S, C, K>((ray, prims), best, sink, count);
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        self.walk_occluded::<S, C, K>((ray, prims), sink, count)
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
        F::closest_all::<S>(self, prims, (rays, packet), forms, out);
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
        F::occluded_all::<S>(self, prims, (rays, packet), forms, out);
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
        let leaves = self.nodes.iter().flat_map(|n| *n.links()).filter(|l| l.is_leaf() && !l.is_none()).count();
        let node_bytes = size_of_val(&self.nodes[..]);
        let root = sah::half_area(self.bounds);
        AccelStats {
            nodes: self.nodes.len() + leaves,
            leaves,
            depth: self.depth(),
            node_bytes,
            total_bytes: size_of::<Self>() + node_bytes + size_of_val(&self.items[..]),
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
