//! What is nearest to a point.

use glam::Vec3;

use super::{LEAF, Tree, WIDTH};
use crate::{
    geom::Aabb,
    simd::{Lanes, Simd},
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
    pub(in crate::collide) fn near<S: Simd, N: Near>(&self, point: Vec3, stack: &mut Vec<(f32, u32)>, near: &mut N) {
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push((0.0, 0));
        }
        while let Some((distance, link)) = stack.pop() {
            if distance > limit(near) {
                continue;
            }
            let node = &self.nodes[(link & !LEAF) as usize];
            let mut squares = [0.0; WIDTH];
            let mut mask = node.squares::<S>(point, limit(near), &mut squares);
            let mut order = [(0.0_f32, 0_u32); WIDTH];
            let mut found = 0;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & (WIDTH - 1);
                mask &= mask - 1;
                // Furthest first.
                let mut at = found;
                while at > 0 && order[at - 1].0 < squares[lane] {
                    order[at] = order[at - 1];
                    at -= 1;
                }
                order[at] = (squares[lane], node.links[lane]);
                found += 1;
            }
            if node.is_leaf {
                for &(square, item) in order[..found].iter().rev() {
                    if square <= limit(near) {
                        near.visit(item);
                    }
                }
            } else {
                stack.extend_from_slice(&order[..found]);
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

impl super::Node {
    /// Squared distances of a point to the boxes, not above the true ones but for underflow; infinite for empty boxes. Places within a limit.
    #[inline(always)]
    fn squares<S: Simd>(&self, point: Vec3, most: f32, out: &mut [f32; WIDTH]) -> u32 {
        let mut sum = S::F8::splat(0.0);
        for axis in 0..3 {
            let p = S::F8::splat(point[axis]);
            let outside = (S::F8::load(&self.min[axis]) - p).max(p - S::F8::load(&self.max[axis]));
            let d = outside.max(S::F8::splat(0.0));
            sum = sum + d * d;
        }
        let squares = sum * S::F8::splat(BELOW);
        squares.store(out);
        squares.le(S::F8::splat(most)) & ((1 << self.count) - 1)
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
