//! Trees of eight boxes a node over anything, walked by rays that are known to within a margin: the level over groups, and parts in their own space.
//!
//! Nothing is decided here: boxes only prove misses. What a leaf's word leads to is the visitor's.
//!
//! # Why no box is lost
//! Let `x = o + t d` be a point in a box, and `a + t b` a line that passes within `m`, axis by axis, of `x` at that very `t`; let no box reach farther from 0
//! than `R`. With `S = R + |a|∞ + |m|∞` no component of `t b` exceeds S, up to a rounding. Components of b below `2^-25 |b|∞` are made as large: that moves the
//! line by at most `2^-25 S`. Rounding a and b to f32 moves it by two times `u S`, where `u = 2^-24`. What comes out for a plane p is
//! `fl(fl(p r) + c)`, where r is the reciprocal of b and `c = -(a ± m) r`: one rounding of r, one of `a ± m` and two of m, two of c, two more in the end, each of at most
//! `u S |r|`. Together less than `11 u S |r|`, and m is wider by [`PAD`] S with `PAD = 16 u`. So an entry is at most t, an exit at least t. Products that underflow lose less than 2^-148, while the pad of rays
//! that are [`is_moderate`] is `2^-100` at least, and nothing overflows: `S |r|` stays below 2^106.

mod packet;
mod ray;

pub(crate) use packet::{EightPacket, ManyVisit, walk_many};
pub(crate) use ray::{EightRay, OneVisit, walk_one};

use super::topology::{MAX_DEPTH, wide::WIDTH};
use crate::{geom::Aabb, simd::Lanes};

/// Most boxes of a node.
pub(crate) const EIGHT: usize = WIDTH;

/// By which share of all distances that occur a margin is wider than what is asked for: 2^-20.
const PAD: f32 = 1.0 / 1_048_576.0;

/// Components of a direction that are smaller by this factor than the largest are made larger: 2^-25.
const SLANT: f32 = 1.0 / 33_554_432.0;

/// Sizes of directions and sums of distances that are proven, and their inverses: 2^40.
const MODERATE: f32 = 1_099_511_627_776.0;

/// Set in words of leaves.
pub(crate) const LEAF: u32 = 1 << 31;

/// Places on the stack of a walk: all but one of a node's children wait on each level.
const STACK: usize = (WIDTH - 1) * (MAX_DEPTH + 1) + 1;

/// Eight children's boxes and where they lead: words of leaves have the bit [`LEAF`], others are numbers of nodes.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eight {
    /// `[axis][min, max][child]`.
    planes: [[[f32; WIDTH]; 2]; 3],
    words: [u32; WIDTH],
    /// A bit for each child.
    present: u32,
}

const _: () = assert!(size_of::<Eight>() == 256);

impl Eight {
    /// No children.
    pub(crate) const EMPTY: Self =
        Self { planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3], words: [0; WIDTH], present: 0 };

    /// Puts a child into a slot; nothing when its box is empty.
    pub(crate) fn put(&mut self, slot: usize, aabb: &Aabb, word: u32) {
        if aabb.is_empty() {
            return;
        }
        for axis in 0..3 {
            self.planes[axis][0][slot] = aabb.min[axis];
            self.planes[axis][1][slot] = aabb.max[axis];
        }
        self.words[slot] = word;
        self.present |= 1 << slot;
    }

    /// `[min, max]` of all children on an axis.
    #[inline(always)]
    pub(crate) fn planes(&self, axis: usize) -> &[[f32; WIDTH]; 2] {
        &self.planes[axis]
    }

    /// The child in a slot.
    #[inline(always)]
    pub(crate) fn word(&self, slot: usize) -> u32 {
        self.words[slot]
    }

    /// A bit for each child.
    #[inline(always)]
    pub(crate) fn present(&self) -> u32 {
        self.present
    }
}

/// Where lines meet planes of one axis: a lower plane p at `p * mul + low_add` and an upper one at `p * mul + high_add`, the earlier of which
/// is the entry into a box.
#[derive(Clone, Copy, Debug)]
struct Lines<L> {
    mul: L,
    low_add: L,
    high_add: L,
}

impl<L: Lanes<Elem = f32>> Lines<L> {
    /// Of lines `from + t dir` whose directions measure `size` at most, for boxes that are wider by `margin`.
    #[inline(always)]
    fn new(from: L, dir: L, size: L, margin: L) -> Self {
        let least = size * L::splat(SLANT);
        let signed = L::select(dir.lt(L::splat(0.0)), -least, least);
        let mul = L::splat(1.0) / L::select(dir.abs().lt(least), signed, dir);
        Self { mul, low_add: -((from + margin) * mul), high_add: -((from - margin) * mul) }
    }
}

/// Lanes whose directions and sums of distances the proof is for. NaN is none.
#[inline(always)]
fn is_moderate<L: Lanes<Elem = f32>>(size: L, span: L) -> u32 {
    let (least, most) = (L::splat(1.0 / MODERATE), L::splat(MODERATE));
    least.le(size) & size.le(most) & least.le(span) & span.le(most)
}

#[cfg(test)]
mod tests;
