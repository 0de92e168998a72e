//! Trees of eight children a node over boxes: what touches what, what is near, refitted as the boxes move.
//!
//! A node is a block of eight boxes by component, which one comparison per plane tests at once; a leaf's boxes are items, another's are
//! its children's. Nodes lie parent first, so one sweep from the last to the first brings a tree to new boxes. Comparisons of boxes
//! are exact; a box with NaN, or with `min > max` on an axis, is empty and meets nothing.
//!
//! Cost: 256 bytes for eight items and little more; refit is bound by the reading of the items.

mod along;
mod build;
mod near;
mod pairs;
#[cfg(test)]
mod tests;
mod touch;

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicU64, Ordering},
};

use glam::Vec3;

use crate::{
    geom::Aabb,
    simd::{Lanes, Simd},
};

pub(super) use along::Along;
pub(super) use near::Near;
pub(super) use pairs::PairVisitor;
pub(super) use touch::NearPairs;

/// Boxes a node.
pub(super) const WIDTH: usize = 8;

/// The item of a place that has none.
const NONE: u32 = u32::MAX;

/// Bit of a link that leads to a leaf.
const LEAF: u32 = 1 << 31;

/// Eight boxes by component, and what each stands for.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
struct Node {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
    /// Items of a leaf, [`NONE`] where there is none; else numbers of child nodes, with [`LEAF`] for leaves.
    links: [u32; WIDTH],
    /// Number of places in use, from the first on.
    count: u32,
    is_leaf: bool,
}

impl Node {
    fn new(is_leaf: bool) -> Self {
        let (min, max) = ([[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]);
        Self { min, max, links: [NONE; WIDTH], count: 0, is_leaf }
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.min[axis][lane] = aabb.min[axis];
            self.max[axis][lane] = aabb.max[axis];
        }
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> Aabb {
        let pick = |planes: &[[f32; WIDTH]; 3]| Vec3::new(planes[0][lane], planes[1][lane], planes[2][lane]);
        Aabb { min: pick(&self.min), max: pick(&self.max) }
    }

    /// Places whose closed box meets a closed box; exact.
    #[inline(always)]
    fn meets<S: Simd>(&self, aabb: &Aabb) -> u32 {
        let mut mask = (1_u32 << self.count) - 1;
        for axis in 0..3 {
            let (low, high) = (S::F8::load(&self.min[axis]), S::F8::load(&self.max[axis]));
            mask &= low.le(S::F8::splat(aabb.max[axis])) & S::F8::splat(aabb.min[axis]).le(high);
        }
        mask
    }

    /// The least box around all.
    #[inline(always)]
    fn bounds(&self) -> Aabb {
        let mut all = Aabb::EMPTY;
        for axis in 0..3 {
            let (low, high) = (&self.min[axis], &self.max[axis]);
            let least = |a: f32, b: f32| if a < b { a } else { b };
            let most = |a: f32, b: f32| if a > b { a } else { b };
            let l = [least(low[0], low[4]), least(low[1], low[5]), least(low[2], low[6]), least(low[3], low[7])];
            let h = [most(high[0], high[4]), most(high[1], high[5]), most(high[2], high[6]), most(high[3], high[7])];
            all.min[axis] = least(least(l[0], l[2]), least(l[1], l[3]));
            all.max[axis] = most(most(h[0], h[2]), most(h[1], h[3]));
        }
        all
    }
}

/// Builds so far.
static BUILDS: AtomicU64 = AtomicU64::new(1);

/// A tree over boxes, numbered from 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// Parents before children; empty without items.
    nodes: Vec<Node>,
    /// The box of each node.
    bounds: Vec<Aabb>,
    /// Differs between any two builds.
    build: u64,
    /// Sum of the nodes' areas after the build, over that of the items.
    fresh: f64,
    /// The same now.
    now: f64,
}

impl Tree {
    /// The least box around everything.
    pub(super) fn bounds(&self) -> Aabb {
        self.bounds.first().copied().unwrap_or(Aabb::EMPTY)
    }

    /// Differs between any two builds.
    pub(super) fn build_number(&self) -> u64 {
        self.build
    }

    /// Calls `visit` with every item, neighbours one after the other; the order changes with builds only.
    pub(super) fn each_item(&self, mut visit: impl FnMut(u32)) {
        for node in self.nodes.iter().filter(|node| node.is_leaf) {
            node.links[..node.count as usize].iter().for_each(|&item| visit(item));
        }
    }

    /// How much larger the nodes are, for their items' size, than right after the build: 1 when fresh.
    pub(super) fn decay(&self) -> f64 {
        if self.fresh > 0.0 && self.now.is_finite() { self.now / self.fresh } else { 1.0 }
    }

    /// Takes the items' new boxes, as many as before. No allocation.
    pub(super) fn refit(&mut self, boxes: impl Fn(u32) -> Aabb) {
        let (mut areas, mut own) = (0.0_f64, 0.0_f64);
        for number in (0..self.nodes.len()).rev() {
            let (before, after) = self.bounds.split_at_mut(number + 1);
            let node = &mut self.nodes[number];
            for lane in 0..node.count as usize {
                let link = node.links[lane];
                let aabb =
                    if node.is_leaf { cleaned(boxes(link)) } else { after[(link & !LEAF) as usize - number - 1] };
                node.put(lane, &aabb);
                if node.is_leaf {
                    own += f64::from(aabb.half_area());
                }
            }
            before[number] = node.bounds();
            areas += f64::from(before[number].half_area());
        }
        self.now = if own > 0.0 { areas / own } else { 0.0 };
    }

    /// Takes the items' boxes into the shape of another tree over as many. No allocation when this one came of it.
    pub(super) fn refit_from(&mut self, shape: &Self, boxes: impl Fn(u32) -> Aabb) {
        if self.build != shape.build {
            self.clone_from(shape);
        }
        self.refit(boxes);
    }

    /// Calls `visit` with every item whose closed box meets `aabb`, in no particular order, until it breaks.
    #[inline(always)]
    pub(super) fn meeting<S: Simd>(
        &self,
        aabb: &Aabb,
        stack: &mut Vec<u32>,
        visit: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(number) = stack.pop() {
            let node = &self.nodes[(number & !LEAF) as usize];
            let mut mask = node.meets::<S>(aabb);
            while mask != 0 {
                let link = node.links[mask.trailing_zeros() as usize];
                mask &= mask - 1;
                if node.is_leaf { visit(link)? } else { stack.push(link) }
            }
        }
        ControlFlow::Continue(())
    }
}

/// The box, or the empty one where it has NaN or no inside.
#[inline(always)]
fn cleaned(aabb: Aabb) -> Aabb {
    if aabb.is_empty() { Aabb::EMPTY } else { aabb }
}
