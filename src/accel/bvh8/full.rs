//! Boxes as they are, and triangles by their corners.

use std::ops::Range;

use arrayvec::ArrayVec;

use super::{
    format::Format,
    node::{Link, MAX_BLOCKS, Node},
    stream::{ClosestApart, OccludedApart},
    tree::Tree8,
};
use crate::{
    accel::{
        block::TriBlock,
        sah::BLOCK,
        wide::{WIDTH, coherent, packet::BlockTree, refit::Store},
    },
    geom::{Aabb, Forms, Hit, PrimId, Ray, Triangles},
    simd::Simd,
};

/// Nodes of 224 bytes, leaves of whole blocks.
#[derive(Clone, Debug)]
pub(in crate::accel) struct Full;

/// Boxes go into the nodes.
#[derive(Clone, Copy)]
pub(in crate::accel) struct IntoNodes;

impl Store<Node> for IntoNodes {
    #[inline(always)]
    fn store(&mut self, _number: usize, aabbs: &[Aabb; WIDTH], node: &mut Node) {
        node.set_aabbs(aabbs);
    }

    fn split(self, _number: usize) -> (Self, Self) {
        (self, self)
    }
}

impl Format for Full {
    type Node = Node;
    type Item = TriBlock;
    type Store = IntoNodes;

    const NODE_FORMAT: &'static str = "full boxes";
    const MOST: usize = MAX_BLOCKS;
    const STORE: IntoNodes = IntoNodes;

    const RUN: usize = BLOCK;

    fn item(own: &[u32], _prims: &Triangles<'_>) -> TriBlock {
        TriBlock::of_up_to_four(own)
    }

    fn leaf(first: usize, triangles: usize) -> Link {
        Link::leaf(first, TriBlock::count_for(triangles))
    }

    #[inline(always)]
    fn own(link: Link) -> Range<usize> {
        link.blocks()
    }

    #[inline(always)]
    fn span(link: Link) -> usize {
        link.span()
    }

    #[inline(always)]
    fn block<'a>(
        blocks: &'a [TriBlock],
        (link, i): (Link, usize),
        _prims: &Triangles<'_>,
        _room: &'a mut TriBlock,
    ) -> &'a TriBlock {
        &blocks[link.blocks().start + i]
    }

    fn triangles(block: &TriBlock, prims: &Triangles<'_>) -> ArrayVec<(PrimId, bool), BLOCK> {
        let is_fresh = |lane: usize, prim: PrimId| {
            prims.finite_aabb(prim).is_empty() || block.corners(lane) == prims.corners(prim)
        };
        block.prims().enumerate().map(|(lane, prim)| (prim, is_fresh(lane, prim))).collect()
    }

    #[inline(always)]
    fn closest_all<S: Simd>(
        tree: &Tree8<Self>,
        prims: &Triangles<'_>,
        (rays, packet): (&[Ray], usize),
        forms: Forms,
        out: &mut [Option<Hit>],
    ) {
        if packet == 1 {
            S::call(ClosestApart { tree, prims, rays, forms, together: false, out });
        } else {
            let apart = |rays: &[Ray], out: &mut [Option<Hit>]| {
                S::call(ClosestApart { tree, prims, rays, forms, together: true, out });
            };
            coherent::closest::<S, _>(tree, prims, (rays, packet), forms, out, apart);
        }
    }

    #[inline(always)]
    fn occluded_all<S: Simd>(
        tree: &Tree8<Self>,
        prims: &Triangles<'_>,
        (rays, packet): (&[Ray], usize),
        forms: Forms,
        out: &mut [bool],
    ) {
        if packet == 1 {
            S::call(OccludedApart { tree, prims, rays, forms, together: false, out });
        } else {
            let apart = |rays: &[Ray], out: &mut [bool]| {
                S::call(OccludedApart { tree, prims, rays, forms, together: true, out });
            };
            coherent::occluded::<S, _>(tree, prims, (rays, packet), forms, out, apart);
        }
    }
}

impl BlockTree for Tree8<Full> {
    #[inline(always)]
    fn blocks(&self) -> &[TriBlock] {
        &self.items
    }

    #[inline(always)]
    fn leaf_blocks(&self, link: Link) -> &[TriBlock] {
        &self.items[link.blocks()]
    }
}
