//! Subtrees of few triangles: every cut along every axis is tried. The orders along the axes are sorted once and kept sorted through
//! all cuts.

#![expect(clippy::cast_possible_truncation, reason = "a small run is numbered in u8")]

use super::{
    Builder, Child, MAX_DEPTH, Run, Settings, Siblings,
    bounds::{Bounds, PrimRef},
    low_bits,
};
use crate::{
    accel::sah::COST_TRAVERSE,
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Most triangles of a small run.
pub(super) const SMALL: usize = 16;

/// Emits the subtree over a run of at most [`SMALL`] triangles.
pub(super) fn build(builder: &Builder<'_>, run: Run<'_>, depth: usize, out: &mut Vec<Siblings>) -> Child {
    if run.refs.len() == 1 {
        return run.leaf();
    }
    dispatch(SimdLevel::best(), Small { builder, run, depth, out })
}

/// A small run to be built.
struct Small<'a> {
    builder: &'a Builder<'a>,
    run: Run<'a>,
    depth: usize,
    out: &'a mut Vec<Siblings>,
}

/// A part of the run, and whose child it is.
#[derive(Clone, Copy)]
struct Part {
    start: usize,
    end: usize,
    depth: usize,
    parent: usize,
    side: usize,
}

/// No pair.
const ROOT: usize = usize::MAX;

impl Task for Small<'_> {
    type Output = Child;

    #[inline(always)]
    fn run<S: Simd>(self) -> Child {
        let Self { builder, run, depth, out } = self;
        let mut sorted = Sorted::new(builder, run.refs);
        let mut root = Child::None;
        let mut parts = [Part { start: 0, end: run.refs.len(), depth, parent: ROOT, side: 0 }; SMALL + 1];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let part = parts[waiting];
            let child = match sorted.split(part) {
                None => sorted.leaf(part, run.order, run.first),
                Some(place) => {
                    sorted.apply(part, place);
                    let (own, middle, depth) = (out.len(), part.start + place.count, part.depth + 1);
                    out.push(Siblings { area: place.area, axis: low_bits(place.axis), ..Siblings::NONE });
                    // The first child is taken next.
                    parts[waiting] = Part { start: middle, depth, parent: own, side: 1, ..part };
                    parts[waiting + 1] = Part { end: middle, depth, parent: own, side: 0, ..part };
                    waiting += 2;
                    Child::inner(own)
                }
            };
            if part.parent == ROOT {
                root = child;
            } else {
                out[part.parent].children[part.side] = child;
            }
        }
        root
    }
}

/// Three orders of the same triangles.
struct Sorted<'a> {
    settings: &'a Settings,
    refs: &'a [PrimRef],
    orders: [[u8; SMALL]; 3],
    areas: [f32; SMALL],
    /// Cost of a leaf of so many triangles.
    costs: &'a [f32; SMALL + 1],
}

/// A cut: the first `count` along `axis`.
#[derive(Clone, Copy)]
struct Place {
    axis: usize,
    count: usize,
    /// Half the area of the box around all.
    area: f32,
}

/// Bits of a key that give way to a place in the run.
const PLACE: u32 = SMALL as u32 - 1;

impl<'a> Sorted<'a> {
    #[inline(always)]
    fn new(builder: &'a Builder<'_>, refs: &'a [PrimRef]) -> Self {
        let Builder { settings, costs } = builder;
        let mut out = Self { settings, refs, orders: [[0; SMALL]; 3], areas: [0.0; SMALL], costs };
        let low = Bounds::of_centers(refs).low();
        let mut keys = [[u32::MAX; SMALL]; 3];
        for i in 0..refs.len() {
            let center = refs[i].center();
            for (axis, keys) in keys.iter_mut().enumerate() {
                // Numbers that are not negative order as their bits do.
                keys[i] = (center[axis] - low[axis]).to_bits() & !PLACE | i as u32;
            }
        }
        for (order, keys) in out.orders.iter_mut().zip(&keys) {
            for i in 0..refs.len() {
                let mut before = 0;
                for key in keys {
                    before += u32::from(*key < keys[i]);
                }
                order[(before & PLACE) as usize] = i as u8;
            }
        }
        out
    }

    #[inline(always)]
    fn bounds(&self, axis: usize, place: usize) -> Bounds {
        self.refs[self.orders[axis][place] as usize].bounds()
    }

    /// Writes a leaf, in ascending order.
    #[inline(always)]
    fn leaf(&self, part: Part, order: &mut [u32], first: u32) -> Child {
        for place in part.start..part.end {
            let id = self.refs[self.orders[0][place] as usize].id();
            let mut at = place;
            while at > part.start && order[at - 1] > id {
                order[at] = order[at - 1];
                at -= 1;
            }
            order[at] = id;
        }
        Child::leaf(first + part.start as u32, part.end - part.start)
    }

    /// Where to cut; `None` makes a leaf.
    #[inline(always)]
    fn split(&mut self, part: Part) -> Option<Place> {
        let count = part.end - part.start;
        if count == 1 || part.depth >= MAX_DEPTH {
            return None;
        }
        let (cost, place) = self.sweep(part.start, count);
        if count <= self.settings.leaf && cost >= self.costs[count] {
            return None;
        }
        if place.count.max(count - place.count) <= self.settings.room(part.depth) {
            return Some(place);
        }
        let mut longest = (0, -1.0);
        for axis in 0..3 {
            let last = self.refs[self.orders[axis][part.end - 1] as usize].center()[axis];
            let extent = last - self.refs[self.orders[axis][part.start] as usize].center()[axis];
            longest = if extent > longest.1 { (axis, extent) } else { longest };
        }
        Some(Place { axis: longest.0, count: self.settings.half(count), ..place })
    }

    /// The best cut and the cost of a visit to the node when it is made.
    #[inline(always)]
    fn sweep(&mut self, start: usize, count: usize) -> (f32, Place) {
        let (mut least, mut best, mut area) = (f32::INFINITY, (0, 0), 0.0);
        for axis in 0..3 {
            let mut right = Bounds::EMPTY;
            for i in (1..count).rev() {
                right = right.union(self.bounds(axis, start + i));
                self.areas[i] = right.half_area();
            }
            if axis == 0 {
                area = right.union(self.bounds(axis, start)).half_area();
            }
            let mut left = Bounds::EMPTY;
            for i in 1..count {
                left = left.union(self.bounds(axis, start + i - 1));
                let cost = left.half_area() * self.costs[i] + self.areas[i] * self.costs[count - i];
                if best.1 == 0 || cost < least {
                    (least, best) = (cost, (axis, i));
                }
            }
        }
        let below = if area > 0.0 { least / area } else { f32::INFINITY };
        let (axis, count) = best;
        (COST_TRAVERSE as f32 + below, Place { axis, count, area })
    }

    /// Cuts all three orders, keeping each sorted on both sides.
    #[inline(always)]
    fn apply(&mut self, part: Part, place: Place) {
        let mut members = 0_u32;
        for i in part.start..part.start + place.count {
            members |= 1 << (self.orders[place.axis][i] & PLACE as u8);
        }
        for axis in 0..3 {
            if axis == place.axis {
                continue;
            }
            let mut rest = [0; SMALL];
            let (mut kept, mut moved) = (part.start, 0);
            for i in part.start..part.end {
                // Both are written, one counts.
                let prim = self.orders[axis][i];
                let is_member = (members >> (prim & PLACE as u8)) as usize & 1;
                self.orders[axis][kept] = prim;
                rest[moved & (SMALL - 1)] = prim;
                kept += is_member;
                moved += 1 - is_member;
            }
            self.orders[axis][kept..kept + moved].copy_from_slice(&rest[..moved]);
        }
    }
}
