//! Trees of eight children a node over boxes: what touches what, what is near, refitted as the boxes move.
//!
//! A node is a block of eight boxes by component, which one comparison per plane tests at once; a leaf's boxes are items, another's are
//! its children's. Nodes lie parent first, so one sweep from the last to the first brings a tree to new boxes. Comparisons of boxes
//! are exact; a box with NaN, or with `min > max` on an axis, is empty and meets nothing.
//!
//! Cost: 256 bytes for eight items and little more; refit is bound by the reading of the items.

mod along;
mod build;
mod curve;
mod near;
mod pairs;
#[cfg(test)]
mod tests;
mod touch;

use std::{
    ops::ControlFlow,
    sync::{
        OnceLock,
        atomic::{AtomicU64, Ordering},
    },
};

use glam::Vec3;

use crate::{
    geom::{Aabb, PrimId, Triangles},
    simd::{Lanes, Simd, SimdLevel, Task, dispatch},
};

pub(super) use along::Along;
pub(super) use near::Near;
use pairs::Labels;
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
pub(super) struct Node {
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

    /// Sum of half the boxes' areas.
    #[inline(always)]
    fn area<S: Simd>(&self) -> f64 {
        let none = S::F8::splat(0.0);
        let extent = |axis: usize| (S::F8::load(&self.max[axis]) - S::F8::load(&self.min[axis])).max(none);
        let (x, y, z) = (extent(0), extent(1), extent(2));
        let mut areas = [0.0; WIDTH];
        (x * (y + z) + y * z).store(&mut areas);
        areas.iter().take(self.count as usize).map(|&area| f64::from(area)).sum()
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
    /// Labels of each leaf's items, in the order of the nodes; see [`Tree::own_pairs_apart`].
    labels: OnceLock<Vec<Labels>>,
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
    pub(super) fn refit<B: Boxes>(&mut self, boxes: &B) {
        dispatch(SimdLevel::best(), Refit { tree: self, boxes });
    }

    /// Takes the items' boxes into the shape of another tree over as many. No allocation when this one came of it.
    pub(super) fn refit_from<B: Boxes>(&mut self, shape: &Self, boxes: &B) {
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

struct Refit<'a, B> {
    tree: &'a mut Tree,
    boxes: &'a B,
}

impl<B: Boxes> Task for Refit<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, boxes } = self;
        let (mut areas, mut own) = (0.0_f64, 0.0_f64);
        for number in (0..tree.nodes.len()).rev() {
            let (before, after) = tree.bounds.split_at_mut(number + 1);
            let node = &mut tree.nodes[number];
            if node.is_leaf {
                boxes.fill::<S>(node);
                own += node.area::<S>();
            } else {
                for lane in 0..node.count as usize {
                    let aabb = after[(node.links[lane] & !LEAF) as usize - number - 1];
                    node.put(lane, &aabb);
                }
            }
            before[number] = node.bounds();
            areas += f64::from(before[number].half_area());
        }
        tree.now = if own > 0.0 { areas / own } else { 0.0 };
    }
}

/// Boxes by number.
pub(super) trait Boxes {
    /// A box; NaN and boxes without an inside count as empty.
    fn get(&self, number: u32) -> Aabb;

    /// Takes the boxes of a leaf.
    #[inline(always)]
    fn fill<S: Simd>(&self, leaf: &mut Node) {
        for lane in 0..leaf.count as usize {
            leaf.put(lane, &cleaned(self.get(leaf.links[lane])));
        }
    }
}

impl<F: Fn(u32) -> Aabb> Boxes for F {
    #[inline(always)]
    fn get(&self, number: u32) -> Aabb {
        self(number)
    }
}

impl Boxes for Triangles<'_> {
    #[inline(always)]
    fn get(&self, number: u32) -> Aabb {
        self.aabb(PrimId(number))
    }

    /// The corners are finite.
    #[inline(always)]
    fn fill<S: Simd>(&self, leaf: &mut Node) {
        let mut corners = [[[0.0_f32; WIDTH]; 3]; 3];
        for lane in 0..WIDTH {
            // Places that are not in use repeat the last one.
            let link = leaf.links[lane.min(leaf.count as usize - 1)];
            let triangle = self.indices[link as usize];
            for (corner, rows) in triangle.iter().zip(&mut corners) {
                let p = self.positions[*corner as usize];
                (rows[0][lane], rows[1][lane], rows[2][lane]) = (p.x, p.y, p.z);
            }
        }
        let [a, b, c] = &corners;
        for (axis, (min, max)) in leaf.min.iter_mut().zip(&mut leaf.max).enumerate() {
            let (a, b, c) = (S::F8::load(&a[axis]), S::F8::load(&b[axis]), S::F8::load(&c[axis]));
            a.min(b).min(c).store(min);
            a.max(b).max(c).store(max);
        }
    }
}

/// The box, or the empty one where it has NaN or no inside.
#[inline(always)]
fn cleaned(aabb: Aabb) -> Aabb {
    if aabb.is_empty() { Aabb::EMPTY } else { aabb }
}
