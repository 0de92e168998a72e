//! Mergers in the order of the result.

#![expect(clippy::cast_possible_truncation, reason = "places are counted in u32")]

use super::{Merger, TASK, unpacked};
use crate::accel::topology::{Child, Siblings, low_bits};

/// Where a subtree goes: its parts of the result, and the numbers of the first pair and place.
pub(super) struct Target<'a> {
    pub(super) pairs: &'a mut [Siblings],
    pub(super) prims: &'a mut [u32],
    pub(super) pair: usize,
    pub(super) first: usize,
}

/// Brings mergers into depth-first order.
pub(super) struct Emitter<'a> {
    pub(super) leaves: &'a [u32],
    pub(super) mergers: &'a [Merger],
}

impl Emitter<'_> {
    /// Depth first; the height was checked.
    pub(super) fn emit(&self, child: Child, target: Target<'_>) -> Child {
        let Target { pairs, prims, pair, first } = target;
        let merger = match child {
            Child::Inner(number) if self.mergers[number as usize].is_leaf == 0 => self.mergers[number as usize],
            leaf => {
                self.gather(leaf, prims);
                prims.sort_unstable();
                return Child::leaf(first as u32, prims.len());
            }
        };
        let Merger { children, area, axis, pairs: pairs_below, prims: prims_below, .. } = merger;
        let (pairs_below, prims_below) = (pairs_below as usize, prims_below as usize);
        let (own, below) = pairs.split_first_mut().expect("pairs were counted");
        let (pairs0, pairs1) = below.split_at_mut(pairs_below);
        let (prims0, prims1) = prims.split_at_mut(prims_below);
        let is_large = prims0.len() + prims1.len() > TASK;
        let target0 = Target { pairs: pairs0, prims: prims0, pair: pair + 1, first };
        let target1 = Target { pairs: pairs1, prims: prims1, pair: pair + 1 + pairs_below, first: first + prims_below };
        let (child0, child1) = (unpacked(children[0]), unpacked(children[1]));
        let (first, second) = if is_large {
            rayon::join(|| self.emit(child0, target0), || self.emit(child1, target1))
        } else {
            (self.emit(child0, target0), self.emit(child1, target1))
        };
        *own = Siblings { children: [first, second], area, axis: low_bits(usize::from(axis)) };
        Child::inner(pair)
    }

    /// Writes the triangles below a child.
    fn gather(&self, child: Child, prims: &mut [u32]) {
        match child {
            Child::None => {}
            Child::Leaf { first, .. } => prims.copy_from_slice(&self.leaves[first as usize..][..prims.len()]),
            Child::Inner(number) => {
                let Merger { children, prims: first, .. } = self.mergers[number as usize];
                let (prims0, prims1) = prims.split_at_mut(first as usize);
                self.gather(unpacked(children[0]), prims0);
                self.gather(unpacked(children[1]), prims1);
            }
        }
    }
}
