//! What is nearest to a point.

use glam::Vec3;

use super::{LEAF, Node, Tree, WIDTH};
use crate::{
    geom::Aabb,
    simd::{LEAST_KEY, Lanes, Simd, key_floor},
};

/// Looks at items near a point, nearer ones first as a rule.
pub(in crate::collide) trait Near {
    /// Nothing further away than this matters any more: a squared distance.
    fn limit(&self) -> f64;
    /// An item whose box may be that near.
    fn visit(&mut self, item: u32);
}

/// A squared distance in f32 that is off by 4 roundings of 2^-24 lies below the true one when multiplied by this.
const BELOW: f32 = 1.0 - 1.0 / 1_048_576.0;

/// Above every error of numbers that underflow.
const FLOOR: f64 = 1e-36;

impl Tree {
    /// Shows `near` every item whose box comes as near to `point` (finite) as the limit, and some others.
    #[inline(always)]
    pub(in crate::collide) fn near<S: Simd, N: Near>(&self, point: Vec3, stack: &mut Vec<[u32; 2]>, near: &mut N) {
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push([LEAST_KEY, 0]);
        }
        let point = [S::F8::splat(point.x), S::F8::splat(point.y), S::F8::splat(point.z)];
        while let Some([key, link]) = stack.pop() {
            let most = limit(near);
            if key_floor(key) > most {
                continue;
            }
            let node = &self.nodes[(link & !LEAF) as usize];
            let squares = node.squares::<S>(&point);
            let mask = squares.le(S::F8::splat(most)) & ((1 << node.count) - 1);
            let (mut keys, mut links) = ([0; WIDTH], [0; WIDTH]);
            S::descending(squares, mask, &node.links, &mut keys, &mut links);
            let found = mask.count_ones() as usize;
            if node.is_leaf {
                for at in (0..found).rev() {
                    if key_floor(keys[at & 7]) <= limit(near) {
                        near.visit(links[at & 7]);
                    }
                }
            } else {
                for at in 0..found {
                    stack.push([keys[at & 7], links[at & 7]]);
                }
            }
        }
    }
}

/// The limit as f32, rounded up.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "moved up past the rounding")]
fn limit<N: Near>(near: &N) -> f32 {
    ((near.limit() + FLOOR) as f32).next_up()
}

impl Node {
    /// Squared distances of a point to the boxes, not above the true ones but for underflow; infinite for empty boxes.
    #[inline(always)]
    fn squares<S: Simd>(&self, point: &[S::F8; 3]) -> S::F8 {
        let mut sum = S::F8::splat(0.0);
        for ((p, min), max) in point.iter().zip(&self.min).zip(&self.max) {
            let outside = (S::F8::load(min) - *p).max(*p - S::F8::load(max));
            let d = outside.max(S::F8::splat(0.0));
            sum = sum + d * d;
        }
        sum * S::F8::splat(BELOW)
    }
}

/// The squared distance of two boxes in f64, not above the true one.
pub(in crate::collide) fn square_between(a: &Aabb, b: &Aabb) -> f64 {
    let apart = |axis: usize| {
        let gap =
            (f64::from(b.min[axis]) - f64::from(a.max[axis])).max(f64::from(a.min[axis]) - f64::from(b.max[axis]));
        gap.max(0.0)
    };
    let [x, y, z] = [apart(0), apart(1), apart(2)];
    (x * x + y * y + z * z) * (1.0 - 8.0 * f64::EPSILON)
}
