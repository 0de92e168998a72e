//! Cuts of large nodes: triangles fall into bins by their centres, cuts are tried between bins.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places of bins saturate and are clamped; triangles are counted in u32"
)]

use glam::Vec3A;

use super::{
    Halves, Settings,
    bounds::{Bounds, PrimRef, partition, reduce},
};

/// Cuts `refs` where the surface-area cost is least, over `bins` bins of all three axes; `None` when every centre falls into one bin.
pub(super) fn split<const N: usize>(
    refs: &mut [PrimRef],
    centers: &Bounds,
    bins: usize,
    settings: &Settings,
) -> Option<Halves> {
    let binning = Binning::new(centers, bins);
    let filled = reduce(refs, |refs| Bins::<N>::fill(refs, &binning), Bins::merge);
    let (axis, bin) = filled.best(bins, refs.len(), settings)?;
    let area = filled.bounds[0][..bins].iter().fold(Bounds::EMPTY, |b, &bin| b.union(bin)).half_area() as f32;
    let (middle, centers) = partition(refs, |r| binning.bin_of(r.center(), axis) < bin);
    Some(Halves { middle, axis, centers, area })
}

/// How centres map to bins.
struct Binning {
    low: Vec3A,
    scale: Vec3A,
    last: u32,
}

impl Binning {
    fn new(centers: &Bounds, bins: usize) -> Self {
        let extent = centers.max - centers.min;
        // An extent of 0, or one that overflows, puts everything into one bin.
        let scale = |e: f32| {
            let s = bins as f32 / e;
            if e.is_finite() && s.is_finite() { s } else { 0.0 }
        };
        let scale = Vec3A::new(scale(extent.x), scale(extent.y), scale(extent.z));
        Self { low: centers.min, scale, last: bins as u32 - 1 }
    }

    #[inline(always)]
    fn place(&self, center: Vec3A) -> Vec3A {
        (center - self.low) * self.scale
    }

    /// Float to integer saturates, NaN becomes 0.
    #[inline(always)]
    fn clamp(&self, place: f32) -> usize {
        (place as u32).min(self.last) as usize
    }

    #[inline(always)]
    fn bin_of(&self, center: Vec3A, axis: usize) -> usize {
        self.clamp(self.place(center)[axis])
    }
}

struct Bins<const N: usize> {
    bounds: [[Bounds; N]; 3],
    counts: [[u32; N]; 3],
}

impl<const N: usize> Bins<N> {
    fn fill(refs: &[PrimRef], binning: &Binning) -> Self {
        let mut out = Self { bounds: [[Bounds::EMPTY; N]; 3], counts: [[0; N]; 3] };
        for prim in refs {
            let (bounds, place) = (prim.bounds(), binning.place(prim.center()));
            for axis in 0..3 {
                let bin = binning.clamp(place[axis]).min(N - 1);
                let slot = &mut out.bounds[axis][bin];
                *slot = slot.union(bounds);
                out.counts[axis][bin] += 1;
            }
        }
        out
    }

    fn merge(mut self, Self { bounds, counts }: Self) -> Self {
        for axis in 0..3 {
            for bin in 0..N {
                self.bounds[axis][bin] = self.bounds[axis][bin].union(bounds[axis][bin]);
                self.counts[axis][bin] += counts[axis][bin];
            }
        }
        self
    }

    /// The axis and bin before which to cut.
    fn best(&self, bins: usize, total: usize, settings: &Settings) -> Option<(usize, usize)> {
        let mut best = None;
        let mut least = f64::INFINITY;
        for axis in 0..3 {
            let (bounds, counts) = (&self.bounds[axis][..bins], &self.counts[axis][..bins]);
            let mut suffix = [0.0; N];
            let mut right = Bounds::EMPTY;
            for i in (1..bins).rev() {
                right = right.union(bounds[i]);
                suffix[i] = right.half_area();
            }
            let (mut left, mut count) = (Bounds::EMPTY, 0);
            for i in 1..bins {
                left = left.union(bounds[i - 1]);
                count += counts[i - 1] as usize;
                if count == 0 || count == total {
                    continue;
                }
                let cost = left.half_area() * settings.leaf_cost(count) + suffix[i] * settings.leaf_cost(total - count);
                if best.is_none() || cost < least {
                    (best, least) = (Some((axis, i)), cost);
                }
            }
        }
        best
    }
}
