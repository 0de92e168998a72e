//! Which boxes of one tree meet which of another, or of itself.

use std::ops::ControlFlow;

use super::{LEAF, Node, Tree, WIDTH};
use crate::simd::{Lanes, Simd, SimdLevel, Task, dispatch};

/// Takes pairs of items whose closed boxes meet.
pub(in crate::collide) trait PairVisitor {
    /// A pair, the first tree's item first; each pair once. Breaking ends the walk.
    fn pair(&mut self, a: u32, b: u32) -> ControlFlow<()>;
}

impl<F: FnMut(u32, u32) -> ControlFlow<()>> PairVisitor for F {
    #[inline(always)]
    fn pair(&mut self, a: u32, b: u32) -> ControlFlow<()> {
        self(a, b)
    }
}

impl Tree {
    /// Every pair of items of this tree and of `other` whose closed boxes meet, in no particular order.
    pub(in crate::collide) fn pairs_with<V: PairVisitor>(&self, other: &Self, visitor: &mut V) {
        if self.nodes.is_empty() || other.nodes.is_empty() {
            return;
        }
        if super::super::boxes_meet(&self.bounds(), &other.bounds()) {
            dispatch(SimdLevel::best(), Between { a: self, b: other, visitor });
        }
    }

    /// Every unordered pair of different items of this tree whose closed boxes meet, in no particular order.
    pub(in crate::collide) fn own_pairs<V: PairVisitor>(&self, visitor: &mut V) {
        if !self.nodes.is_empty() {
            dispatch(SimdLevel::best(), Within { tree: self, visitor, labels: None });
        }
    }

    /// As [`Tree::own_pairs`], without pairs of items that have a label in common.
    ///
    /// `labels` gives three below 2^28 for each item, the same at every call between two builds.
    pub(in crate::collide) fn own_pairs_apart<V: PairVisitor>(&self, labels: &[[u32; 3]], visitor: &mut V) {
        if !self.nodes.is_empty() {
            let of_nodes =
                self.labels.get_or_init(|| self.nodes.iter().map(|node| Labels::new(node, labels)).collect());
            dispatch(SimdLevel::best(), Within { tree: self, visitor, labels: Some(of_nodes) });
        }
    }

    /// The link of the root of a tree with items.
    fn root(&self) -> u32 {
        if self.nodes[0].is_leaf { LEAF } else { 0 }
    }

    #[inline(always)]
    fn node(&self, link: u32) -> &Node {
        &self.nodes[(link & !LEAF) as usize]
    }
}

/// Three labels of each item of a leaf, as floats of that order: wide arithmetic on those is at hand.
#[derive(Clone, Debug)]
pub(super) struct Labels([[f32; WIDTH]; 3]);

/// Added to labels below 2^28, so that they are the bits of floats from 2^-16 to 2^16. Those that differ do so by 2^-39 at least, and a product
/// of three differences is a normal number: it is 0 where one of them is, and nowhere else.
const NORMAL: u32 = (127 - 16) << 23;

impl Labels {
    fn new(node: &Node, labels: &[[u32; 3]]) -> Self {
        let mut out = Self([[0.0; WIDTH]; 3]);
        if node.is_leaf {
            for (lane, &item) in node.links.iter().enumerate().take(node.count as usize) {
                for (row, label) in out.0.iter_mut().zip(labels[item as usize]) {
                    row[lane] = f32::from_bits(NORMAL + label);
                }
            }
        }
        out
    }

    /// Places whose items have a label in common with that at a place of another leaf.
    #[inline(always)]
    fn shared<S: Simd>(&self, other: &Self, row: usize) -> u32 {
        let mut least = S::F8::splat(f32::INFINITY);
        for labels in &other.0 {
            let label = S::F8::splat(labels[row]);
            let mut product = S::F8::load(&self.0[0]) - label;
            product = product * (S::F8::load(&self.0[1]) - label);
            product = product * (S::F8::load(&self.0[2]) - label);
            least = least.min(product.abs());
        }
        least.le(S::F8::splat(0.0))
    }
}

struct Between<'a, V> {
    a: &'a Tree,
    b: &'a Tree,
    visitor: &'a mut V,
}

impl<V: PairVisitor> Task for Between<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut stack = Vec::with_capacity(256);
        stack.push((self.a.root(), self.b.root()));
        // A visitor that breaks has what it wanted.
        let _ = walk::<S, V>(self.a, self.b, &mut stack, None, self.visitor);
    }
}

/// Works off pairs of nodes, of `a` and of `b`, whose boxes meet.
#[inline(always)]
fn walk<S: Simd, V: PairVisitor>(
    a: &Tree,
    b: &Tree,
    stack: &mut Vec<(u32, u32)>,
    labels: Option<&[Labels]>,
    visitor: &mut V,
) -> ControlFlow<()> {
    while let Some((of_a, of_b)) = stack.pop() {
        let (one, other) = (a.node(of_a), b.node(of_b));
        // A leaf waits until the other is one too.
        if one.is_leaf && !other.is_leaf {
            let mut mask = other.meets::<S>(&a.bounds[(of_a & !LEAF) as usize].aabb());
            while mask != 0 {
                stack.push((of_a, other.links[mask.trailing_zeros() as usize]));
                mask &= mask - 1;
            }
            continue;
        }
        let mut rows = one.meets::<S>(&b.bounds[(of_b & !LEAF) as usize].aabb());
        while rows != 0 {
            let row = rows.trailing_zeros() as usize & 7;
            rows &= rows - 1;
            if other.is_leaf && !one.is_leaf {
                stack.push((one.links[row], of_b));
                continue;
            }
            let mut mask = other.meets::<S>(&one.get(row));
            if let (Some(labels), true, true) = (labels, one.is_leaf, mask != 0) {
                mask &= !labels[(of_b & !LEAF) as usize].shared::<S>(&labels[(of_a & !LEAF) as usize], row);
            }
            while mask != 0 {
                let pair = (one.links[row], other.links[mask.trailing_zeros() as usize & 7]);
                mask &= mask - 1;
                if one.is_leaf { visitor.pair(pair.0, pair.1)? } else { stack.push(pair) }
            }
        }
    }
    ControlFlow::Continue(())
}

struct Within<'a, V> {
    tree: &'a Tree,
    visitor: &'a mut V,
    labels: Option<&'a [Labels]>,
}

impl<V: PairVisitor> Task for Within<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut stack = Vec::with_capacity(256);
        for number in 0..self.tree.nodes.len() {
            let node = &self.tree.nodes[number];
            for row in 0..node.count as usize {
                // Later places only: each pair once.
                let mut mask = node.meets::<S>(&node.get(row)) & (u32::MAX << row << 1);
                if let (Some(labels), true, true) = (self.labels, node.is_leaf, mask != 0) {
                    mask &= !labels[number].shared::<S>(&labels[number], row);
                }
                while mask != 0 {
                    let pair = (node.links[row], node.links[mask.trailing_zeros() as usize & 7]);
                    mask &= mask - 1;
                    if !node.is_leaf {
                        stack.push(pair);
                    } else if self.visitor.pair(pair.0, pair.1).is_break() {
                        return;
                    }
                }
            }
            if walk::<S, V>(self.tree, self.tree, &mut stack, self.labels, self.visitor).is_break() {
                return;
            }
        }
    }
}
