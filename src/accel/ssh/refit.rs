//! New positions into blocks and planes.
//!
//! A node's plane bounds all that is below it along its own axis, and its children may keep planes of other axes: so whole boxes are carried
//! from the leaves upward, in the stack of a post-order walk. Choosing sides anew needs the inherited box, which comes from above: a
//! second walk, over the boxes that the first one stored.

use rayon::prelude::*;

use super::{
    choose::{self, choose},
    node::{Pair, Word},
};
use crate::{
    accel::{
        block::{Sweep, TriBlock},
        sah,
    },
    geom::{Aabb, PrimId, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Subtrees of fewer pairs are refitted by one task.
const TASK_PAIRS: usize = 4096;

/// Levels below the root that are measured in parallel.
const FORK_LEVELS: usize = 6;

/// A subtree's box and the sum of the half areas of the triangles' own boxes, in the order of the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Swept {
    pub(super) aabb: Aabb,
    pub(super) own_area: f64,
}

impl Swept {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, own_area: 0.0 };

    fn plus(self, other: Self) -> Self {
        Self { aabb: self.aabb.union(other.aabb), own_area: self.own_area + other.own_area }
    }
}

/// What a walk from above found out about a subtree.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Measured {
    /// Sum over nodes of half the area of the inherited box cut by the node's plane, times the cost of a visit.
    pub(super) cost: f64,
    /// Planes that take nothing off the inherited box.
    pub(super) useless: usize,
}

impl Measured {
    pub(super) fn plus(self, other: Self) -> Self {
        Self { cost: self.cost + other.cost, useless: self.useless + other.useless }
    }
}

/// The leaves of a subtree.
pub(super) trait Leaves: Sized + Send {
    /// Takes new positions into a leaf that has triangles.
    fn refit(&mut self, place: usize, prims: &Triangles<'_>) -> Swept;
    /// The leaves before `place` and those from there on.
    fn split(self, place: usize) -> (Self, Self);
}

/// Leaves of whole blocks.
pub(super) struct Blocks<'a> {
    pub(super) own: &'a mut [TriBlock],
    pub(super) spans: &'a [u8],
    pub(super) first: usize,
}

impl Leaves for Blocks<'_> {
    #[inline(always)]
    fn refit(&mut self, place: usize, prims: &Triangles<'_>) -> Swept {
        let span = self.spans.get(place).map_or(1, |&span| usize::from(span));
        let mut swept = Swept::EMPTY;
        let first = place - self.first;
        for at in first..first + span {
            let bounds = TriBlock::refit_in_sweep(self.own, at, Sweep::Upward, prims);
            swept = swept.plus(Swept { aabb: bounds.aabb, own_area: bounds.own_area });
        }
        swept
    }

    fn split(self, place: usize) -> (Self, Self) {
        let Self { own, spans, first } = self;
        let (low, high) = own.split_at_mut(place - first);
        (Self { own: low, spans, first }, Self { own: high, spans, first: place })
    }
}

/// Leaves of one triangle that share blocks, which have taken the new positions already.
#[derive(Clone, Copy)]
pub(super) struct Slots<'a>(pub(super) &'a [TriBlock]);

impl Leaves for Slots<'_> {
    #[inline(always)]
    fn refit(&mut self, place: usize, prims: &Triangles<'_>) -> Swept {
        let aabb = prims.finite_aabb(PrimId(self.0[place / sah::BLOCK].prim(place % sah::BLOCK)));
        Swept { aabb, own_area: sah::half_area(aabb) }
    }

    fn split(self, _place: usize) -> (Self, Self) {
        (self, self)
    }
}

/// Takes new positions into all blocks.
pub(super) fn refit_blocks(blocks: &mut [TriBlock], prims: &Triangles<'_>) {
    blocks.par_iter_mut().with_min_len(TASK_PAIRS).for_each(|block| {
        block.refit(prims);
    });
}

/// What is done with the box of a node once it is known.
pub(super) trait Store: Sized + Send {
    fn store(&mut self, pair: usize, child: usize, aabb: &Aabb, node: &mut super::node::Node);
    fn split(self, pair: usize) -> (Self, Self);
}

/// Sides stay, planes follow.
#[derive(Clone, Copy)]
pub(super) struct Keep {
    /// Leaves have planes.
    pub(super) leaf_planes: bool,
}

impl Store for Keep {
    #[inline(always)]
    fn store(&mut self, _pair: usize, _child: usize, aabb: &Aabb, node: &mut super::node::Node) {
        if self.leaf_planes || !node.word.is_leaf() || node.word.is_none() {
            node.plane = node.word.side().of(aabb);
        }
    }

    fn split(self, _pair: usize) -> (Self, Self) {
        (self, self)
    }
}

/// Boxes are kept for a choice of sides.
pub(super) struct Boxes<'a> {
    pub(super) own: &'a mut [[Aabb; 2]],
    pub(super) first: usize,
}

impl Store for Boxes<'_> {
    #[inline(always)]
    fn store(&mut self, pair: usize, child: usize, aabb: &Aabb, _node: &mut super::node::Node) {
        self.own[pair - self.first][child] = *aabb;
    }

    fn split(self, pair: usize) -> (Self, Self) {
        let (low, high) = self.own.split_at_mut(pair - self.first);
        (Self { own: low, first: self.first }, Self { own: high, first: pair })
    }
}

/// A subtree whose root pair is the first of its pairs.
pub(super) struct Subtree<'a, L, B> {
    pub(super) pairs: &'a mut [Pair],
    pub(super) first: usize,
    pub(super) leaves: L,
    pub(super) store: B,
}

impl<L: Leaves, B: Store> Subtree<'_, L, B> {
    /// From the leaves upward; subtrees run in parallel in the current pool.
    pub(super) fn refit(mut self, prims: &Triangles<'_>) -> Swept {
        if self.pairs.len() < TASK_PAIRS {
            let number = self.first;
            return dispatch(SimdLevel::best(), Below { subtree: &mut self, number, prims });
        }
        let Self { pairs, first, leaves, store } = self;
        let Some((root, rest)) = pairs.split_first_mut() else { return Swept::EMPTY };
        let words = root.0.map(|node| node.word);
        let second_pair = if words[1].is_leaf() { first + 1 + rest.len() } else { words[1].index() };
        let second_leaf = first_leaf(words[1], rest, first + 1);
        let (pairs0, pairs1) = rest.split_at_mut(second_pair - first - 1);
        let (leaves0, leaves1) = leaves.split(second_leaf);
        let (mut own, below) = store.split(first + 1);
        let (store0, store1) = below.split(second_pair);
        let below0 = Subtree { pairs: pairs0, first: first + 1, leaves: leaves0, store: store0 };
        let below1 = Subtree { pairs: pairs1, first: second_pair, leaves: leaves1, store: store1 };
        let (swept0, swept1) = rayon::join(|| below0.child(words[0], prims), || below1.child(words[1], prims));
        own.store(first, 0, &swept0.aabb, &mut root.0[0]);
        own.store(first, 1, &swept1.aabb, &mut root.0[1]);
        swept0.plus(swept1)
    }

    /// The child of a forked pair: this subtree's root, or a leaf.
    fn child(mut self, word: Word, prims: &Triangles<'_>) -> Swept {
        if word.is_leaf() { self.leaf(word, prims) } else { self.refit(prims) }
    }

    #[inline(always)]
    fn leaf(&mut self, word: Word, prims: &Triangles<'_>) -> Swept {
        if word.is_none() { Swept::EMPTY } else { self.leaves.refit(word.index(), prims) }
    }
}

/// A pair of a subtree and what is below it.
struct Below<'a, 's, L, B> {
    subtree: &'a mut Subtree<'s, L, B>,
    number: usize,
    prims: &'a Triangles<'a>,
}

impl<L: Leaves, B: Store> Task for Below<'_, '_, L, B> {
    type Output = Swept;

    /// Depth first; the builder bounds the depth.
    #[inline(always)]
    fn run<S: Simd>(self) -> Swept {
        let Self { subtree, number, prims } = self;
        let mut both = Swept::EMPTY;
        for child in 0..2 {
            let word = subtree.pairs[number - subtree.first].0[child].word;
            let swept = if word.is_leaf() {
                subtree.leaf(word, prims)
            } else {
                S::call(Below { subtree: &mut *subtree, number: word.index(), prims })
            };
            subtree.store.store(number, child, &swept.aabb, &mut subtree.pairs[number - subtree.first].0[child]);
            both = both.plus(swept);
        }
        both
    }
}

/// Place of the first leaf below a node; `pairs` are those from number `first` on.
fn first_leaf(mut word: Word, pairs: &[Pair], first: usize) -> usize {
    while !word.is_leaf() {
        word = pairs[word.index() - first].0[0].word;
    }
    word.index()
}

/// Cost of visiting a node, per unit of area.
fn visit_cost(word: Word, spans: &[u8]) -> f64 {
    if word.is_leaf() {
        sah::COST_BLOCK * spans.get(word.index()).map_or(1.0, |&span| f64::from(span))
    } else {
        sah::COST_TRAVERSE
    }
}

/// Chooses the sides of a subtree anew, from the top down. `pairs` and `boxes` are those from number `first` on.
pub(super) fn rechoose(
    pairs: &mut [Pair],
    boxes: &[[Aabb; 2]],
    first: usize,
    inherited: &Aabb,
    spans: &[u8],
    leaf_planes: bool,
) -> Measured {
    let Some((root, rest)) = pairs.split_first_mut() else { return Measured::default() };
    let mut own = Measured::default();
    let mut below = [*inherited; 2];
    for child in 0..2 {
        let node = &mut root.0[child];
        if node.word.is_leaf() && !leaf_planes && !node.word.is_none() {
            node.plane = f32::INFINITY;
            node.word.set_side(super::node::Side::ALL[0]);
        } else {
            let choice = choose(&boxes[0][child], inherited);
            node.word.set_side(choice.side);
            node.plane = choice.plane;
            below[child] = choice.inherited;
            own.useless += usize::from(choice.useless);
        }
        own.cost += choose::size(&below[child]).0 * visit_cost(node.word, spans);
    }
    let words = root.0.map(|node| node.word);
    let second = if words[1].is_leaf() { first + 1 + rest.len() } else { words[1].index() };
    let fork = rest.len() >= TASK_PAIRS;
    let (pairs0, pairs1) = rest.split_at_mut(second - first - 1);
    let (boxes0, boxes1) = boxes[1..].split_at(second - first - 1);
    let mut left = || rechoose(pairs0, boxes0, first + 1, &below[0], spans, leaf_planes);
    let mut right = || rechoose(pairs1, boxes1, second, &below[1], spans, leaf_planes);
    let (left, right) = if fork { rayon::join(left, right) } else { (left(), right()) };
    own.plus(left).plus(right)
}

/// Measures a tree whose sides were kept, from the top down.
pub(super) fn measure(pairs: &[Pair], number: usize, inherited: &Aabb, spans: &[u8], level: usize) -> Measured {
    let mut out = Measured::default();
    let mut below = [*inherited; 2];
    let area = choose::size(inherited);
    for (node, below) in pairs[number].0.iter().zip(&mut below) {
        if node.plane < f32::INFINITY {
            *below = node.word.side().tightened(*inherited, node.plane);
            let size = choose::size(below);
            out.useless += usize::from(size == area);
            out.cost += size.0 * visit_cost(node.word, spans);
        } else {
            out.cost += area.0 * visit_cost(node.word, spans);
        }
    }
    let visit = |child: usize| {
        let word = pairs[number].0[child].word;
        if word.is_leaf() { Measured::default() } else { measure(pairs, word.index(), &below[child], spans, level + 1) }
    };
    let (left, right) = if level < FORK_LEVELS { rayon::join(|| visit(0), || visit(1)) } else { (visit(0), visit(1)) };
    out.plus(left).plus(right)
}
