//! A tree over the triangles of a part in its own space, shared by every place that the part is at.
//!
//! A part that moves as a whole keeps its tree; a ray is brought into the part's space and meets its boxes there. Boxes only prove misses: a triangle that is
//! not ruled out is tested where it is in the world, with the very vertices that every other structure tests. So the answers are those of a tree over
//! the world's vertices, bit for bit, and a motion costs the instance's box and one matrix.
//!
//! # Why no hit is lost
//! Let `A`, `T` be the linear part and translation of `world_from_part` as the `f64` numbers they are, `p` a vertex of the part and `w` the one in the world.
//! `w = A p + T + e`, where `e` holds the roundings of four products and sums in `f64` and one rounding to `f32`:
//! `|e| <= 2^-50 (|A| |p| + |T|) + 2^-24 |w| + 2^-149`, component by component ([`RigidPlace::new`] takes bounds of `|p|` and `|w|` over the part).
//!
//! Let `N` be the matrix that was computed as the inverse of `A`, whatever its error, and `L(x) = N (x - T)`, without rounding. A hit lies at `x = o + t d`
//! in a triangle, `x = sum c_k w_k` with `c_k >= 0` of sum 1, so `L(x) = sum c_k p_k + (N A - I) sum c_k p_k + N sum c_k e_k`. The first term lies in every box
//! around the triangle in the part's space. The others are at most `|N A - I| max |p| + |N| max |e|`: the margin of the place, with the rounding of
//! `N A` added.
//!
//! `L(x) = a + t b` with `a = N (o - T)` and `b = N d`. Computed in `f64` they err by at most `2^-50 |N| (|o| + |T|)` and `2^-51 |N| |d|`, and
//! `t |d| = |x - o| <= |w| + |o|`. So the line from the computed `a` along the computed `b` passes, at the very `t` of the hit, within the margin plus
//! `2^-49 |N| (|o| + |T| + |w|)` of the box, and of the triangle in the part. That is what `eight` asks of a ray, which brings it against eight boxes at once in `f32`, and what
//! tells which triangles of a leaf may be hit at all (`single.rs`).
//!
//! Rays that `f32` is not proven for go in `f64` (`exact.rs`), where what is left are the roundings of one difference, one reciprocal and one
//! product for each plane, `3.01 * 2^-53` of the result. A component of `b` that is 0 gives infinities of the right sign, or a NaN where the
//! origin lies on a plane: comparisons are written so that a NaN rules nothing out. Overflow is out of reach: `f32` coordinates, and `|N|` that `f64` holds, or
//! margins that are infinite and rule nothing out.
//!
//! Rays of a packet are brought into the part's space together. A leaf that several of them may hit has its triangles gathered where they are in the world, to be
//! tested as those of other structures are.

mod exact;
mod lanes;
mod packet;
mod single;

use glam::{DAffine3, DMat3, DVec3};

use super::{
    BuildError, TravRay,
    block::TriBlock,
    check_indices,
    eight::{Eight, LEAF},
    sah::BLOCK,
    topology::{self, Child, Cut, wide::collapse},
};
use crate::geom::{Aabb, Triangles};

pub(crate) use packet::RigidPacket;

/// Most triangles: a leaf has 28 bits for its first block.
const MAX_PRIMS: usize = 1 << 28;

const COUNT_SHIFT: u32 = 28;
const FIRST: u32 = (1 << COUNT_SHIFT) - 1;

/// The tree.
#[derive(Debug)]
pub(crate) struct RigidTree {
    /// Words of leaves hold the first of their blocks, and how many there are less one in bits 28 to 30.
    nodes: Vec<Eight>,
    /// Triangles in the part's space, in the order of the leaves.
    blocks: Vec<TriBlock>,
    /// Greatest absolute coordinates of the triangles.
    reach: DVec3,
}

/// Where a part is in one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigidPlace {
    part_from_world: DMat3,
    origin: DVec3,
    /// By how much boxes are widened for rays from the world's origin, and by how much more a unit that the origin of a ray is away from it.
    margin: DVec3,
    margin_per_unit: DVec3,
}

impl RigidTree {
    /// Builds over triangles whose positions are those of the part, in the current rayon pool.
    ///
    /// # Errors
    /// When an index is out of range or there are more than 2^28 triangles.
    pub(crate) fn build(prims: &Triangles<'_>) -> Result<Self, BuildError> {
        check_indices("rigid", prims, MAX_PRIMS - 1)?;
        let settings = topology::Settings { cut: Cut::Sah, bins: 32, leaf: BLOCK };
        let binary = topology::build(prims, &settings);
        let wide = collapse(&binary);
        let mut out = Self { nodes: vec![Eight::EMPTY; wide.len()], blocks: Vec::new(), reach: DVec3::ZERO };
        let mut boxes = vec![Aabb::EMPTY; wide.len()];
        for (number, children) in wide.iter().enumerate().rev() {
            for (slot, child) in children.iter().enumerate() {
                let (word, aabb) = match *child {
                    Child::None => continue,
                    Child::Inner(below) => (below, boxes[below as usize]),
                    Child::Leaf { first, count } => out.leaf(&binary.prims[first as usize..][..count as usize], prims),
                };
                out.nodes[number].put(slot, &aabb, word);
                boxes[number] = boxes[number].union(aabb);
            }
        }
        if let Some(all) = boxes.first().filter(|all| !all.is_empty()) {
            out.reach = all.min.as_dvec3().abs().max(all.max.as_dvec3().abs());
        }
        Ok(out)
    }

    /// Makes the blocks of a leaf; its word and box.
    #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^28 triangles")]
    fn leaf(&mut self, own: &[u32], prims: &Triangles<'_>) -> (u32, Aabb) {
        let (first, count) = (self.blocks.len() as u32, TriBlock::count_for(own.len()) as u32);
        let mut aabb = Aabb::EMPTY;
        for mut block in TriBlock::of(own) {
            aabb = aabb.union(block.refit(prims).aabb);
            self.blocks.push(block);
        }
        (LEAF | (count - 1) << COUNT_SHIFT | first, aabb)
    }

    /// The blocks of a leaf.
    #[inline(always)]
    fn leaf_blocks(&self, word: u32) -> &[TriBlock] {
        let (first, count) = ((word & FIRST) as usize, ((word & !LEAF) >> COUNT_SHIFT) as usize + 1);
        &self.blocks[first..first + count]
    }

    /// At least the greatest coordinate of the triangles.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "coordinates are f32")]
    fn reach32(&self) -> f32 {
        self.reach.max_element() as f32
    }
}

impl RigidPlace {
    /// For a part placed by `world_from_part`, whose vertices in the world lie in `bounds`. `fast` when they were computed in `f32`.
    pub(crate) fn new(tree: &RigidTree, world_from_part: &DAffine3, bounds: Aabb, fast: bool) -> Self {
        let (linear, origin) = (world_from_part.matrix3, world_from_part.translation);
        let inverse = linear.inverse();
        let (size, stretch) = (absolute(&linear), absolute(&inverse));
        let world = bounds.min.as_dvec3().abs().max(bounds.max.as_dvec3().abs());
        // The error of vertices, then of the inverse.
        let terms = size * tree.reach + origin.abs();
        let rounding = if fast { 2.0_f64.powi(-20) } else { 2.0_f64.powi(-50) };
        let vertices = terms * rounding + world * (2.0_f64.powi(-24) * 1.000_001) + DVec3::splat(1e-44);
        let residual = absolute(&(inverse * linear - DMat3::IDENTITY)) + (stretch * size) * 2.0_f64.powi(-50);
        let of_rays = stretch * (origin.abs() + world) * 2.0_f64.powi(-49);
        let margin = (residual * tree.reach + stretch * vertices + of_rays) * 1.000_001;
        let margin_per_unit = stretch * DVec3::ONE * (2.0_f64.powi(-49) * 1.000_001);
        Self { part_from_world: inverse, origin, margin, margin_per_unit }
    }

    /// A ray in the part's space, with its margin.
    #[inline(always)]
    fn localize(&self, ray: &TravRay) -> LocalRay {
        let range = ray.range();
        let (origin, dir) = (range.origin.as_dvec3(), range.dir.as_dvec3());
        let from = self.part_from_world * (origin - self.origin);
        let dir = self.part_from_world * dir + DVec3::ZERO;
        LocalRay { from, dir, margin: self.margin + self.margin_per_unit * origin.abs().max_element() }
    }
}

fn absolute(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// A line that passes within the margin, axis by axis, of where the ray is at the same `t`, as far as that is in the part.
#[derive(Clone, Copy, Debug)]
struct LocalRay {
    from: DVec3,
    dir: DVec3,
    margin: DVec3,
}

#[cfg(test)]
mod tests;
