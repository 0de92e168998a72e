//! Subtrees of few triangles: every cut along every axis is tried. The orders along the axes are sorted once and kept sorted through
//! all cuts.

#![expect(clippy::cast_possible_truncation, reason = "a small run is numbered in u8")]

use super::{
    Child, MAX_DEPTH, Run, Settings, Siblings,
    bounds::{Bounds, PrimRef},
    low_bits,
};
use crate::accel::sah::COST_TRAVERSE;

/// Most triangles of a small run.
pub(super) const SMALL: usize = 32;

/// Three orders of the same triangles.
struct Sorted<'a> {
    settings: &'a Settings,
    refs: &'a [PrimRef],
    orders: [[u8; SMALL]; 3],
    areas: [f64; SMALL],
}

/// A cut: the first `count` along `axis`.
#[derive(Clone, Copy)]
struct Place {
    axis: usize,
    count: usize,
    /// Half the area of the box around all.
    area: f32,
}

/// Emits the subtree over a run of at most [`SMALL`] triangles.
pub(super) fn build(settings: &Settings, run: Run<'_>, depth: usize, out: &mut Vec<Siblings>) -> Child {
    let count = run.refs.len();
    if count == 1 {
        return run.leaf();
    }
    let mut sorted = Sorted { settings, refs: run.refs, orders: [[0; SMALL]; 3], areas: [0.0; SMALL] };
    let mut keys = [0_u64; SMALL];
    for axis in 0..3 {
        for (i, (key, prim)) in keys.iter_mut().zip(&*run.refs).enumerate() {
            *key = u64::from(ascending(prim.center()[axis])) << 8 | i as u64;
        }
        keys[..count].sort_unstable();
        for (place, key) in sorted.orders[axis].iter_mut().zip(&keys[..count]) {
            *place = *key as u8;
        }
    }
    let child = sorted.child(0..count, run.first, depth, out);
    for (place, &i) in run.order.iter_mut().zip(&sorted.orders[0]) {
        *place = sorted.refs[i as usize].id();
    }
    sort_leaves(child, out, run.order, run.first);
    child
}

/// Puts the triangles of every leaf of a subtree into ascending order.
fn sort_leaves(child: Child, out: &[Siblings], order: &mut [u32], base: u32) {
    match child {
        Child::None => {}
        Child::Leaf { first, count } => order[(first - base) as usize..][..count as usize].sort_unstable(),
        Child::Inner(pair) => {
            for child in out[pair as usize].children {
                sort_leaves(child, out, order, base);
            }
        }
    }
}

/// A number that orders as the float does.
#[inline(always)]
fn ascending(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

impl Sorted<'_> {
    #[inline(always)]
    fn bounds(&self, axis: usize, place: usize) -> Bounds {
        self.refs[self.orders[axis][place] as usize & (SMALL - 1)].bounds()
    }

    fn child(&mut self, range: std::ops::Range<usize>, base: u32, depth: usize, out: &mut Vec<Siblings>) -> Child {
        let count = range.len();
        let Some(place) = self.split(range.clone(), depth) else {
            return Child::leaf(base + range.start as u32, count);
        };
        self.apply(range.clone(), place);
        let parent = out.len();
        out.push(Siblings { area: place.area, axis: low_bits(place.axis), ..Siblings::NONE });
        let middle = range.start + place.count;
        let first = self.child(range.start..middle, base, depth + 1, out);
        let second = self.child(middle..range.end, base, depth + 1, out);
        out[parent].children = [first, second];
        Child::inner(parent)
    }

    /// Where to cut; `None` makes a leaf.
    fn split(&mut self, range: std::ops::Range<usize>, depth: usize) -> Option<Place> {
        let count = range.len();
        if count == 1 || depth >= MAX_DEPTH {
            return None;
        }
        let (cost, place) = self.sweep(range.clone());
        if count <= self.settings.leaf && cost >= self.settings.leaf_cost(count) {
            return None;
        }
        if place.count.max(count - place.count) <= self.settings.room(depth) {
            return Some(place);
        }
        let centers = range.fold(Bounds::EMPTY, |b, i| b.grown(self.refs[self.orders[0][i] as usize].center()));
        Some(Place { axis: centers.longest_axis(), count: self.settings.half(count), ..place })
    }

    /// The best cut and the cost of a visit to the node when it is made.
    fn sweep(&mut self, range: std::ops::Range<usize>) -> (f64, Place) {
        let (start, count) = (range.start, range.len());
        let (mut least, mut best, mut area) = (f64::INFINITY, (0, 0), 0.0);
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
                let cost =
                    left.half_area() * self.settings.leaf_cost(i) + self.areas[i] * self.settings.leaf_cost(count - i);
                if best.1 == 0 || cost < least {
                    (least, best) = (cost, (axis, i));
                }
            }
        }
        let below = if area > 0.0 { least / area } else { f64::INFINITY };
        let (axis, count) = best;
        (COST_TRAVERSE + below, Place { axis, count, area: area as f32 })
    }

    /// Cuts all three orders, keeping each sorted on both sides.
    fn apply(&mut self, range: std::ops::Range<usize>, place: Place) {
        let first = &self.orders[place.axis][range.start..range.start + place.count];
        let members = first.iter().fold(0_u32, |set, &i| set | 1 << i);
        for order in &mut self.orders {
            let order = &mut order[range.clone()];
            let mut rest = [0; SMALL];
            let (mut kept, mut moved) = (0, 0);
            for i in 0..order.len() {
                let prim = order[i];
                if members >> prim & 1 == 1 {
                    order[kept] = prim;
                    kept += 1;
                } else {
                    rest[moved] = prim;
                    moved += 1;
                }
            }
            order[kept..].copy_from_slice(&rest[..moved]);
        }
    }
}
