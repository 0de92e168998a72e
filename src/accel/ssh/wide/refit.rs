//! New planes from boxes, and sides chosen anew from the top.

use super::{
    node::{Node, Word},
    span,
};
use crate::{
    accel::{
        sah,
        ssh::{choose::size, refit::Measured},
        wide::{Place, WIDTH, WideNode, refit::Store},
    },
    geom::Aabb,
};

/// Subtrees of fewer nodes are taken by one task.
const TASK_NODES: usize = 512;

/// Levels below the root that are measured in parallel.
const FORK_LEVELS: usize = 2;

/// Sides stay, planes follow.
#[derive(Clone, Copy)]
pub(super) struct Keep {
    /// Leaves have planes.
    pub(super) leaf_planes: bool,
}

impl<const K: usize> Store<Node<K>> for Keep {
    #[inline(always)]
    fn store(&mut self, _number: usize, aabbs: &[Aabb; WIDTH], node: &mut Node<K>) {
        for (slot, aabb) in aabbs.iter().enumerate() {
            if self.leaf_planes || !node.word(slot).is_leaf() || node.word(slot).is_none() {
                node.set_planes(slot, aabb);
            }
        }
    }

    fn split(self, _number: usize) -> (Self, Self) {
        (self, self)
    }
}

/// Boxes are kept for a choice of sides.
pub(super) struct Boxes<'a> {
    pub(super) own: &'a mut [[Aabb; WIDTH]],
    pub(super) first: usize,
}

impl<const K: usize> Store<Node<K>> for Boxes<'_> {
    #[inline(always)]
    fn store(&mut self, number: usize, aabbs: &[Aabb; WIDTH], _node: &mut Node<K>) {
        self.own[number - self.first] = *aabbs;
    }

    fn split(self, number: usize) -> (Self, Self) {
        let (low, high) = self.own.split_at_mut(number - self.first);
        (Self { own: low, first: self.first }, Self { own: high, first: number })
    }
}

/// Cost of visiting a child, per unit of area.
fn visit_cost(word: Word, spans: &[u8]) -> f64 {
    if word.is_none() {
        0.0
    } else if word.is_leaf() {
        sah::COST_BLOCK * span(spans, word.index()) as f64
    } else {
        sah::COST_TRAVERSE
    }
}

/// Chooses the sides of a subtree anew, from the top down. `nodes` and `boxes` are those from number `first` on.
pub(super) fn rechoose<const K: usize>(
    nodes: &mut [Node<K>],
    boxes: &[[Aabb; WIDTH]],
    first: usize,
    inherited: &Aabb,
    spans: &[u8],
    leaf_planes: bool,
) -> Measured {
    let Some((root, rest)) = nodes.split_first_mut() else { return Measured::default() };
    let mut own = Measured::default();
    let mut below = [*inherited; WIDTH];
    for slot in 0..WIDTH {
        let word = root.word(slot);
        if word.is_none() {
            root.close(slot);
            continue;
        }
        if word.is_leaf() && !leaf_planes {
            root.open(slot);
        } else {
            let choice = Node::<K>::choose(&boxes[0][slot], inherited);
            root.take(slot, &boxes[0][slot], &choice);
            own.useless += root.inside(slot, inherited).1;
            below[slot] = choice.inherited;
        }
        own.cost += size(&below[slot]).0 * visit_cost(word, spans);
    }
    let mut inner = [(0, Aabb::EMPTY); WIDTH];
    let mut count = 0;
    for (slot, below) in below.into_iter().enumerate() {
        let word = root.word(slot);
        if !word.is_leaf() {
            inner[count] = (word.index(), below);
            count += 1;
        }
    }
    let below = Below { nodes: rest, boxes: &boxes[1..], first: first + 1, spans, leaf_planes };
    own.plus(below.rechoose(&inner[..count]))
}

/// The subtrees of neighbouring inner children: their nodes and boxes are those from number `first` on.
struct Below<'a, const K: usize> {
    nodes: &'a mut [Node<K>],
    boxes: &'a [[Aabb; WIDTH]],
    first: usize,
    spans: &'a [u8],
    leaf_planes: bool,
}

impl<const K: usize> Below<'_, K> {
    /// `inner` are the children's numbers and the boxes that they inherit.
    fn rechoose(self, inner: &[(usize, Aabb)]) -> Measured {
        let Self { nodes, boxes, first, spans, leaf_planes } = self;
        match inner {
            [] => Measured::default(),
            [(number, inherited)] => rechoose(nodes, boxes, *number, inherited, spans, leaf_planes),
            _ => {
                let (inner0, inner1) = inner.split_at(inner.len() / 2);
                let second = inner1[0].0;
                let fork = nodes.len() >= TASK_NODES;
                let (nodes0, nodes1) = nodes.split_at_mut(second - first);
                let (boxes0, boxes1) = boxes.split_at(second - first);
                let below0 = Below { nodes: nodes0, boxes: boxes0, first, spans, leaf_planes };
                let below1 = Below { nodes: nodes1, boxes: boxes1, first: second, spans, leaf_planes };
                let (a, b) = if fork {
                    rayon::join(|| below0.rechoose(inner0), || below1.rechoose(inner1))
                } else {
                    (below0.rechoose(inner0), below1.rechoose(inner1))
                };
                a.plus(b)
            }
        }
    }
}

/// Measures a tree whose sides were kept, from the top down.
pub(super) fn measure<const K: usize>(
    nodes: &[Node<K>],
    number: usize,
    inherited: &Aabb,
    spans: &[u8],
    level: usize,
) -> Measured {
    let node = &nodes[number];
    let child = |slot: usize| {
        let word = node.word(slot);
        if word.is_none() {
            return Measured::default();
        }
        let (inside, useless) = node.inside(slot, inherited);
        let own = Measured { cost: size(&inside).0 * visit_cost(word, spans), useless };
        if word.is_leaf() { own } else { own.plus(measure(nodes, word.index(), &inside, spans, level + 1)) }
    };
    halved(0, WIDTH, level < FORK_LEVELS, &child)
}

/// The sum over some slots, always in the same order.
fn halved(first: usize, end: usize, fork: bool, of: &(impl Fn(usize) -> Measured + Sync)) -> Measured {
    if end - first == 1 {
        return of(first);
    }
    let middle = usize::midpoint(first, end);
    let (low, high) = (|| halved(first, middle, fork, of), || halved(middle, end, fork, of));
    let (a, b) = if fork { rayon::join(low, high) } else { (low(), high()) };
    a.plus(b)
}
