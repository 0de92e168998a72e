//! Top-down build by the surface-area heuristic: binned for many objects, over every box face for few.
//!
//! # Source
//! Wald and Havran, "On building fast kd-trees for Ray Tracing, and on doing that in O(N log N)", 2006. Departures: nodes of many objects
//! are split at planes of a regular set of bins or at the faces of what they hold; duplicates are bounded by a budget that is
//! shared out on the way down, so that memory is linear in the number of objects.

use rayon::prelude::*;

use super::{
    node::KdNode,
    split::{Costs, Plan},
};
use crate::{
    accel::{leaves::append_leaf, shapes::Shapes},
    geom::{Aabb, PrimId},
};

/// Nodes of fewer objects are built by one task.
const TASK: usize = 4096;

/// References that an object may have on average.
const DUPLICATES: usize = 16;

/// Most nodes on a path: the length of traversal stacks.
pub(in crate::accel) const MAX_DEPTH: usize = 64;

/// An object while a tree is built: its number and a box around its part inside the node.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Ref {
    pub(in crate::accel) aabb: Aabb,
    pub(in crate::accel) id: PrimId,
}

/// How to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::accel) struct Params {
    pub(in crate::accel) costs: Costs,
    /// Bins an axis.
    pub(in crate::accel) bins: usize,
    /// Cut objects at splits instead of cutting their boxes.
    pub(in crate::accel) clip: bool,
}

/// Nodes and items of a subtree; numbers count from its own first node and unit.
#[derive(Debug, Default)]
pub(in crate::accel) struct Emitted {
    pub(in crate::accel) nodes: Vec<KdNode>,
    pub(in crate::accel) items: Vec<u32>,
}

/// A node to build.
pub(in crate::accel) struct Task {
    pub(in crate::accel) refs: Vec<Ref>,
    /// Box of the node.
    pub(in crate::accel) cell: Aabb,
    /// Splits that may still follow on a path, those that only cut off empty space left out.
    pub(in crate::accel) depth: usize,
    /// Splits of any kind that may still follow on a path.
    pub(in crate::accel) levels: usize,
    /// References and splits that the subtree may have together.
    pub(in crate::accel) room: usize,
}

/// All objects that can be hit, in order.
#[expect(clippy::cast_possible_truncation, reason = "callers check the number of objects")]
pub(in crate::accel) fn refs(shapes: &(impl Shapes + ?Sized)) -> Vec<Ref> {
    let all = (0..shapes.count() as u32).into_par_iter().with_min_len(TASK);
    let refs = all.map(|id| Ref { aabb: shapes.aabb(id), id: PrimId(id) });
    refs.filter(|r| !r.aabb.is_empty()).collect()
}

/// The box around all of `refs`.
pub(in crate::accel) fn bounds(refs: &[Ref]) -> Aabb {
    refs.iter().fold(Aabb::EMPTY, |b, r| b.union(r.aabb))
}

/// Splits of objects that a tree over `count` of them may have on a path: 8 + 1.3 log2 of it. Cutting off empty space does not count: flat and
/// hollow shapes would spend the depth on it.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
pub(in crate::accel) fn depth_limit(count: usize) -> usize {
    ((8.0 + 1.3 * libm::log2(count.max(1) as f64)) as usize).min(MAX_DEPTH - 1)
}

/// References and splits that a tree over `count` objects may have together.
pub(in crate::accel) fn room(count: usize) -> usize {
    count.saturating_mul(DUPLICATES).saturating_add(1024)
}

/// Shares out the room of a node to children of the given counts; a split takes one, and no child gets less than its count. `None` when
/// there is too little.
pub(in crate::accel) fn shared_room(room: usize, counts: [usize; 2]) -> Option<[usize; 2]> {
    let sum = counts[0] + counts[1];
    let surplus = room.checked_sub(sum + 1)?;
    // Both factors are below 2^32.
    Some(counts.map(|count| count + surplus * count / sum.max(1)))
}

pub(in crate::accel) struct Builder<'a, P: ?Sized> {
    pub(in crate::accel) shapes: &'a P,
    pub(in crate::accel) params: Params,
    /// Objects to a unit.
    pub(in crate::accel) unit: usize,
}

impl<P: Shapes + ?Sized> Builder<'_, P> {
    /// Emits the subtree of a task behind what is in `out`.
    pub(in crate::accel) fn emit(&self, task: Task, out: &mut Emitted) {
        let may_split = task.depth > 0 && task.levels > 0;
        let plan = if may_split { Plan::best(&task.refs, task.cell, &self.params) } else { None };
        let split = plan.map(|plan| (plan, self.divide(&plan, &task)));
        let Some((plan, Some([lower, upper]))) = split else {
            let units = append_leaf(&mut out.items, task.refs.iter().map(|r| r.id.0), self.unit);
            out.nodes.push(KdNode::leaf(&units));
            return;
        };
        let parent = out.nodes.len();
        out.nodes.push(KdNode::leaf(&(0..0)));
        if task.refs.len() < TASK {
            drop(task);
            self.emit(lower, out);
            out.nodes[parent] = KdNode::inner(plan.axis, plan.at, out.nodes.len());
            self.emit(upper, out);
        } else {
            drop(task);
            let fresh = |task| {
                let mut out = Emitted::default();
                self.emit(task, &mut out);
                out
            };
            let (lower, upper) = rayon::join(|| fresh(lower), || fresh(upper));
            out.append(lower, self.unit);
            out.nodes[parent] = KdNode::inner(plan.axis, plan.at, out.nodes.len());
            out.append(upper, self.unit);
        }
    }

    /// Hands the objects to both sides; `None` when that leads nowhere or there is no room for it.
    fn divide(&self, plan: &Plan, task: &Task) -> Option<[Task; 2]> {
        let (mut below, mut above) = (task.cell, task.cell);
        below.max[plan.axis] = plan.at;
        above.min[plan.axis] = plan.at;
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        for r in &task.refs {
            let (min, max) = (r.aabb.min[plan.axis], r.aabb.max[plan.axis]);
            let planar = min >= plan.at && max <= plan.at;
            let (to_lower, to_upper) =
                if planar { (plan.planar_below, !plan.planar_below) } else { (min < plan.at, max > plan.at) };
            if to_lower && to_upper {
                lower.extend(self.part(r, below));
                upper.extend(self.part(r, above));
            } else if to_lower {
                lower.push(*r);
            } else {
                upper.push(*r);
            }
        }
        if lower.len() == task.refs.len() && upper.len() == task.refs.len() {
            return None;
        }
        let rooms = shared_room(task.room, [lower.len(), upper.len()])?;
        let is_cut_off = lower.is_empty() || upper.is_empty();
        let (depth, levels) = (task.depth - usize::from(!is_cut_off), task.levels - 1);
        Some([
            Task { refs: lower, cell: below, depth, levels, room: rooms[0] },
            Task { refs: upper, cell: above, depth, levels, room: rooms[1] },
        ])
    }

    fn part(&self, r: &Ref, cell: Aabb) -> Option<Ref> {
        let whole = self.shapes.aabb(r.id.0);
        let clipped = if self.params.clip { self.shapes.clipped(r.id.0, whole, cell) } else { r.aabb };
        let aabb = crate::accel::shapes::intersection(clipped, r.aabb);
        let aabb = crate::accel::shapes::intersection(aabb, cell);
        (!aabb.is_empty()).then_some(Ref { aabb, id: r.id })
    }
}

impl Emitted {
    /// Moves a subtree emitted apart behind what is there.
    fn append(&mut self, part: Self, unit: usize) {
        let (nodes, units) = (self.nodes.len(), self.items.len() / unit);
        self.nodes.extend(part.nodes.into_iter().map(|n| n.moved(nodes, units)));
        self.items.extend(part.items);
    }
}
