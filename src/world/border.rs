//! Where a run of boxes in bins is cut, for trees over boxes.

use crate::geom::Aabb;

/// Bins of a cut.
pub(crate) const BINS: usize = 12;

/// The bin that the second half begins with: least area times leaves of `leaf` boxes, earliest first. `boxes` gives the bin of each.
#[inline(always)]
pub(crate) fn cheapest_border(boxes: impl Iterator<Item = (usize, Aabb)>, leaf: usize) -> usize {
    let mut bins = [(Aabb::EMPTY, 0_usize); BINS];
    for (bin, aabb) in boxes {
        let (around, count) = &mut bins[bin];
        *around = around.union(aabb);
        *count += 1;
    }
    let weigh = |(aabb, count): (Aabb, usize)| f64::from(aabb.half_area()) * count.div_ceil(leaf) as f64;
    let join = |a: (Aabb, usize), b: (Aabb, usize)| (a.0.union(b.0), a.1 + b.1);
    let mut right = [0.0; BINS];
    let mut sum = (Aabb::EMPTY, 0);
    for at in (1..BINS).rev() {
        sum = join(sum, bins[at]);
        right[at] = weigh(sum);
    }
    let mut best = (f64::INFINITY, BINS / 2);
    let mut left = (Aabb::EMPTY, 0);
    for at in 1..BINS {
        left = join(left, bins[at - 1]);
        let cost = weigh(left) + right[at];
        if cost < best.0 {
            best = (cost, at);
        }
    }
    best.1
}
