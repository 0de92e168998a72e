//! Several rays, a lane each, against boxes one after the other, whatever the signs of their directions.

use super::{Eight, LEAF, Lines, PAD, STACK, WIDTH, is_moderate, ray::largest};
use crate::simd::{Lanes, Simd, Stack};

/// Lines with their margins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EightPacket<S: Simd> {
    lines: [Lines<S::F>; 3],
    near: S::F,
    /// Lanes for which misses are proven.
    fits: u32,
}

impl<S: Simd> EightPacket<S> {
    /// As [`EightRay::new`](super::EightRay::new), a ray a lane.
    #[inline(always)]
    pub(crate) fn new(from: [S::F; 3], dir: [S::F; 3], margin: [f32; 3], reach: f32, near: S::F) -> Self {
        let size = dir[0].abs().max(dir[1].abs()).max(dir[2].abs());
        let far = from[0].abs().max(from[1].abs()).max(from[2].abs());
        let span = far + S::F::splat(reach + largest(&margin));
        let pad = span * S::F::splat(PAD);
        let lines = [
            Lines::new(from[0], dir[0], size, S::F::splat(margin[0]) + pad),
            Lines::new(from[1], dir[1], size, S::F::splat(margin[1]) + pad),
            Lines::new(from[2], dir[2], size, S::F::splat(margin[2]) + pad),
        ];
        Self { lines, near, fits: is_moderate(size, span) }
    }

    /// Lanes for which misses are proven.
    #[inline(always)]
    pub(crate) fn fits(&self) -> u32 {
        self.fits
    }

    /// The rays that may meet a child before the limit, and where they enter it.
    #[inline(always)]
    fn test(&self, node: &Eight, slot: usize, limit: S::F) -> (u32, S::F) {
        let (mut near, mut far) = (self.near, limit);
        for axis in 0..3 {
            let (lines, [low, high]) = (&self.lines[axis], node.planes(axis));
            let low = S::F::splat(low[slot]).mul_add_loose(lines.mul, lines.low_add);
            let high = S::F::splat(high[slot]).mul_add_loose(lines.mul, lines.high_add);
            near = low.min(high).max(near);
            far = low.max(high).min(far);
        }
        (near.le(far), near)
    }
}

/// What is done with the leaves that rays come upon.
pub(crate) trait ManyVisit<S: Simd> {
    /// Rays that still look for anything.
    fn open(&self) -> u32;
    /// Nothing beyond these `t` counts any more.
    fn limit(&self) -> S::F;
    /// Looks at the leaf of a word for the rays in `mask`.
    fn leaf(&mut self, word: u32, mask: u32);
    /// Takes what is below a word when so few rays are left that they go one by one; false to go on together.
    fn few(&mut self, word: u32, mask: u32) -> bool;
}

/// Shows `visit` the leaves below the first node that the rays in `mask` may meet, those nearer to the first of them first.
#[inline(always)]
pub(crate) fn walk_many<S: Simd, V: ManyVisit<S>>(nodes: &[Eight], rays: &EightPacket<S>, mask: u32, visit: &mut V) {
    let mut stack = Stack::<(S::F, u32, u32), STACK>::new();
    if mask != 0 && !nodes.is_empty() {
        stack.push((rays.near, mask, 0));
    }
    while let Some((near, mask, word)) = stack.pop() {
        let limit = visit.limit();
        let mask = mask & visit.open() & near.le(limit);
        if mask == 0 {
            continue;
        }
        if word & LEAF != 0 {
            visit.leaf(word, mask);
            continue;
        }
        if visit.few(word, mask) {
            continue;
        }
        let node = &nodes[word as usize];
        let leader = mask.trailing_zeros() as usize;
        let mut keys = [0_u64; WIDTH];
        let mut found = [(near, 0_u32); WIDTH];
        let mut len = 0;
        let mut left = node.present();
        while left != 0 {
            let slot = (left.trailing_zeros() & 7) as usize;
            left &= left - 1;
            let (hits, near) = rays.test(node, slot, limit);
            let hits = hits & mask;
            if hits == 0 {
                continue;
            }
            found[slot] = (near, hits);
            let mut row = [0.0; 16];
            near.store(&mut row);
            let key = u64::from(row[leader & 15].to_bits()) << 32 | slot as u64;
            let mut at = len;
            while at > 0 && keys[(at - 1) & 7] < key {
                keys[at & 7] = keys[(at - 1) & 7];
                at -= 1;
            }
            keys[at & 7] = key;
            len += 1;
        }
        for &key in &keys[..len] {
            let slot = (key & 7) as usize;
            let (near, hits) = found[slot];
            stack.push((near, hits, node.word(slot)));
        }
    }
}
