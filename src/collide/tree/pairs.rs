//! Which boxes of one tree meet which of another, or of itself.

use std::ops::ControlFlow;

use super::{LEAF, Node, Tree};
use crate::simd::{Simd, SimdLevel, Task, dispatch};

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
            dispatch(SimdLevel::best(), Within { tree: self, visitor });
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
        let _ = walk::<S, V>(self.a, self.b, &mut stack, self.visitor);
    }
}

/// Works off pairs of nodes, of `a` and of `b`, whose boxes meet.
#[inline(always)]
fn walk<S: Simd, V: PairVisitor>(a: &Tree, b: &Tree, stack: &mut Vec<(u32, u32)>, visitor: &mut V) -> ControlFlow<()> {
    while let Some((of_a, of_b)) = stack.pop() {
        let (one, other) = (a.node(of_a), b.node(of_b));
        // A leaf waits until the other is one too.
        if one.is_leaf && !other.is_leaf {
            let mut mask = other.meets::<S>(&a.bounds[(of_a & !LEAF) as usize]);
            while mask != 0 {
                stack.push((of_a, other.links[mask.trailing_zeros() as usize]));
                mask &= mask - 1;
            }
            continue;
        }
        let mut rows = one.meets::<S>(&b.bounds[(of_b & !LEAF) as usize]);
        while rows != 0 {
            let row = rows.trailing_zeros() as usize & 7;
            rows &= rows - 1;
            if other.is_leaf && !one.is_leaf {
                stack.push((one.links[row], of_b));
                continue;
            }
            let mut mask = other.meets::<S>(&one.get(row));
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
            if walk::<S, V>(self.tree, self.tree, &mut stack, self.visitor).is_break() {
                return;
            }
        }
    }
}
