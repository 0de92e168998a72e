//! Trees of eight children a node over boxes: what touches what, what is near, refitted as the boxes move.
//!
//! A node is a block of eight boxes by component, which one comparison per plane tests at once; a leaf's boxes are items, another's are
//! its children's. Nodes lie parent first, so one sweep from the last to the first brings a tree to new boxes. Comparisons of boxes
//! are exact; a box with NaN, or with `min > max` on an axis, is empty and meets nothing.
//!
//! Cost: 256 bytes for eight items and little more; refit is bound by the reading of the items.

mod along;
mod build;
mod curve;
mod near;
mod node;
mod pairs;
mod refit;
#[cfg(test)]
mod tests;
mod touch;

use std::{
    ops::ControlFlow,
    sync::{
        OnceLock,
        atomic::{AtomicU64, Ordering},
    },
};

use crate::{geom::Aabb, simd::Simd};

pub(super) use along::Along;
pub(super) use near::Near;
pub(super) use node::{Ends, Node};
use pairs::Labels;
pub(super) use pairs::PairVisitor;
pub(super) use touch::NearPairs;

/// Boxes a node.
pub(super) const WIDTH: usize = 8;

/// The item of a place that has none.
const NONE: u32 = u32::MAX;

/// Bit of a link that leads to a leaf.
const LEAF: u32 = 1 << 31;

/// Builds so far.
static BUILDS: AtomicU64 = AtomicU64::new(1);

/// A tree over boxes, numbered from 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// Parents before children; empty without items.
    nodes: Vec<Node>,
    /// The box of each node.
    bounds: Vec<Ends>,
    /// Differs between any two builds.
    build: u64,
    /// Labels of each leaf's items, in the order of the nodes; see [`Tree::own_pairs_apart`].
    labels: OnceLock<Vec<Labels>>,
    /// Sum of the nodes' areas after the build, over that of the items.
    fresh: f64,
    /// The same now.
    now: f64,
}

impl Tree {
    /// The least box around everything.
    pub(super) fn bounds(&self) -> Aabb {
        self.bounds.first().map_or(Aabb::EMPTY, Ends::aabb)
    }

    /// Differs between any two builds.
    pub(super) fn build_number(&self) -> u64 {
        self.build
    }

    /// Calls `visit` with every item, neighbours one after the other; the order changes with builds only.
    pub(super) fn each_item(&self, mut visit: impl FnMut(u32)) {
        for node in self.nodes.iter().filter(|node| node.is_leaf) {
            node.links[..node.count as usize].iter().for_each(|&item| visit(item));
        }
    }

    /// How much larger the nodes are, for their items' size, than right after the build: 1 when fresh.
    pub(super) fn decay(&self) -> f64 {
        if self.fresh > 0.0 && self.now.is_finite() { self.now / self.fresh } else { 1.0 }
    }

    /// Calls `visit` with every item whose closed box meets `aabb`, in no particular order, until it breaks.
    #[inline(always)]
    pub(super) fn meeting<S: Simd>(
        &self,
        aabb: &Aabb,
        stack: &mut Vec<u32>,
        visit: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(number) = stack.pop() {
            let node = &self.nodes[(number & !LEAF) as usize];
            let mut mask = node.meets::<S>(aabb);
            while mask != 0 {
                let link = node.links[mask.trailing_zeros() as usize];
                mask &= mask - 1;
                if node.is_leaf { visit(link)? } else { stack.push(link) }
            }
        }
        ControlFlow::Continue(())
    }
}
