//! New positions into the blocks and nodes of a tree, from the leaves upward.

use super::{Place, WIDTH, WideNode};
use crate::{
    accel::{
        block::{Sweep, TriBlock},
        sah,
    },
    geom::{Aabb, Triangles},
};

/// Subtrees of fewer nodes are refitted by one task.
const TASK_NODES: usize = 512;

/// What a refit found out about a subtree. Sums are taken in the order of the tree, whatever the schedule.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Swept {
    /// The box around all triangles.
    pub(in crate::accel) aabb: Aabb,
    /// Sum over the nodes and leaves of half the area of their own box times the cost of a visit.
    pub(in crate::accel) cost: f64,
    /// Sum of the half areas of the triangles' own boxes.
    pub(in crate::accel) own_area: f64,
}

impl Swept {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, cost: 0.0, own_area: 0.0 };

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self {
            aabb: self.aabb.union(other.aabb),
            cost: self.cost + other.cost,
            own_area: self.own_area + other.own_area,
        }
    }
}

/// What is done with the boxes of a node's children once they are known.
pub(in crate::accel) trait Store<N>: Sized + Send {
    /// Takes the boxes of the children of the node with this number.
    fn store(&mut self, number: usize, aabbs: &[Aabb; WIDTH], node: &mut N);
    /// The places of the nodes before `number`, and from there on.
    fn split(self, number: usize) -> (Self, Self);
}

/// A subtree whose root is the first of its nodes, with the blocks below it and the numbers of the first of each.
pub(in crate::accel) struct Subtree<'a, N, B, R> {
    pub(in crate::accel) nodes: &'a mut [N],
    pub(in crate::accel) blocks: &'a mut [TriBlock],
    pub(in crate::accel) first_node: usize,
    pub(in crate::accel) first_block: usize,
    pub(in crate::accel) store: B,
    /// Blocks of the leaf that a word is.
    pub(in crate::accel) span: R,
}

impl<N: WideNode, B: Store<N>, R: Fn(N::Word) -> usize + Copy + Send + Sync> Subtree<'_, N, B, R> {
    /// Refits all; subtrees run in parallel in the current pool.
    pub(in crate::accel) fn refit(mut self, prims: &Triangles<'_>) -> Swept {
        if self.nodes.len() < TASK_NODES {
            let first = self.first_node;
            return self.node(first, prims);
        }
        let Self { nodes, blocks, first_node, first_block, store, span } = self;
        let Some((root, rest)) = nodes.split_first_mut() else { return Swept::EMPTY };
        let mut words = [root.word(0); WIDTH];
        let mut starts = [(0, 0); WIDTH];
        let mut at = (first_node + 1 + rest.len(), first_block + blocks.len());
        for slot in (0..WIDTH).rev() {
            words[slot] = root.word(slot);
            at = first_below(words[slot], rest, first_node + 1, at);
            starts[slot] = at;
        }
        let (mut own, below) = store.split(first_node + 1);
        let below = Subtree { nodes: rest, blocks, first_node: first_node + 1, first_block, store: below, span };
        let mut swept = [Swept::EMPTY; WIDTH];
        below.children(&words, &starts, &mut swept, prims);
        let mut aabbs = [Aabb::EMPTY; WIDTH];
        let mut all = Swept::EMPTY;
        for (aabb, swept) in aabbs.iter_mut().zip(swept) {
            *aabb = swept.aabb;
            all = all.plus(swept);
        }
        own.store(first_node, &aabbs, root);
        all
    }

    /// Refits neighbouring children, halves of them in parallel; `self` holds their nodes and blocks.
    fn children(mut self, words: &[N::Word], starts: &[(usize, usize)], swept: &mut [Swept], prims: &Triangles<'_>) {
        let (&[word], [swept]) = (words, &mut *swept) else {
            let half = words.len() / 2;
            let ((words0, words1), (starts0, starts1)) = (words.split_at(half), starts.split_at(half));
            let (swept0, swept1) = swept.split_at_mut(half);
            let (node, block) = starts1[0];
            let (nodes0, nodes1) = self.nodes.split_at_mut(node - self.first_node);
            let (blocks0, blocks1) = self.blocks.split_at_mut(block - self.first_block);
            let (store0, store1) = self.store.split(node);
            let (first_node, first_block, span) = (self.first_node, self.first_block, self.span);
            let below0 = Subtree { nodes: nodes0, blocks: blocks0, first_node, first_block, store: store0, span };
            let below1 =
                Subtree { nodes: nodes1, blocks: blocks1, first_node: node, first_block: block, store: store1, span };
            rayon::join(
                || below0.children(words0, starts0, swept0, prims),
                || below1.children(words1, starts1, swept1, prims),
            );
            return;
        };
        *swept = if word.is_leaf() { self.leaf(word, prims) } else { visited(self.refit(prims)) };
    }

    #[inline(always)]
    fn leaf(&mut self, word: N::Word, prims: &Triangles<'_>) -> Swept {
        let mut swept = Swept::EMPTY;
        if word.is_none() {
            return swept;
        }
        let span = (self.span)(word);
        let first = word.index() - self.first_block;
        for at in first..first + span {
            let bounds = TriBlock::refit_in_sweep(self.blocks, at, Sweep::Upward, prims);
            swept = swept.plus(Swept { aabb: bounds.aabb, cost: 0.0, own_area: bounds.own_area });
        }
        swept.cost = sah::half_area(swept.aabb) * sah::COST_BLOCK * span as f64;
        swept
    }

    /// Depth first; the builder bounds the depth.
    fn node(&mut self, number: usize, prims: &Triangles<'_>) -> Swept {
        let mut aabbs = [Aabb::EMPTY; WIDTH];
        let mut all = Swept::EMPTY;
        for (slot, aabb) in aabbs.iter_mut().enumerate() {
            let word = self.nodes[number - self.first_node].word(slot);
            let swept = if word.is_leaf() { self.leaf(word, prims) } else { visited(self.node(word.index(), prims)) };
            *aabb = swept.aabb;
            all = all.plus(swept);
        }
        self.store.store(number, &aabbs, &mut self.nodes[number - self.first_node]);
        all
    }
}

#[inline(always)]
fn visited(swept: Swept) -> Swept {
    Swept { cost: swept.cost + sah::half_area(swept.aabb) * sah::COST_TRAVERSE, ..swept }
}

/// Numbers of the first node and block below a child; `after` are those of the child behind it. `nodes` are those from number `first` on.
fn first_below<N: WideNode>(word: N::Word, nodes: &[N], first: usize, after: (usize, usize)) -> (usize, usize) {
    if word.is_none() {
        return after;
    }
    if word.is_leaf() {
        return (after.0, word.index());
    }
    let mut leftmost = word;
    while !leftmost.is_leaf() {
        leftmost = nodes[leftmost.index() - first].word(0);
    }
    (word.index(), if leftmost.is_none() { after.1 } else { leftmost.index() })
}
