//! From a topology to pairs of nodes and blocks of triangles; boxes and corners are left to a refit.

#![expect(
    clippy::cast_possible_truncation,
    reason = "there are at most as many blocks as triangles, whose number is checked before"
)]

use super::node::{Link, Pair};
use crate::{
    accel::{
        block::TriBlock,
        topology::{self, Child, Topology},
    },
    geom::Triangles,
};

/// Pairs and blocks of a tree.
pub(super) struct Emitted {
    pub(super) pairs: Vec<Pair>,
    pub(super) blocks: Vec<TriBlock>,
}

/// Builds the tree over all triangles.
pub(super) fn build(prims: &Triangles<'_>, settings: &topology::Settings) -> Emitted {
    let Topology { pairs: siblings, prims: order } = topology::build(prims, settings);
    let mut out = Emitted { pairs: Vec::with_capacity(siblings.len()), blocks: Vec::new() };
    for siblings in &siblings {
        out.pairs.push(Pair::new(siblings.children.map(link), [0; 2]));
    }
    out.blocks.reserve_exact(siblings.iter().flat_map(|s| s.children).map(blocks_of).sum());
    out.number_blocks(&order, &siblings);
    out.count_blocks();
    out
}

/// The link of an inner child; those of leaves follow with their blocks.
fn link(child: Child) -> Link {
    match child {
        Child::Inner(pair) => Link::inner(pair as usize),
        _ => Link::NONE,
    }
}

fn blocks_of(child: Child) -> usize {
    match child {
        Child::Leaf { count, .. } => TriBlock::count_for(count as usize),
        _ => 0,
    }
}

impl Emitted {
    /// Makes the blocks of all leaves in the order of the places, which is depth-first.
    fn number_blocks(&mut self, order: &[u32], siblings: &[topology::Siblings]) {
        let mut stack = vec![(0, 1), (0, 0)];
        while let Some((pair, child)) = stack.pop() {
            match siblings[pair].children[child] {
                Child::None => {}
                Child::Inner(below) => stack.extend([(below as usize, 1), (below as usize, 0)]),
                Child::Leaf { first, count } => {
                    let block = self.blocks.len();
                    let prims = &order[first as usize..][..count as usize];
                    self.blocks.extend(TriBlock::of(prims));
                    self.pairs[pair].links[child] = Link::leaf(block, self.blocks.len() - block);
                }
            }
        }
    }

    /// Counts the blocks below every child, from the bottom up.
    fn count_blocks(&mut self) {
        for i in (0..self.pairs.len()).rev() {
            let below = |link: Link| {
                if link.is_leaf() { link.blocks().len() as u32 } else { self.pairs[link.pair()].blocks.iter().sum() }
            };
            self.pairs[i].blocks = self.pairs[i].links.map(below);
        }
    }
}
