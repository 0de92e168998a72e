//! One ray against eight boxes at once.

use super::{Eight, LEAF, Lines, PAD, STACK, WIDTH, is_moderate};
use crate::simd::{Lanes, Simd, Stack, branch_barrier};

/// A line with its margin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EightRay {
    mul: [f32; 4],
    /// What is added for planes that are passed first and last.
    first_add: [f32; 3],
    last_add: [f32; 3],
    /// 1 where the ray runs downward.
    backward: [u8; 3],
    t_near: f32,
}

impl EightRay {
    /// A line `from + t dir` that passes within `margin` of the ray, axis by axis, against boxes within `reach` of 0; `None` where nothing is proven.
    #[inline(always)]
    pub(crate) fn new<S: Simd>(
        from: [f32; 3],
        dir: [f32; 3],
        margin: [f32; 3],
        reach: f32,
        t_near: f32,
    ) -> Option<Self> {
        let [x, y, z] = dir;
        let size = x.abs().max(y.abs()).max(z.abs());
        let span = reach + from[0].abs().max(from[1].abs()).max(from[2].abs()) + largest(&margin);
        if is_moderate(S::F4::splat(size), S::F4::splat(span)) == 0 {
            return None;
        }
        let margin = S::F4::load(&[margin[0], margin[1], margin[2], 0.0]) + S::F4::splat(span * PAD);
        let lines = Lines::new(
            S::F4::load(&[from[0], from[1], from[2], 0.0]),
            S::F4::load(&[x, y, z, size]),
            S::F4::splat(size),
            margin,
        );
        let (mut mul, mut low, mut high) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        lines.mul.store(&mut mul);
        lines.low_add.store(&mut low);
        lines.high_add.store(&mut high);
        let mut out = Self { mul, first_add: [0.0; 3], last_add: [0.0; 3], backward: [0; 3], t_near };
        for axis in 0..3 {
            let backward = mul[axis] < 0.0;
            out.backward[axis] = u8::from(backward);
            let (first, last) = if backward { (high[axis], low[axis]) } else { (low[axis], high[axis]) };
            (out.first_add[axis], out.last_add[axis]) = (first, last);
        }
        Some(out)
    }

    /// Where the ray enters each child, and bits of the children that it may meet before the limit.
    #[inline(always)]
    fn test<S: Simd>(&self, node: &Eight, limit: f32) -> (S::F8, u32) {
        let (t_near, limit) = (S::F8::splat(self.t_near), S::F8::splat(limit));
        let (mut entries, mut exits) = ([t_near; 3], [limit; 3]);
        for axis in 0..3 {
            let side = usize::from(self.backward[axis] & 1);
            let planes = node.planes(axis);
            let mul = S::F8::splat(self.mul[axis]);
            entries[axis] = S::F8::load(&planes[side]).mul_add_loose(mul, S::F8::splat(self.first_add[axis]));
            exits[axis] = S::F8::load(&planes[side ^ 1]).mul_add_loose(mul, S::F8::splat(self.last_add[axis]));
        }
        let near = entries[0].max(entries[1]).max(entries[2].max(t_near));
        let far = exits[0].min(exits[1]).min(exits[2].min(limit));
        (near, near.le(far))
    }
}

/// The largest of three numbers that are not negative; NaN where one is.
#[inline(always)]
pub(super) fn largest(of: &[f32; 3]) -> f32 {
    let [a, b, c] = *of;
    // A sum in place of a maximum, for NaN.
    if a <= c && b <= c {
        c
    } else if a <= b && c <= b {
        b
    } else {
        a + b + c
    }
}

/// What is done with the leaves that a ray comes upon.
pub(crate) trait OneVisit {
    /// Nothing beyond this `t` counts any more.
    fn limit(&self) -> f32;
    /// Looks at the leaf of a word; true to end the walk.
    fn leaf<S: Simd>(&mut self, word: u32) -> bool;
}

/// A child to visit: its word below the bits of where the ray enters it, which order as the entries do, for they are not negative.
#[inline(always)]
fn due(entry: f32, word: u32) -> u64 {
    u64::from(entry.to_bits()) << 32 | u64::from(word)
}

/// Shows `visit` the leaves below a word that the ray may meet, nearest children first.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "halves of a key")]
pub(crate) fn walk_one<S: Simd, V: OneVisit>(nodes: &[Eight], ray: &EightRay, start: u32, visit: &mut V) {
    let mut stack = Stack::<u64, STACK>::new();
    let mut word = start;
    loop {
        if word & LEAF != 0 {
            if visit.leaf::<S>(word) {
                return;
            }
        } else {
            let node = &nodes[word as usize];
            let (near, mut hits) = ray.test::<S>(node, visit.limit());
            if hits != 0 {
                let mut entries = [0.0; WIDTH];
                near.store(&mut entries);
                let slot = (hits.trailing_zeros() & 7) as usize;
                hits &= hits - 1;
                if hits == 0 {
                    word = branch_barrier(node.word(slot));
                    continue;
                }
                // The nearest in `next`, the others on the stack, the nearer ones above.
                let mut next = due(entries[slot], node.word(slot));
                let mut waiting = [0; WIDTH];
                let mut len = 0;
                while hits != 0 {
                    let slot = (hits.trailing_zeros() & 7) as usize;
                    hits &= hits - 1;
                    let key = due(entries[slot], node.word(slot));
                    let farther = key.max(next);
                    next = key.min(next);
                    let mut at = len;
                    while at > 0 && waiting[(at - 1) & 7] < farther {
                        waiting[at & 7] = waiting[(at - 1) & 7];
                        at -= 1;
                    }
                    waiting[at & 7] = farther;
                    len += 1;
                }
                for &key in &waiting[..len & 7] {
                    stack.push(key);
                }
                word = next as u32;
                continue;
            }
        }
        word = loop {
            let Some(key) = stack.pop() else { return };
            if f32::from_bits((key >> 32) as u32) <= visit.limit() {
                break key as u32;
            }
        };
    }
}
