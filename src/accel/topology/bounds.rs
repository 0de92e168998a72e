//! Boxes and triangle references in the form that builds read fast.

use glam::{Vec3A, Vec4};
use rayon::prelude::*;

use super::CHUNK;
use crate::geom::Triangles;

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
    #[inline(always)]
    pub(super) fn new(prims: &Triangles<'_>, id: u32) -> Self {
        // Without closures, which stay calls here.
        let [a, b, c] = prims.indices[id as usize];
        let (a, b, c) = (prims.positions[a as usize], prims.positions[b as usize], prims.positions[c as usize]);
        let (a, b, c) = (Vec3A::from(a), Vec3A::from(b), Vec3A::from(c));
        // A product with 0 is 0 unless the factor is infinite or NaN.
        let is_finite = (a * 0.0 + b * 0.0) + c * 0.0 == Vec3A::ZERO;
        let (min, max) =
            if is_finite { (a.min(b).min(c), a.max(b).max(c)) } else { (Vec3A::INFINITY, Vec3A::NEG_INFINITY) };
        Self { min: min.extend(f32::from_bits(NORMAL | id)), max: max.extend(0.0) }
    }

    #[inline(always)]
    pub(super) fn id(&self) -> u32 {
        self.min.w.to_bits() & !NORMAL
    }

    /// With every coordinate times `factor`.
    #[inline(always)]
    fn scaled(&self, factor: f32) -> Self {
        let mut min = self.min * factor;
        min.w = self.min.w;
        Self { min, max: self.max * factor }
    }

    #[inline(always)]
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { min: Vec3A::from_vec4(self.min), max: Vec3A::from_vec4(self.max) }
    }

    /// True for a triangle that is never hit.
    #[inline(always)]
    pub(super) fn is_absent(&self) -> bool {
        self.min.x > self.max.x
    }

    /// The box; a point for a triangle that is never hit.
    #[inline(always)]
    pub(super) fn present_bounds(&self) -> Bounds {
        if self.is_absent() { Bounds { min: Vec3A::ZERO, max: Vec3A::ZERO } } else { self.bounds() }
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

    /// The box around all.
    pub(super) fn around(refs: &[PrimRef]) -> Self {
        refs.iter().fold(Self::EMPTY, |b, r| b.union(r.bounds()))
    }

    /// The box of the centres.
    pub(super) fn of_centers(refs: &[PrimRef]) -> Self {
        refs.iter().fold(Self::EMPTY, |b, r| b.grown(r.center()))
    }

    /// The same, without triangles that are never hit.
    pub(super) fn of_present_centers(refs: &[PrimRef]) -> Self {
        let mut all = Self::EMPTY;
        for prim in refs {
            if !prim.is_absent() {
                all = all.grown(prim.center());
            }
        }
        all
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

/// Coordinates whose squares are far from both ends of what f32 holds.
const ORDINARY: std::ops::Range<f32> = 1e-9..1e9;

/// Makes coordinates ordinary where they are not, so that areas neither overflow nor vanish.
pub(super) fn normalize(refs: &mut [PrimRef]) {
    let reach = |b: Bounds| b.max.abs().max(b.min.abs()).max_element();
    let of = |refs: &[PrimRef]| {
        let all = refs.iter().filter(|r| !r.is_absent()).fold(Bounds::EMPTY, |b, r| b.union(r.bounds()));
        if all.is_empty() { 0.0 } else { reach(all) }
    };
    let reach = reduce(refs, of, f32::max);
    if reach > 0.0 && !ORDINARY.contains(&reach) {
        // The power of two with the negative exponent, or next to it: digits stay as they are.
        let exponent = reach.max(f32::MIN_POSITIVE).to_bits() & (255 << 23);
        let factor = f32::from_bits((254 << 23) - exponent).max(f32::MIN_POSITIVE);
        refs.par_iter_mut().for_each(|r| *r = r.scaled(factor));
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
