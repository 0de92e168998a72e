//! What trees of eight children a node share: their form, the walk of single rays and the refit.

pub(super) mod coherent;
pub(super) mod packet;
pub(super) mod refit;
pub(super) mod walk;

pub(super) use super::topology::wide::WIDTH;
use super::{Counter, block::TriBlock};
use crate::geom::Triangles;

/// A tree of eight children a node over triangles in blocks.
///
/// Nodes and leaves stand depth first, in the order of the children, so that a subtree owns a contiguous run of each.
pub(super) trait Tree {
    /// A node.
    type Node: WideNode;

    /// Greatest absolute coordinate of the triangles.
    fn reach(&self) -> f32;
    /// A node by its number.
    fn node(&self, number: usize) -> &Self::Node;
    /// How many blocks a leaf has.
    fn span(&self, word: Word<Self>) -> usize;
    /// One of the blocks of a leaf, its triangles counted. `room` is for trees that make it of the triangles given.
    fn block<'a, C: Counter>(
        &'a self,
        place: (Word<Self>, usize),
        prims: &Triangles<'_>,
        room: &'a mut TriBlock,
        count: &mut C,
    ) -> &'a TriBlock;
}

/// The word of a child in a tree's nodes.
pub(super) type Word<T> = <<T as Tree>::Node as WideNode>::Word;

/// A node of up to [`WIDTH`] children.
pub(super) trait WideNode: Send + Sync {
    /// Where a child is.
    type Word: Place;

    /// The child in a slot below [`WIDTH`].
    fn word(&self, slot: usize) -> Self::Word;
}

/// Where a child is: a node, a run of blocks, or nowhere.
pub(super) trait Place: Copy + Send + Sync {
    /// True for leaves and for what is no child.
    fn is_leaf(self) -> bool;
    /// True for what is no child.
    fn is_none(self) -> bool;
    /// Number of the node that an inner child is, or of a leaf's first block.
    fn index(self) -> usize;
    /// The same, in a way that keeps the branch that led here: processors predict the child well, while choosing it by arithmetic would
    /// make each step wait for the test of the one before.
    #[must_use]
    fn predicted(self) -> Self;
}
