//! The walk in f64, for every ray and every place.

use arrayvec::ArrayVec;

use super::{
    super::{
        eight::{EIGHT, Eight, LEAF},
        topology::MAX_DEPTH,
    },
    LocalRay, RigidTree,
    single::Look,
};
use crate::accel::{block::TriBlock, packet::bits};

/// Factor that makes a `t` at least what it would be without rounding: above `1 + 4 * 2^-53`.
const WIDER: f64 = 1.0 + 1.0 / (1_u64 << 48) as f64;

/// Places on the stack: all but one of a node's children wait on each level.
const STACK: usize = (EIGHT - 1) * (MAX_DEPTH + 1) + 1;

/// The line of a ray from either side of its margin.
struct Sides {
    /// What lower planes are reached from.
    above: [f64; 3],
    /// What upper planes are reached from.
    below: [f64; 3],
    inv: [f64; 3],
}

impl RigidTree {
    /// Looks at every triangle below the root that the ray may meet.
    #[cold]
    #[inline(never)]
    pub(super) fn walk_exactly<L: Look>(&self, local: &LocalRay, t_near: f32, look: &mut L) {
        let sides = Sides {
            above: (local.from + local.margin).to_array(),
            below: (local.from - local.margin).to_array(),
            inv: local.dir.recip().to_array(),
        };
        let t_near = f64::from(t_near);
        let mut stack: ArrayVec<(f64, u32), STACK> = ArrayVec::new();
        if !self.nodes.is_empty() {
            stack.push((t_near, 0));
        }
        while let Some((entry, word)) = stack.pop() {
            if entry > look.limit() * WIDER {
                continue;
            }
            if word & LEAF != 0 {
                if self.leaf_blocks(word).iter().flat_map(TriBlock::prims).any(|prim| look.look(prim)) {
                    return;
                }
                continue;
            }
            let node = &self.nodes[word as usize];
            let entries = sides.entries(node, t_near, look.limit() * WIDER);
            let from = stack.len();
            for slot in bits(node.present()) {
                let entry = entries[slot & 7];
                if entry < f64::INFINITY {
                    // The nearest last.
                    let mut at = stack.len();
                    stack.push((entry, node.word(slot)));
                    while at > from && stack[at - 1].0 < entry {
                        stack.swap(at, at - 1);
                        at -= 1;
                    }
                }
            }
        }
    }
}

impl Sides {
    /// Where the ray enters each child's box; infinity where it misses it.
    fn entries(&self, node: &Eight, t_near: f64, limit: f64) -> [f64; EIGHT] {
        let mut entries = [t_near; EIGHT];
        let mut exits = [limit; EIGHT];
        for axis in 0..3 {
            let inv = self.inv[axis];
            let (near, far) = if inv < 0.0 { (1, 0) } else { (0, 1) };
            let starts = [self.above[axis], self.below[axis]];
            let planes = node.planes(axis);
            for slot in 0..EIGHT {
                let entry = (f64::from(planes[near][slot]) - starts[near]) * inv;
                let exit = (f64::from(planes[far][slot]) - starts[far]) * inv * WIDER;
                // A NaN changes neither.
                entries[slot] = if entry > entries[slot] { entry } else { entries[slot] };
                exits[slot] = if exit < exits[slot] { exit } else { exits[slot] };
            }
        }
        for slot in 0..EIGHT {
            entries[slot] = if entries[slot] > exits[slot] { f64::INFINITY } else { entries[slot] };
        }
        entries
    }
}
