//! A binary tree over the boxes of groups, and the same with eight children a node.
//!
//! Built by binned surface-area splits, in parallel where there are many boxes; refitted from frame to frame until it has decayed. Which of the two a frame
//! had changes no answer: boxes only prove misses.

mod build;
mod wide;

#[cfg(test)]
mod tests;

use build::Run;
pub(super) use wide::WideTree;

use crate::geom::Aabb;

/// Depth from which splits halve the count: at most 32 more levels for any number of boxes.
const SAH_DEPTH: usize = 16;

/// Places on the stack of a walk: one node waits a level, and both children are there for a moment.
pub(crate) const STACK: usize = SAH_DEPTH + 34;

/// A refitted tree whose nodes' areas, over that of the root, have in sum grown by this factor is built anew.
const DECAY: f64 = 1.2;

/// So many frames in a row are refitted at most: areas say little where what is around everything has grown.
const REFITS: u32 = 30;

/// A binary tree over the boxes of groups, one group a leaf.
///
/// Binned surface-area splits (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007).
/// The order of input decides ties, so equal boxes give equal trees, whatever the threads. Empty boxes are left out.
#[derive(Debug, Default)]
pub(crate) struct TopTree {
    /// A node stands before its children.
    nodes: Vec<TopNode>,
    items: Vec<Item>,
    spare: Vec<Item>,
    /// How many boxes there were, empty ones too.
    boxes: usize,
    /// [`TopTree::cost`] when built.
    built_cost: f64,
    /// Refits since then.
    refits: u32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct TopNode {
    pub(crate) aabb: Aabb,
    /// First of two children that follow each other, or the group when `leaf`.
    pub(crate) link: u32,
    pub(crate) leaf: bool,
}

impl TopNode {
    const NONE: Self = Self { aabb: Aabb::EMPTY, link: 0, leaf: true };
}

#[derive(Clone, Copy, Debug)]
struct Item {
    aabb: Aabb,
    group: u32,
}

impl TopTree {
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.boxes = 0;
    }

    /// Builds over `boxes`, numbered in order; fewer than 2^31 of them. No allocation when there were as many before.
    #[expect(clippy::cast_possible_truncation, reason = "groups are numbered in 32 bits")]
    pub(crate) fn build(&mut self, boxes: impl ExactSizeIterator<Item = Aabb>) {
        self.clear();
        self.boxes = boxes.len();
        self.items.clear();
        let items = boxes.enumerate().filter(|(_, b)| !b.is_empty());
        self.items.extend(items.map(|(group, aabb)| Item { aabb, group: group as u32 }));
        if self.items.is_empty() {
            return;
        }
        self.nodes.resize(2 * self.items.len() - 1, TopNode::NONE);
        self.spare.resize(self.items.len(), self.items[0]);
        let (root, below) = self.nodes.split_at_mut(1);
        Run { items: &mut self.items, spare: &mut self.spare, below, first: 1, depth: 0 }.split(&mut root[0]);
        (self.built_cost, self.refits) = (self.cost(), 0);
    }

    /// Moves the tree's boxes to `boxes`, numbered as when it was built; false, and nothing said of the tree, when it must be built anew: other boxes are
    /// empty, or it has decayed.
    ///
    /// Cost: O(groups), one thread, no allocation.
    pub(super) fn refit(
        &mut self,
        boxes: impl ExactSizeIterator<Item = Aabb> + Clone,
        at: impl Fn(u32) -> Aabb,
    ) -> bool {
        if self.nodes.is_empty() || self.boxes != boxes.len() || self.refits >= REFITS {
            return false;
        }
        let filled = boxes.filter(|aabb| !aabb.is_empty()).count();
        if 2 * filled - usize::from(filled > 0) != self.nodes.len() {
            return false;
        }
        for number in (0..self.nodes.len()).rev() {
            let TopNode { link, leaf, .. } = self.nodes[number];
            let aabb =
                if leaf { at(link) } else { self.nodes[link as usize].aabb.union(self.nodes[link as usize + 1].aabb) };
            if leaf && aabb.is_empty() {
                return false;
            }
            self.nodes[number].aabb = aabb;
        }
        self.refits += 1;
        self.cost() <= self.built_cost * DECAY
    }

    /// The area of all inner nodes over that of the root; NaN where it is 0.
    fn cost(&self) -> f64 {
        let inner = self.nodes.iter().filter(|node| !node.leaf);
        let area: f64 = inner.map(|node| f64::from(node.aabb.half_area())).sum();
        area / f64::from(self.nodes[0].aabb.half_area())
    }

    /// The root first; empty without boxes.
    pub(crate) fn nodes(&self) -> &[TopNode] {
        &self.nodes
    }
}
