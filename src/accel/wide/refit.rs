//! New positions into the leaves and nodes of a tree, from the leaves upward.

use std::ops::Range;

use super::{Place, WIDTH, WideNode};
use crate::{
    accel::{
        block::{Sweep, TriBlock},
        sah,
    },
    geom::{Aabb, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Subtrees of fewer nodes are refitted by one task.
pub(in crate::accel) const TASK_NODES: usize = 512;

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
    pub(in crate::accel) const EMPTY: Self = Self { aabb: Aabb::EMPTY, cost: 0.0, own_area: 0.0 };

    #[inline(always)]
    pub(in crate::accel) fn plus(self, other: Self) -> Self {
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

/// What the leaves of a tree are made of.
pub(in crate::accel) trait Item<N: WideNode>: Sized + Send {
    /// Refits those of one leaf, `own` of `items`; its cost is that of the visit.
    fn leaf(items: &mut [Self], own: Range<usize>, prims: &Triangles<'_>) -> Swept;

    /// Refits a subtree that one task takes.
    fn small<B: Store<N>, R: Items<N>>(subtree: &mut Subtree<'_, N, Self, B, R>, prims: &Triangles<'_>) -> Swept;
}

impl<N: WideNode> Item<N> for TriBlock {
    #[inline(always)]
    fn leaf(blocks: &mut [Self], own: Range<usize>, prims: &Triangles<'_>) -> Swept {
        let mut swept = Swept::EMPTY;
        let span = own.len() as f64;
        for at in own {
            let bounds = Self::refit_in_sweep(blocks, at, Sweep::Upward, prims);
            swept = swept.plus(Swept { aabb: bounds.aabb, cost: 0.0, own_area: bounds.own_area });
        }
        swept.cost = sah::half_area(swept.aabb) * sah::COST_BLOCK * span;
        swept
    }

    fn small<B: Store<N>, R: Items<N>>(subtree: &mut Subtree<'_, N, Self, B, R>, prims: &Triangles<'_>) -> Swept {
        let number = subtree.first_node;
        dispatch(SimdLevel::best(), Below { subtree, number, prims })
    }
}

/// A node of a subtree and what is below it.
struct Below<'a, 's, N, B, R> {
    subtree: &'a mut Subtree<'s, N, TriBlock, B, R>,
    number: usize,
    prims: &'a Triangles<'a>,
}

impl<N: WideNode, B: Store<N>, R: Items<N>> Task for Below<'_, '_, N, B, R> {
    type Output = Swept;

    /// Depth first; the builder bounds the depth.
    #[inline(always)]
    fn run<S: Simd>(self) -> Swept {
        let Self { subtree, number, prims } = self;
        let mut aabbs = [Aabb::EMPTY; WIDTH];
        let mut all = Swept::EMPTY;
        for (slot, aabb) in aabbs.iter_mut().enumerate() {
            let word = subtree.nodes[number - subtree.first_node].word(slot);
            let swept = if word.is_leaf() {
                subtree.leaf(word, prims)
            } else {
                visited(S::call(Below { subtree: &mut *subtree, number: word.index(), prims }))
            };
            *aabb = swept.aabb;
            all = all.plus(swept);
        }
        subtree.store.store(number, &aabbs, &mut subtree.nodes[number - subtree.first_node]);
        all
    }
}

/// The items of the leaf that a word is.
pub(in crate::accel) trait Items<N: WideNode>:
    Fn(N::Word) -> Range<usize> + Copy + Send + Sync
{
}

impl<N: WideNode, F: Fn(N::Word) -> Range<usize> + Copy + Send + Sync> Items<N> for F {}

/// A subtree whose root is the first of its nodes, with the items of the leaves below it and the numbers of the first of each.
pub(in crate::accel) struct Subtree<'a, N, L, B, R> {
    pub(in crate::accel) nodes: &'a mut [N],
    pub(in crate::accel) items: &'a mut [L],
    pub(in crate::accel) first_node: usize,
    pub(in crate::accel) first_item: usize,
    pub(in crate::accel) store: B,
    pub(in crate::accel) own: R,
}

impl<N: WideNode, L: Item<N>, B: Store<N>, R: Items<N>> Subtree<'_, N, L, B, R> {
    /// Refits all; subtrees run in parallel in the current pool.
    pub(in crate::accel) fn refit(mut self, prims: &Triangles<'_>) -> Swept {
        if self.nodes.len() < TASK_NODES {
            return L::small(&mut self, prims);
        }
        let Self { nodes, items, first_node, first_item, store, own: of } = self;
        let Some((root, rest)) = nodes.split_first_mut() else { return Swept::EMPTY };
        let mut words = [root.word(0); WIDTH];
        let mut starts = [(0, 0); WIDTH];
        let mut at = (first_node + 1 + rest.len(), first_item + items.len());
        for slot in (0..WIDTH).rev() {
            words[slot] = root.word(slot);
            at = first_below(words[slot], rest, first_node + 1, at, of);
            starts[slot] = at;
        }
        let (mut own, below) = store.split(first_node + 1);
        let below = Subtree { nodes: rest, items, first_node: first_node + 1, first_item, store: below, own: of };
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

    /// Refits neighbouring children, halves of them in parallel; `self` holds their nodes and items.
    fn children(mut self, words: &[N::Word], starts: &[(usize, usize)], swept: &mut [Swept], prims: &Triangles<'_>) {
        let (&[word], [swept]) = (words, &mut *swept) else {
            let half = words.len() / 2;
            let ((words0, words1), (starts0, starts1)) = (words.split_at(half), starts.split_at(half));
            let (swept0, swept1) = swept.split_at_mut(half);
            let (node, item) = starts1[0];
            let (nodes0, nodes1) = self.nodes.split_at_mut(node - self.first_node);
            let (items0, items1) = self.items.split_at_mut(item - self.first_item);
            let (store0, store1) = self.store.split(node);
            let (first_node, first_item, own) = (self.first_node, self.first_item, self.own);
            let below0 = Subtree { nodes: nodes0, items: items0, first_node, first_item, store: store0, own };
            let below1 =
                Subtree { nodes: nodes1, items: items1, first_node: node, first_item: item, store: store1, own };
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
        if word.is_none() {
            return Swept::EMPTY;
        }
        let own = (self.own)(word);
        L::leaf(self.items, own.start - self.first_item..own.end - self.first_item, prims)
    }
}

#[inline(always)]
pub(in crate::accel) fn visited(swept: Swept) -> Swept {
    Swept { cost: swept.cost + sah::half_area(swept.aabb) * sah::COST_TRAVERSE, ..swept }
}

/// Numbers of the first node and item below a child; `after` are those of the child behind it. `nodes` are those from number `first` on.
fn first_below<N: WideNode>(
    word: N::Word,
    nodes: &[N],
    first: usize,
    after: (usize, usize),
    own: impl Items<N>,
) -> (usize, usize) {
    if word.is_none() {
        return after;
    }
    if word.is_leaf() {
        return (after.0, own(word).start);
    }
    let mut leftmost = word;
    while !leftmost.is_leaf() {
        leftmost = nodes[leftmost.index() - first].word(0);
    }
    (word.index(), if leftmost.is_none() { after.1 } else { own(leftmost).start })
}
