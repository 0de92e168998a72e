//! Boxes and triangle references in the form that builds read fast.

use rayon::prelude::*;

use super::CHUNK;
use crate::{
    geom::Triangles,
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// A box and a word: the lower corner, the word, the upper corner times -1, and 0. The union of two is the minimum of all numbers.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds([f32; 8]);

/// A triangle's box, with its number in the bits of the word.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(super) struct PrimRef(Bounds);

const _: () = assert!(size_of::<PrimRef>() == 32);

/// Set in the bits of the number, so that they are those of a normal float: arithmetic takes the word along, and is slow for others.
const NORMAL: u32 = 1 << 30;

/// Numbers are below this.
pub(super) const MAX_NUMBER: u32 = 1 << 28;

/// Beyond all coordinates after [`normalize`], and their sums; its square is finite.
const FAR: f32 = 1e18;

/// Coordinates whose squares are far from both ends of what f32 holds.
const ORDINARY: std::ops::Range<f32> = 1e-9..1e9;

/// `f32::min` in one instruction; no number here is NaN.
#[inline(always)]
pub(super) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl PrimRef {
    /// Without closures, which stay calls here.
    #[inline(always)]
    pub(super) fn new(prims: &Triangles<'_>, id: u32) -> Self {
        let [a, b, c] = prims.indices[id as usize];
        let (a, b, c) = (prims.positions[a as usize], prims.positions[b as usize], prims.positions[c as usize]);
        let (a, b, c) = (glam::Vec3A::from(a), glam::Vec3A::from(b), glam::Vec3A::from(c));
        // A product with 0 is 0 unless the factor is infinite or NaN.
        let is_finite = (a * 0.0 + b * 0.0) + c * 0.0 == glam::Vec3A::ZERO;
        let word = f32::from_bits(NORMAL | id);
        if !is_finite {
            return Self(Bounds([FAR, FAR, FAR, word, FAR, FAR, FAR, 0.0]));
        }
        let ([x0, y0, z0], [x1, y1, z1]) = (a.min(b).min(c).to_array(), a.max(b).max(c).to_array());
        Self(Bounds([x0, y0, z0, word, -x1, -y1, -z1, 0.0]))
    }

    #[inline(always)]
    pub(super) fn id(&self) -> u32 {
        self.0.0[3].to_bits() & !NORMAL
    }

    /// The box, empty for a triangle that is never hit; the word is not to be used.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Bounds {
        self.0
    }

    /// True for a triangle that is never hit.
    #[inline(always)]
    pub(super) fn is_absent(&self) -> bool {
        self.0.is_empty()
    }

    /// Twice the midpoint of the box; 0 for a triangle that is never hit.
    #[inline(always)]
    pub(super) fn center(&self) -> [f32; 4] {
        self.0.center()
    }

    /// With every coordinate times `factor`.
    #[inline(always)]
    fn scaled(&self, factor: f32) -> Self {
        let mut out = *self;
        if !self.is_absent() {
            for lane in [0, 1, 2, 4, 5, 6] {
                out.0.0[lane] *= factor;
            }
        }
        out
    }
}

impl Bounds {
    pub(super) const EMPTY: Self = Self([FAR; 8]);

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        let mut out = self;
        for lane in 0..8 {
            out.0[lane] = lesser(self.0[lane], other.0[lane]);
        }
        out
    }

    /// The box around this one and a point, the fourth number of which does not count.
    #[inline(always)]
    fn grown(self, [x, y, z, _]: [f32; 4]) -> Self {
        self.union(Self([x, y, z, 0.0, -x, -y, -z, 0.0]))
    }

    #[inline(always)]
    pub(super) fn low(&self) -> [f32; 3] {
        [self.0[0], self.0[1], self.0[2]]
    }

    /// The box around all.
    #[inline(always)]
    pub(super) fn around(refs: &[PrimRef]) -> Self {
        let mut all = Self::EMPTY;
        for prim in refs {
            all = all.union(prim.0);
        }
        all
    }

    /// The box of the centres.
    #[inline(always)]
    pub(super) fn of_centers(refs: &[PrimRef]) -> Self {
        let mut all = Self::EMPTY;
        for prim in refs {
            all = all.grown(prim.center());
        }
        all
    }

    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.0[0] + self.0[4] > 0.0
    }

    /// Twice the midpoint, and a number of no meaning.
    #[inline(always)]
    pub(super) fn center(&self) -> [f32; 4] {
        let [x0, y0, z0, w0, x1, y1, z1, w1] = self.0;
        [x0 - x1, y0 - y1, z0 - z1, w0 - w1]
    }

    /// What the box measures along each axis, times -1; below 0 or 0, also for an empty box.
    #[inline(always)]
    fn extents(&self) -> [f32; 4] {
        let [x0, y0, z0, w0, x1, y1, z1, w1] = self.0;
        [lesser(x0 + x1, 0.0), lesser(y0 + y1, 0.0), lesser(z0 + z1, 0.0), lesser(w0 + w1, 0.0)]
    }

    /// What the box measures along an axis; 0 for an empty box.
    #[inline(always)]
    pub(super) fn extent(&self, axis: usize) -> f32 {
        -self.extents()[axis]
    }

    /// Half the surface area; 0 for an empty box.
    #[inline(always)]
    pub(super) fn half_area(&self) -> f32 {
        let [x, y, z, _] = self.extents();
        x * (y + z) + y * z
    }

    /// The first of the axes with the greatest extent.
    pub(super) fn longest_axis(&self) -> usize {
        let [x, y, z, _] = self.extents();
        if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        }
    }
}

/// Makes coordinates ordinary where they are not, so that areas neither overflow nor vanish; the box of the centres of triangles that may be hit.
pub(super) fn normalize(refs: &mut [PrimRef]) -> Bounds {
    let measure = |refs: &mut [PrimRef]| reduce(refs, Extent::of, Extent::union);
    let found = measure(refs);
    let reach = found.reach();
    if reach == 0.0 || ORDINARY.contains(&reach) {
        return found.centers;
    }
    // The power of two with the negative exponent, or next to it: digits stay as they are.
    let exponent = reach.max(f32::MIN_POSITIVE).to_bits() & (255 << 23);
    let factor = f32::from_bits((254 << 23) - exponent).max(f32::MIN_POSITIVE);
    refs.par_iter_mut().for_each(|r| *r = r.scaled(factor));
    measure(refs).centers
}

/// Where triangles that may be hit are.
struct Extent {
    /// Greatest absolute numbers of their boxes, and of their words.
    most: [f32; 8],
    centers: Bounds,
}

impl Extent {
    fn of(refs: &[PrimRef]) -> Self {
        let mut out = Self { most: [0.0; 8], centers: Bounds::EMPTY };
        for prim in refs {
            if !prim.is_absent() {
                for lane in 0..8 {
                    out.most[lane] = greater(out.most[lane], prim.0.0[lane].abs());
                }
                out.centers = out.centers.grown(prim.center());
            }
        }
        out
    }

    fn union(self, Self { mut most, centers }: Self) -> Self {
        for (most, own) in most.iter_mut().zip(self.most) {
            *most = greater(*most, own);
        }
        Self { most, centers: self.centers.union(centers) }
    }

    fn reach(&self) -> f32 {
        let [x0, y0, z0, _, x1, y1, z1, _] = self.most;
        x0.max(y0).max(z0).max(x1).max(y1).max(z1)
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

/// A choice among references.
pub(super) trait Choose {
    /// True for those that are to come first.
    fn chooses(&self, prim: &PrimRef) -> bool;
}

/// [`partition`].
struct Partition<'a, C> {
    refs: &'a mut [PrimRef],
    choice: &'a C,
}

impl<C: Choose> Task for Partition<'_, C> {
    type Output = (usize, [Bounds; 2]);

    #[inline(always)]
    fn run<S: Simd>(self) -> (usize, [Bounds; 2]) {
        let Self { refs, choice } = self;
        let mut middle = 0;
        for i in 0..refs.len() {
            // No branch: it would be mispredicted every other time.
            let (prim, other) = (refs[i], refs[middle]);
            let is_chosen = choice.chooses(&prim);
            refs[i] = other;
            refs[middle] = prim;
            middle += usize::from(is_chosen);
        }
        let (first, second) = refs.split_at(middle);
        (middle, [Bounds::of_centers(first), Bounds::of_centers(second)])
    }
}

/// Moves the chosen elements to the front; returns their number and the boxes of the centres of both parts.
pub(super) fn partition(refs: &mut [PrimRef], choice: &impl Choose) -> (usize, [Bounds; 2]) {
    dispatch(SimdLevel::best(), Partition { refs, choice })
}
