//! Boxes and triangle references in the form that builds read fast.

use glam::{Vec3A, Vec4};
use rayon::prelude::*;

use super::CHUNK;
use crate::geom::{PrimId, Triangles};

/// A triangle's box and number, 32 bytes: the number is in the bits of `min`'s fourth lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct PrimRef {
    min: Vec4,
    max: Vec4,
}

const _: () = assert!(size_of::<PrimRef>() == 32);

/// Set in the bits of the number, so that they are those of a normal float: arithmetic takes the fourth lane along, and is slow for others.
const NORMAL: u32 = 1 << 30;

/// Numbers are below this.
pub(super) const MAX_NUMBER: u32 = 1 << 28;

impl PrimRef {
    pub(super) fn new(prims: &Triangles<'_>, id: u32) -> Self {
        let aabb = prims.finite_aabb(PrimId(id));
        Self { min: aabb.min.extend(f32::from_bits(NORMAL | id)), max: aabb.max.extend(0.0) }
    }

    #[inline(always)]
    pub(super) fn id(&self) -> u32 {
        self.min.w.to_bits() & !NORMAL
    }

    #[inline(always)]
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: Vec3A::from_vec4(self.min), max: Vec3A::from_vec4(self.max) }
    }

    /// Midpoint of the box; 0 for a triangle that is never hit.
    #[inline(always)]
    pub(super) fn center(&self) -> Vec3A {
        let Bounds { min, max } = self.bounds();
        if min.x > max.x { Vec3A::ZERO } else { halfway(min, max) }
    }
}

/// Halved first: the sum may overflow.
#[inline(always)]
fn halfway(a: Vec3A, b: Vec3A) -> Vec3A {
    a * 0.5 + b * 0.5
}

/// A box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline(always)]
    pub(super) fn grown(self, point: Vec3A) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The box of the centres.
    pub(super) fn of_centers(refs: &[PrimRef]) -> Self {
        refs.iter().fold(Self::EMPTY, |b, r| b.grown(r.center()))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }

    pub(super) fn center(&self) -> Vec3A {
        halfway(self.min, self.max)
    }

    /// Half the surface area; 0 for an empty box. The products are f64, which does not overflow.
    #[inline(always)]
    pub(super) fn half_area(self) -> f64 {
        let e = self.max - self.min;
        let (x, y, z) = (f64::from(e.x), f64::from(e.y), f64::from(e.z));
        if x < 0.0 { 0.0 } else { x * (y + z) + y * z }
    }

    /// The first of the axes with the greatest extent.
    pub(super) fn longest_axis(&self) -> usize {
        let e = self.max.as_dvec3() - self.min.as_dvec3();
        if e.x >= e.y && e.x >= e.z {
            0
        } else if e.y >= e.z {
            1
        } else {
            2
        }
    }
}

/// Runs `work` over chunks of a fixed size and merges the results; the order must not matter to `merge`.
pub(super) fn reduce<T: Send>(
    refs: &[PrimRef],
    work: impl Fn(&[PrimRef]) -> T + Sync,
    merge: impl Fn(T, T) -> T + Sync + Send,
) -> T {
    if refs.len() <= 2 * CHUNK {
        return work(refs);
    }
    refs.par_chunks(CHUNK).map(&work).reduce_with(&merge).unwrap_or_else(|| work(&[]))
}

/// Moves the elements that satisfy `first` to the front, in one pass from both ends; returns their number and the boxes of
/// the centres of both parts.
#[inline(always)]
pub(super) fn partition(refs: &mut [PrimRef], first: impl Fn(&PrimRef) -> bool) -> (usize, [Bounds; 2]) {
    let (mut low, mut high) = (0, refs.len());
    let [mut left, mut right] = [Bounds::EMPTY; 2];
    while low < high {
        let prim = refs[low];
        if first(&prim) {
            left = left.grown(prim.center());
            low += 1;
        } else {
            right = right.grown(prim.center());
            high -= 1;
            refs.swap(low, high);
        }
    }
    (low, [left, right])
}
