//! Cuts of large nodes: triangles fall into bins by their centres, cuts are tried between bins.

#![expect(clippy::cast_possible_truncation, reason = "triangles are counted in u32")]

use super::{
    Halves, Settings,
    bounds::{Bounds, Choose, PrimRef, greater, lesser, partition, reduce},
};
use crate::simd::{Simd, SimdLevel, Task, dispatch};

/// Cuts `refs` where the surface-area cost is least, over `bins` bins of all three axes; `None` when every centre falls into one bin.
pub(super) fn split<const N: usize>(
    refs: &mut [PrimRef],
    centers: &Bounds,
    bins: usize,
    settings: &Settings,
) -> Option<Halves> {
    let binning = Binning::new(centers, bins);
    let fill = |refs: &[PrimRef]| dispatch(SimdLevel::best(), Fill::<N> { refs, binning: &binning });
    let filled = reduce(refs, fill, Bins::merge);
    let (axis, bin, area) =
        dispatch(SimdLevel::best(), Best { bins: &filled, count: bins, total: refs.len(), settings })?;
    let (middle, centers) = partition(refs, &Below { binning: &binning, axis, bin });
    Some(Halves { middle, axis, centers, area })
}

/// How centres map to bins.
struct Binning {
    low: [f32; 4],
    scale: [f32; 4],
    last: f32,
}

/// Numbers from here on have no fraction: the lowest bits of their form are those of the whole number that was added.
const WHOLE: f32 = 8_388_608.0;

impl Binning {
    fn new(centers: &Bounds, bins: usize) -> Self {
        let [x, y, z] = centers.low();
        // An extent of 0 puts everything into one bin.
        let scale = |axis: usize| {
            let scale = bins as f32 / centers.extent(axis);
            if scale.is_finite() { scale } else { 0.0 }
        };
        Self { low: [x, y, z, 0.0], scale: [scale(0), scale(1), scale(2), 0.0], last: (bins - 1) as f32 }
    }

    /// The bins along the axes, and a number of no meaning. Half is taken away before the numbers are rounded to the nearest.
    #[inline(always)]
    fn bins_of(&self, center: [f32; 4]) -> [u32; 4] {
        let mut bins = [0; 4];
        for axis in 0..4 {
            let place = (center[axis] - self.low[axis]) * self.scale[axis] - 0.5;
            bins[axis] = (lesser(greater(place, 0.0), self.last) + WHOLE).to_bits() & 0xff;
        }
        bins
    }
}

/// Chooses what is below a bin.
struct Below<'a> {
    binning: &'a Binning,
    axis: usize,
    bin: usize,
}

impl Choose for Below<'_> {
    #[inline(always)]
    fn chooses(&self, prim: &PrimRef) -> bool {
        self.binning.bins_of(prim.center())[self.axis & 3] < self.bin as u32
    }
}

struct Bins<const N: usize> {
    bounds: [[Bounds; N]; 3],
    counts: [[u32; N]; 3],
}

/// Fills bins.
struct Fill<'a, const N: usize> {
    refs: &'a [PrimRef],
    binning: &'a Binning,
}

impl<const N: usize> Task for Fill<'_, N> {
    type Output = Bins<N>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Bins<N> {
        let mut out = Bins { bounds: [[Bounds::EMPTY; N]; 3], counts: [[0; N]; 3] };
        for prim in self.refs {
            let places = self.binning.bins_of(prim.center());
            for (axis, &place) in places[..3].iter().enumerate() {
                let bin = (place as usize).min(N - 1);
                out.bounds[axis][bin] = out.bounds[axis][bin].union(prim.bounds());
                out.counts[axis][bin] += 1;
            }
        }
        out
    }
}

impl<const N: usize> Bins<N> {
    fn merge(mut self, Self { bounds, counts }: Self) -> Self {
        for axis in 0..3 {
            for bin in 0..N {
                self.bounds[axis][bin] = self.bounds[axis][bin].union(bounds[axis][bin]);
                self.counts[axis][bin] += counts[axis][bin];
            }
        }
        self
    }
}

/// Finds the axis and bin before which to cut, and half the area of the box around all.
struct Best<'a, const N: usize> {
    bins: &'a Bins<N>,
    count: usize,
    total: usize,
    settings: &'a Settings,
}

impl<const N: usize> Task for Best<'_, N> {
    type Output = Option<(usize, usize, f32)>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Option<(usize, usize, f32)> {
        let mut best = None;
        let mut least = f32::INFINITY;
        let mut area = 0.0;
        let total = self.total as u32;
        for axis in 0..3 {
            let (bounds, counts) = (&self.bins.bounds[axis][..self.count], &self.bins.counts[axis][..self.count]);
            let mut suffix = [0.0; N];
            let mut right = Bounds::EMPTY;
            for i in (1..self.count).rev() {
                right = right.union(bounds[i]);
                suffix[i] = right.half_area();
            }
            if axis == 0 {
                area = right.union(bounds[0]).half_area();
            }
            let (mut left, mut count) = (Bounds::EMPTY, 0);
            for i in 1..self.count {
                left = left.union(bounds[i - 1]);
                count += counts[i - 1];
                let cost = left.half_area() * self.settings.leaf_cost(count)
                    + suffix[i] * self.settings.leaf_cost(total - count);
                if count != 0 && count != total && (best.is_none() || cost < least) {
                    (best, least) = (Some((axis, i)), cost);
                }
            }
        }
        best.map(|(axis, bin)| (axis, bin, area))
    }
}
