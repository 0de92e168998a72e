//! Cells of equal size, and how a ray steps through them; shared by `grid` and `grug`.
//!
//! # Why no cell is lost
//! Plane k of an axis is the f64 number `low + k * width`, and a ray crosses it at `t = (plane - o) * inv`, rounded: computed anew at each
//! crossing, never accumulated. Both are monotone in k, so at every t the walk is, on each axis, in the cell between the last crossing
//! at or before t and the first one after it. The roundings of a crossing move it by less than `2^-51 * |plane - o|` in space,
//! which [`Lattice::is_near`] keeps below half of [`Lattice::pad`], and the start of a walk is off by no more. So the exact point
//! at t lies within `pad` of the cell that the walk is in at t, and objects are entered into every cell that they come that
//! near to. Ties are crossed in the order x, y, z. Rays from too far away take [`Lattice::bisect`], which needs no such bound.
//!
//! # Source
//! Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of cells are small; float to integer saturates and is clamped"
)]

use crate::{
    accel::{
        leaves::{Line, NARROW, WIDEN},
        shapes::round_down,
    },
    geom::Aabb,
};

/// Most cells along an axis.
pub(in crate::accel) const MAX_CELLS: u32 = 4096;

/// Distance of objects to cells within which they are entered, as a part of a cell.
const PAD: f64 = 1.0 / 4096.0;

/// Distance of planes from a ray's origin, in cells, up to which crossings are exact within half of [`PAD`]: 2^-51 * 2^38 = 2^-13.
const NEAR: f64 = (1_u64 << 38) as f64;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::accel) struct Lattice {
    low: [f64; 3],
    width: [f64; 3],
    inv_width: [f64; 3],
    pub(in crate::accel) cells: [u32; 3],
    pad: [f64; 3],
    /// Greatest distance of an origin from `low`; infinite on axes without a plane.
    near: [f64; 3],
}

impl Lattice {
    /// `cells` along each axis, at least 1, between two corners; where those do not differ, `cells` must be 1.
    pub(in crate::accel) fn new(low: [f64; 3], high: [f64; 3], cells: [u32; 3]) -> Self {
        let width: [f64; 3] = std::array::from_fn(|i| (high[i] - low[i]) / f64::from(cells[i]));
        let near = |i: usize| if cells[i] > 1 { width[i] * (NEAR - f64::from(cells[i])) } else { f64::INFINITY };
        Self {
            low,
            width,
            inv_width: width.map(|w| if w > 0.0 { 1.0 / w } else { 0.0 }),
            cells,
            pad: width.map(|w| w * PAD),
            near: std::array::from_fn(near),
        }
    }

    /// Plane k of an axis.
    #[inline(always)]
    pub(in crate::accel) fn plane(&self, axis: usize, k: u32) -> f64 {
        self.low[axis] + f64::from(k) * self.width[axis]
    }

    /// The cell at a coordinate, up to a rounding far below `pad`.
    #[inline(always)]
    pub(in crate::accel) fn cell(&self, axis: usize, x: f64) -> u32 {
        (((x - self.low[axis]) * self.inv_width[axis]) as u32).min(self.cells[axis] - 1)
    }

    /// The first and last cells that come near a box.
    pub(in crate::accel) fn range(&self, aabb: &Aabb) -> ([u32; 3], [u32; 3]) {
        let on: [(u32, u32); 3] = std::array::from_fn(|axis| self.range_on(axis, aabb));
        (on.map(|(first, _)| first), on.map(|(_, last)| last))
    }

    /// [`Lattice::range`] on one axis.
    #[inline(always)]
    pub(in crate::accel) fn range_on(&self, axis: usize, aabb: &Aabb) -> (u32, u32) {
        let first = self.cell(axis, f64::from(aabb.min[axis]) - self.pad[axis]);
        (first, self.cell(axis, f64::from(aabb.max[axis]) + self.pad[axis]))
    }

    /// Corners of the box around the cells from `first` to before `end`, grown by twice the distance within which objects belong to them
    /// and rounded outward.
    pub(in crate::accel) fn around_run(&self, first: [u32; 3], end: [u32; 3]) -> ([f32; 3], [f32; 3]) {
        let low = |i: usize| round_down(self.plane(i, first[i]) - self.pad[i] * 2.0);
        let high = |i: usize| -round_down(-(self.plane(i, end[i]) + self.pad[i] * 2.0));
        (std::array::from_fn(low), std::array::from_fn(high))
    }

    /// Midpoint and half extent of a cell grown by twice the distance within which objects belong to it.
    pub(in crate::accel) fn around(&self, cell: [u32; 3]) -> ([f64; 3], [f64; 3]) {
        let middle = |i: usize| self.low[i] + (f64::from(cell[i]) + 0.5) * self.width[i];
        (std::array::from_fn(middle), std::array::from_fn(|i| self.width[i] * 0.5 + self.pad[i] * 2.0))
    }

    /// True when a ray's origin is near enough for [`Dda`].
    #[inline(always)]
    pub(in crate::accel) fn is_near(&self, line: &Line) -> bool {
        (0..3).all(|i| (line.origin[i] - self.low[i]).abs() <= self.near[i])
    }

    /// Visits all cells that the ray may meet within `t0..=t1`, front to back, by halving ranges of cells; `visit` gets the cell and
    /// when the ray may be there, and ends the walk with true.
    pub(in crate::accel) fn bisect(
        &self,
        line: &Line,
        (t0, t1): (f64, f64),
        visit: &mut impl FnMut([u32; 3], f64, f64) -> bool,
    ) -> bool {
        self.halves(line, [0; 3], self.cells, (t0, t1), visit)
    }

    fn halves(
        &self,
        line: &Line,
        first: [u32; 3],
        end: [u32; 3],
        (t0, t1): (f64, f64),
        visit: &mut impl FnMut([u32; 3], f64, f64) -> bool,
    ) -> bool {
        let size: [u32; 3] = std::array::from_fn(|i| end[i] - first[i]);
        let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
        if size[axis] == 1 {
            return visit(first, t0, t1);
        }
        let middle = u32::midpoint(first[axis], end[axis]);
        let t = line.t(axis, self.plane(axis, middle));
        // As in a kd-tree's walk: a NaN fails every comparison.
        let (low, high) = (t * NARROW, t * WIDEN);
        let (mut below_end, mut above_first) = (end, first);
        below_end[axis] = middle;
        above_first[axis] = middle;
        let (below, above) = ((first, below_end), (above_first, end));
        let (near, far) = if line.inv[axis] < 0.0 { (above, below) } else { (below, above) };
        let near_end = if high < t1 { high } else { t1 };
        let far_start = if low > t0 { low } else { t0 };
        let skip_near = high < t0;
        let skip_far = low > t1;
        (!skip_near && self.halves(line, near.0, near.1, (t0, near_end), visit))
            || (!skip_far && self.halves(line, far.0, far.1, (far_start, t1), visit))
    }
}

/// A ray on its way through a lattice.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Dda {
    pub(in crate::accel) cell: [u32; 3],
    /// Planes that are still to be crossed before the last cell; 0 where the ray crosses none.
    left: [u32; 3],
    /// Numbers of the next planes.
    plane: [f64; 3],
    /// When the next planes are crossed; infinite at the last cell.
    next: [f64; 3],
}

impl Dda {
    /// The walk from `t` on.
    #[inline(always)]
    pub(in crate::accel) fn new(lattice: &Lattice, line: &Line, t: f64) -> Self {
        let mut out = Self { cell: [0; 3], left: [0; 3], plane: [0.0; 3], next: [f64::INFINITY; 3] };
        for axis in 0..3 {
            out.cell[axis] = lattice.cell(axis, line.origin[axis] + t * line.dir[axis]);
            out.seat(lattice, line, axis);
        }
        out
    }

    /// Derives all but the cell on an axis.
    #[inline(always)]
    fn seat(&mut self, lattice: &Lattice, line: &Line, axis: usize) {
        let cell = self.cell[axis];
        let (plane, left) =
            if line.inv[axis] < 0.0 { (cell, cell) } else { (cell + 1, lattice.cells[axis] - 1 - cell) };
        self.left[axis] = if line.inv[axis].is_infinite() { 0 } else { left };
        self.plane[axis] = f64::from(plane);
        self.set_next(lattice, line, axis);
    }

    #[inline(always)]
    fn set_next(&mut self, lattice: &Lattice, line: &Line, axis: usize) {
        let t = line.t(axis, lattice.low[axis] + self.plane[axis] * lattice.width[axis]);
        self.next[axis] = if self.left[axis] == 0 { f64::INFINITY } else { t };
    }

    /// The axis of the first crossing to come, and when it is; infinite at the end of the lattice. No branches: which axis comes next is
    /// hard to predict.
    #[inline(always)]
    pub(in crate::accel) fn crossing(&self) -> (usize, f64) {
        let [x, y, z] = self.next;
        let axis = usize::from(y < x);
        let first = if y < x { y } else { x };
        let axis = if z < first { 2 } else { axis };
        (axis, if z < first { z } else { first })
    }

    /// Crosses the plane of an axis whose crossing is finite.
    #[inline(always)]
    pub(in crate::accel) fn cross(&mut self, lattice: &Lattice, line: &Line, axis: usize) {
        let backward = line.inv[axis] < 0.0;
        self.cell[axis] = self.cell[axis].wrapping_add(if backward { u32::MAX } else { 1 });
        self.plane[axis] += if backward { -1.0 } else { 1.0 };
        self.left[axis] -= 1;
        self.set_next(lattice, line, axis);
    }

    /// Goes straight to the state after all crossings before (`t`, `axis`) and that one itself; the cell on `axis` is given.
    #[inline(always)]
    pub(in crate::accel) fn jump(&mut self, lattice: &Lattice, line: &Line, axis: usize, cell: u32, t: f64) {
        self.cell[axis] = cell;
        self.seat(lattice, line, axis);
        for other in (0..3).filter(|&other| other != axis) {
            // A crossing at the same t comes before this one on a lower axis.
            let is_due = |crossing: f64| crossing < t || (crossing <= t && other < axis);
            if !is_due(self.next[other]) {
                continue;
            }
            let backward = line.inv[other] < 0.0;
            let guess = lattice.cell(other, line.origin[other] + t * line.dir[other]);
            let near = self.cell[other];
            self.cell[other] = if backward { guess.min(near) } else { guess.max(near) };
            // The guess may be a cell off either way.
            while self.cell[other] != near && !is_due(self.entered(lattice, line, other)) {
                self.cell[other] = if backward { self.cell[other] + 1 } else { self.cell[other] - 1 };
            }
            self.seat(lattice, line, other);
            while is_due(self.next[other]) {
                self.cross(lattice, line, other);
            }
        }
    }

    /// When the ray entered the cell on an axis.
    #[inline(always)]
    fn entered(&self, lattice: &Lattice, line: &Line, axis: usize) -> f64 {
        let plane = if line.inv[axis] < 0.0 { self.cell[axis] + 1 } else { self.cell[axis] };
        line.t(axis, lattice.plane(axis, plane))
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{accel::TravRay, geom::Ray};

    fn line(origin: Vec3, dir: Vec3) -> Line {
        Line::new(TravRay::new(&Ray::new(origin, dir)).expect("a ray").range())
    }

    fn component() -> impl Strategy<Value = f32> {
        prop_oneof![
            Just(0.0_f32),
            -1.0..1.0_f32,
            (-4_i8..=4).prop_map(|i| f32::from(i) * 0.25),
            Just(1e-30),
            Just(-1e-38)
        ]
    }

    fn vec3() -> impl Strategy<Value = Vec3> {
        (component(), component(), component()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        /// Jumping to any later crossing leads to the state that stepping leads to.
        #[test]
        fn a_jump_ends_where_steps_end(origin in vec3(), dir in vec3(), cells in 1_u32..70, skip in 1_usize..40) {
            prop_assume!(dir != Vec3::ZERO);
            let lattice = Lattice::new([-1.0; 3], [1.0; 3], [cells, 8, 16]);
            let line = line(origin, dir);
            let Some((t0, _)) = line.clip([-1.0; 3], [1.0; 3], 1e30) else { return Ok(()) };
            let start = Dda::new(&lattice, &line, t0);
            let mut stepped = start;
            let mut last = None;
            for _ in 0..skip {
                let (axis, t) = stepped.crossing();
                if t.is_infinite() {
                    break;
                }
                stepped.cross(&lattice, &line, axis);
                last = Some((axis, t));
            }
            if let Some((axis, t)) = last {
                let mut jumped = start;
                jumped.jump(&lattice, &line, axis, stepped.cell[axis], t);
                prop_assert_eq!(jumped.cell, stepped.cell);
                prop_assert_eq!(jumped.next.map(f64::to_bits), stepped.next.map(f64::to_bits));
            }
        }

        /// Every point of the ray is near a cell that both walks visit.
        #[test]
        fn walks_cover_the_ray(origin in vec3(), dir in vec3(), far in 0_i32..30, at in prop::collection::vec(0.0..1.0_f64, 20)) {
            prop_assume!(dir != Vec3::ZERO);
            let origin = origin - dir * (far as f32).exp2();
            let lattice = Lattice::new([-1.0; 3], [1.0; 3], [13, 8, 1]);
            let line = line(origin, dir);
            let Some((t0, t1)) = line.clip([-1.0; 3], [1.0; 3], 1e30) else { return Ok(()) };
            let mut cells = Vec::new();
            let mut dda = Dda::new(&lattice, &line, t0);
            loop {
                cells.push(dda.cell);
                let (axis, t) = dda.crossing();
                if t > t1 {
                    break;
                }
                dda.cross(&lattice, &line, axis);
            }
            let mut halved = Vec::new();
            lattice.bisect(&line, (t0, t1), &mut |cell, _, _| {
                halved.push(cell);
                false
            });
            for part in at {
                let t = t0 + (t1 - t0) * part;
                let point: [f64; 3] = std::array::from_fn(|i| line.origin[i] + t * f64::from(dir[i]));
                let slack = 1e-6 + 1e-14 * f64::from(origin.abs().max_element());
                let holds = |cell: &[u32; 3]| (0..3).all(|i| {
                    let (low, high) = (lattice.plane(i, cell[i]), lattice.plane(i, cell[i] + 1));
                    point[i] >= low - slack && point[i] <= high + slack
                });
                prop_assert!(cells.iter().any(holds), "{point:?} of {cells:?}");
                prop_assert!(halved.iter().any(holds), "{point:?} of {halved:?}");
            }
        }
    }
}
