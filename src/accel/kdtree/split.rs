//! Where to split a node.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places of bins saturate and are clamped; planes are rounded to f32"
)]

use super::build::{Params, Ref};
use crate::{accel::sah::half_area, geom::Aabb};

/// Nodes of at most this many objects are split at the best of all faces of their boxes.
const SWEEP: usize = 96;

/// Most bins an axis may have.
pub(in crate::accel) const MAX_BINS: usize = 256;

/// What a visit costs, in units of the cost of passing an inner node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::accel) struct Costs {
    /// Of a unit tested.
    pub(in crate::accel) unit: f64,
    /// Objects to a unit.
    pub(in crate::accel) objects: usize,
    /// Part of the cost below that a split which cuts off empty space saves beyond its areas.
    pub(in crate::accel) empty_bonus: f64,
}

impl Costs {
    #[inline(always)]
    pub(in crate::accel) fn leaf(&self, count: usize) -> f64 {
        self.unit * count.div_ceil(self.objects) as f64
    }

    /// Of an inner node whose children have the given counts and areas, the latter relative to the node's.
    #[inline(always)]
    pub(in crate::accel) fn inner(&self, counts: [usize; 2], areas: [f64; 2]) -> f64 {
        let below = areas[0] * self.leaf(counts[0]) + areas[1] * self.leaf(counts[1]);
        let bonus = if counts[0] == 0 || counts[1] == 0 { 1.0 - self.empty_bonus } else { 1.0 };
        1.0 + bonus * below
    }
}

/// A split.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Plan {
    pub(in crate::accel) axis: usize,
    pub(in crate::accel) at: f32,
    /// Objects that lie in the plane go below it.
    pub(in crate::accel) planar_below: bool,
    cost: f64,
}

impl Plan {
    /// The cheapest split that beats a leaf.
    pub(in crate::accel) fn best(refs: &[Ref], cell: Aabb, params: &Params) -> Option<Self> {
        if refs.is_empty() {
            return None;
        }
        let area = half_area(cell);
        if area <= 0.0 {
            return None;
        }
        let mut search = Search { cell, area, count: refs.len(), costs: &params.costs, best: None };
        search.faces(refs);
        if refs.len() <= SWEEP {
            search.sweep(refs);
        } else {
            search.binned(refs, params.bins);
        }
        search.best.filter(|plan| plan.cost < params.costs.leaf(refs.len()))
    }
}

struct Search<'a> {
    cell: Aabb,
    area: f64,
    count: usize,
    costs: &'a Costs,
    best: Option<Plan>,
}

impl Search<'_> {
    /// Notes a plane with as many objects below and above it, which must not be on the cell's faces.
    #[inline(always)]
    fn offer(&mut self, axis: usize, at: f32, counts: [usize; 2], planar_below: bool) {
        if at <= self.cell.min[axis] || at >= self.cell.max[axis] {
            return;
        }
        let e = self.cell.max.as_dvec3() - self.cell.min.as_dvec3();
        let (b, c) = (e[(axis + 1) % 3], e[(axis + 2) % 3]);
        let below = f64::from(at) - f64::from(self.cell.min[axis]);
        let half = |a: f64| (a * (b + c) + b * c) / self.area;
        let cost = self.costs.inner(counts, [half(below), half(e[axis] - below)]);
        if self.best.is_none_or(|best| cost < best.cost) {
            self.best = Some(Plan { axis, at, planar_below, cost });
        }
    }

    /// The faces of the box around the contents: splits that cut off empty space only.
    fn faces(&mut self, refs: &[Ref]) {
        let content = super::build::bounds(refs);
        for axis in 0..3 {
            let (mut low, mut high) = (content.min[axis], content.max[axis]);
            if low >= high {
                // A cut at flat contents would leave the space on one side of them; one beside them leaves a slice.
                (low, high) = (low.next_down(), high.next_up());
            }
            self.offer(axis, low, [0, self.count], false);
            self.offer(axis, high, [self.count, 0], true);
        }
    }

    /// Every face of every box.
    fn sweep(&mut self, refs: &[Ref]) {
        let mut rows = [[0.0_f32; SWEEP]; 3];
        for axis in 0..3 {
            let [mins, maxs, planes] = &mut rows;
            let mut planar = 0;
            for (i, r) in refs.iter().enumerate() {
                (mins[i], maxs[i]) = (r.aabb.min[axis], r.aabb.max[axis]);
                if mins[i] >= maxs[i] {
                    planes[planar] = mins[i];
                    planar += 1;
                }
            }
            let (mins, maxs, planes) = (&mut mins[..refs.len()], &mut maxs[..refs.len()], &mut planes[..planar]);
            for row in [&mut *mins, &mut *maxs, &mut *planes] {
                row.sort_unstable_by(f32::total_cmp);
            }
            self.sweep_axis(axis, mins, maxs, planes);
        }
    }

    /// Sorted lower faces, upper faces, and places of flat objects.
    fn sweep_axis(&mut self, axis: usize, mins: &[f32], maxs: &[f32], planes: &[f32]) {
        let count = mins.len();
        // Objects that begin before the plane, end at or before it, and lie in or before it.
        let (mut begun, mut ended, mut flat) = (0, 0, 0);
        let (mut next_min, mut next_max) = (0, 0);
        while next_min < count || next_max < count {
            let at = match (mins.get(next_min), maxs.get(next_max)) {
                (Some(&a), Some(&b)) => a.min(b),
                (Some(&a), None) => a,
                (None, Some(&b)) => b,
                (None, None) => break,
            };
            while begun < count && mins[begun] < at {
                begun += 1;
            }
            while ended < count && maxs[ended] <= at {
                ended += 1;
            }
            let first_flat = flat;
            while flat < planes.len() && planes[flat] <= at {
                flat += 1;
            }
            let planar = flat - first_flat;
            let (below, above) = (begun, count - ended);
            self.offer(axis, at, [below + planar, above], true);
            if planar > 0 {
                self.offer(axis, at, [below, above + planar], false);
            }
            while next_min < count && mins[next_min] <= at {
                next_min += 1;
            }
            while next_max < count && maxs[next_max] <= at {
                next_max += 1;
            }
        }
    }

    /// The planes between bins of equal width.
    fn binned(&mut self, refs: &[Ref], bins: usize) {
        let mut ends = [[[0_u32; MAX_BINS]; 2]; 3];
        let e = self.cell.max.as_dvec3() - self.cell.min.as_dvec3();
        // An extent of 0 has no planes; infinity times 0 below would be NaN, which is bin 0.
        let scale = (bins as f64) / e;
        let low = self.cell.min.as_dvec3();
        let last = bins - 1;
        for r in refs {
            let first = (r.aabb.min.as_dvec3() - low) * scale;
            let end = (r.aabb.max.as_dvec3() - low) * scale;
            for axis in 0..3 {
                let from = (first[axis] as usize).min(last);
                // A box that ends on a plane is below it.
                let to = (-((-end[axis]).floor()) as usize).saturating_sub(1).clamp(from, last);
                ends[axis][0][from] += 1;
                ends[axis][1][to] += 1;
            }
        }
        for (axis, [begins, stops]) in ends.iter().enumerate() {
            if e[axis] <= 0.0 {
                continue;
            }
            let (mut below, mut above) = (0, self.count);
            for i in 1..bins {
                below += begins[i - 1] as usize;
                above -= stops[i - 1] as usize;
                let at = (low[axis] + e[axis] * (i as f64 / bins as f64)) as f32;
                self.offer(axis, at, [below, above], true);
            }
        }
    }
}
