use glam::{Vec3, Vec3A};

use super::{Aabb, PrimId};

/// A borrowed indexed triangle mesh: what structures are built over and refitted to.
///
/// Every index must be below `positions.len()`; builders check that once. Triangles of zero area are legal
/// and never hit.
#[derive(Clone, Copy, Debug)]
pub struct Triangles<'a> {
    /// Vertices, N x 3, world space.
    pub positions: &'a [Vec3],
    /// Corners of each triangle, M x 3; a triangle's number is its place here.
    pub indices: &'a [[u32; 3]],
    /// Changes when `indices` does; equal epochs mean that a refit is possible.
    pub topology_epoch: u64,
}

impl Triangles<'_> {
    /// Number of triangles.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// True without triangles.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The three corners of a triangle. Panics when `prim` is out of range.
    #[inline(always)]
    pub fn corners(&self, prim: PrimId) -> [Vec3; 3] {
        self.indices[prim.0 as usize].map(|i| self.positions[i as usize])
    }

    /// The least box around a triangle.
    #[inline(always)]
    pub fn aabb(&self, prim: PrimId) -> Aabb {
        let [a, b, c] = self.corners(prim);
        Aabb { min: a.min(b).min(c), max: a.max(b).max(c) }
    }

    /// The least box around a triangle, empty when a corner is not finite: such triangles are never hit.
    #[inline(always)]
    pub fn finite_aabb(&self, prim: PrimId) -> Aabb {
        let [a, b, c] = self.corners(prim).map(Vec3A::from);
        // A product with 0 is 0 unless the factor is infinite or NaN.
        if (a * 0.0 + b * 0.0) + c * 0.0 == Vec3A::ZERO {
            Aabb { min: a.min(b).min(c).into(), max: a.max(b).max(c).into() }
        } else {
            Aabb::EMPTY
        }
    }
}
