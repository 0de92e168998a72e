//! From a topology to pairs of nodes and blocks of triangles; planes and corners are left to a refit.

#![expect(clippy::cast_possible_truncation, reason = "a leaf has few blocks")]

use super::node::{Node, Pair, Word};
use crate::{
    accel::{
        block::TriBlock,
        topology::{self, Child, Topology},
    },
    geom::Triangles,
};

/// The nodes and blocks of a tree.
pub(super) struct Emitted {
    pub(super) root: Word,
    pub(super) pairs: Vec<Pair>,
    pub(super) blocks: Vec<TriBlock>,
    /// Blocks of the leaf that begins at a block; empty while no leaf has more than one.
    pub(super) spans: Vec<u8>,
}

/// Builds the tree over all triangles. With `packed`, leaves of one triangle share blocks.
pub(super) fn build(prims: &Triangles<'_>, settings: &topology::Settings, packed: bool) -> Emitted {
    let Topology { pairs: siblings, prims: order } = topology::build(prims, settings);
    let none = Pair([Node { plane: f32::NEG_INFINITY, word: Word::NONE }; 2]);
    let mut out = Emitted {
        root: Word::inner(0, siblings[0].axis),
        pairs: vec![none; siblings.len()],
        blocks: Vec::new(),
        spans: Vec::new(),
    };
    if packed {
        out.blocks.extend(TriBlock::of(&order));
    }
    let mut stack = vec![(0, 1), (0, 0)];
    while let Some((pair, child)) = stack.pop() {
        let word = match siblings[pair].children[child] {
            Child::None => Word::NONE,
            Child::Inner(below) => {
                let below = below as usize;
                stack.extend([(below, 1), (below, 0)]);
                Word::inner(below, siblings[below].axis)
            }
            Child::Leaf { first, .. } if packed => Word::leaf(first as usize),
            Child::Leaf { first, count } => out.leaf(&order[first as usize..][..count as usize]),
        };
        out.pairs[pair].0[child].word = word;
    }
    if out.spans.iter().all(|&span| span <= 1) {
        out.spans = Vec::new();
    }
    out
}

impl Emitted {
    fn leaf(&mut self, prims: &[u32]) -> Word {
        let first = self.blocks.len();
        self.blocks.extend(TriBlock::of(prims));
        let span = self.blocks.len() - first;
        self.spans.resize(self.blocks.len(), 0);
        self.spans[first] = span as u8;
        Word::leaf(first)
    }
}
