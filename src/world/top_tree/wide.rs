//! The tree with eight children a node.

use arrayvec::ArrayVec;

use super::TopTree;
use crate::accel::{EIGHT, Eight, LEAF};

/// Nodes of eight children that lead to the same groups as those of a [`TopTree`].
#[derive(Debug, Default)]
pub(in crate::world) struct WideTree {
    nodes: Vec<Eight>,
    /// The node of the binary tree that each child is.
    sources: Vec<[u32; EIGHT]>,
}

impl WideTree {
    pub(in crate::world) fn clear(&mut self) {
        self.nodes.clear();
        self.sources.clear();
    }

    /// The root first; none without boxes.
    #[inline(always)]
    pub(in crate::world) fn nodes(&self) -> &[Eight] {
        &self.nodes
    }

    /// Makes the nodes over `tree`.
    ///
    /// Of a node's children the largest inner one is opened until there are as many as fit. No allocation when there were as many boxes before.
    pub(in crate::world) fn make(&mut self, tree: &TopTree) {
        self.clear();
        if !tree.nodes.is_empty() {
            // Nodes that hold but two groups are at most half as many as these, and those above have more than a few children.
            let room = tree.nodes.len() / 3 + 2;
            self.nodes.reserve(room);
            self.sources.reserve(room);
            self.add(tree, 0);
        }
    }

    /// Depth first; the number of the node. The builder bounds the depth.
    #[expect(clippy::cast_possible_truncation, reason = "fewer nodes than groups, which are numbered in 31 bits")]
    fn add(&mut self, tree: &TopTree, node: u32) -> u32 {
        let mut children = ArrayVec::<u32, EIGHT>::new();
        children.push(node);
        let of = |node: u32| &tree.nodes[node as usize];
        while children.len() < EIGHT {
            let area = |&at: &usize| of(children[at]).aabb.half_area();
            let inner = (0..children.len()).filter(|&at| !of(children[at]).leaf);
            let Some(at) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let first = of(children[at]).link;
            children[at] = first;
            children.push(first + 1);
        }
        let number = self.nodes.len();
        self.nodes.push(Eight::EMPTY);
        self.sources.push([0; EIGHT]);
        for (slot, &child) in children.iter().enumerate() {
            let word = if of(child).leaf { LEAF | of(child).link } else { self.add(tree, child) };
            self.nodes[number].put(slot, &of(child).aabb, word);
            self.sources[number][slot] = child;
        }
        number as u32
    }

    /// Takes the boxes of `tree`, which has been refitted since the nodes were made over it.
    pub(in crate::world) fn refit(&mut self, tree: &TopTree) {
        for (node, sources) in self.nodes.iter_mut().zip(&self.sources) {
            let mut left = node.present();
            while left != 0 {
                let slot = (left.trailing_zeros() & 7) as usize;
                left &= left - 1;
                node.put(slot, &tree.nodes[sources[slot] as usize].aabb, node.word(slot));
            }
        }
    }
}
