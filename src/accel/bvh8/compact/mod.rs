//! The compact layout: boxes in steps of their node's box, and triangles by their corners' numbers.
//!
//! A node takes 96 bytes and a triangle 16, about 21 bytes a triangle in all, where full boxes and corners take 53. Vertices are read where the caller keeps
//! them: a leaf that a ray comes upon is put together from them, and a refit writes nothing but nodes.

mod leaf;
mod node;
mod refit;

use std::ops::Range;

use arrayvec::ArrayVec;

use super::{format::Format, node::Link};
use crate::{
    accel::{block::TriBlock, sah::BLOCK},
    geom::{PrimId, Triangles},
};
use leaf::Corners;
use node::Steps;
use refit::IntoSteps;

/// Nodes of 96 bytes, leaves of corner numbers.
#[derive(Clone, Debug)]
pub(in crate::accel) struct Compact;

impl Format for Compact {
    type Node = Steps;
    type Item = Corners;
    type Store = IntoSteps;

    const NODE_FORMAT: &'static str = "boxes in steps of 8 bits";
    const MOST: usize = Link::MOST_IN_RUNS;
    const STORE: IntoSteps = IntoSteps;

    const RUN: usize = 1;

    fn item(own: &[u32], prims: &Triangles<'_>) -> Corners {
        Corners::new(own[0], prims)
    }

    fn leaf(first: usize, triangles: usize) -> Link {
        Link::run(first, triangles)
    }

    #[inline(always)]
    fn own(link: Link) -> Range<usize> {
        link.triangles()
    }

    #[inline(always)]
    fn span(link: Link) -> usize {
        link.triangles().len().div_ceil(BLOCK)
    }

    #[inline(always)]
    fn block<'a>(
        items: &'a [Corners],
        (link, i): (Link, usize),
        prims: &Triangles<'_>,
        room: &'a mut TriBlock,
    ) -> &'a TriBlock {
        let own = link.triangles();
        let first = own.start + BLOCK * i;
        Corners::gather(&items[first..own.end.min(first + BLOCK)], prims, room);
        room
    }

    fn triangles(item: &Corners, prims: &Triangles<'_>) -> ArrayVec<(PrimId, bool), BLOCK> {
        ArrayVec::from_iter([item.checked(prims)])
    }
}

#[cfg(test)]
mod tests;
