//! A hierarchy of sorted event lists: neighbouring boxes in volumes, each with one list of their lower ends along an axis.
//!
//! Lists are sorted again by insertion, which costs as much as the order has changed; volumes whose boxes meet are swept together.
//! Flat lists over everything lose to trees at any size, since along one axis nearly everything overlaps nearly everything.
//!
//! # Source
//! The volumes are those of Fournier and Poulin, "A Ray Tracing Accelerator Based on a Hierarchy of 1D Sorted Lists", 1993, filled from a
//! tree; the sort is that of Baraff, "Dynamic Simulation of Non-Penetrating Rigid Bodies", 1992.

use std::ops::{ControlFlow, Range};

use crate::{
    collide::{
        boxes_meet,
        tree::{PairVisitor, Tree},
    },
    geom::Aabb,
};

/// Boxes a volume.
const VOLUME: usize = 32;

/// A lower end along the axis, and whose it is.
#[derive(Clone, Copy, Debug)]
struct End {
    low: f32,
    owner: u32,
}

#[derive(Debug, Default)]
pub(super) struct Lists {
    /// Build of the tree that the volumes were taken of.
    build: u64,
    ends: Vec<End>,
    volumes: Vec<Aabb>,
    /// Over the volumes.
    tree: Tree,
    axis: usize,
}

impl Lists {
    pub(super) fn clear(&mut self) {
        self.build = 0;
    }

    /// Brings the lists to the boxes, in volumes as the tree's build made them.
    pub(super) fn update(&mut self, shape: &Tree, boxes: &[Aabb]) {
        let fresh = self.build != shape.build_number();
        if fresh {
            self.build = shape.build_number();
            self.axis = longest_axis(&shape.bounds());
            self.ends.clear();
            shape.each_item(|owner| self.ends.push(End { low: 0.0, owner }));
        }
        let axis = self.axis;
        self.volumes.clear();
        for list in self.ends.chunks_mut(VOLUME) {
            let mut bounds = Aabb::EMPTY;
            for end in list.iter_mut() {
                let aabb = &boxes[end.owner as usize];
                // Empty boxes come last and meet nothing.
                let is_empty = aabb.is_empty();
                end.low = if is_empty { f32::INFINITY } else { aabb.min[axis] };
                if !is_empty {
                    bounds = bounds.union(*aabb);
                }
            }
            sort_again(list);
            self.volumes.push(bounds);
        }
        let volumes = &self.volumes;
        if fresh {
            self.tree.rebuild(volumes.len(), |i| volumes[i as usize]);
        } else {
            self.tree.refit(&|i: u32| volumes[i as usize]);
        }
    }

    /// Every pair of boxes that meet, each once.
    pub(super) fn pairs<V: PairVisitor>(&self, boxes: &[Aabb], visitor: &mut V) {
        for volume in 0..self.volumes.len() {
            self.sweep_one(&self.ends[self.range(volume)], boxes, visitor);
        }
        self.tree.own_pairs(&mut |a: u32, b: u32| {
            let lists = [a, b].map(|volume| &self.ends[self.range(volume as usize)]);
            let around = [a, b].map(|volume| &self.volumes[volume as usize]);
            self.sweep_two(lists, around, boxes, visitor);
            ControlFlow::Continue(())
        });
    }

    fn range(&self, volume: usize) -> Range<usize> {
        volume * VOLUME..((volume + 1) * VOLUME).min(self.ends.len())
    }

    fn sweep_one<V: PairVisitor>(&self, list: &[End], boxes: &[Aabb], visitor: &mut V) {
        for (at, a) in list.iter().enumerate() {
            let aabb = &boxes[a.owner as usize];
            for b in list[at + 1..].iter().take_while(|b| b.low <= aabb.max[self.axis]) {
                if boxes_meet(aabb, &boxes[b.owner as usize]) {
                    // The visitors of this module never break.
                    let _ = visitor.pair(a.owner, b.owner);
                }
            }
        }
    }

    /// The one whose lower end comes first is compared with what follows in the other list.
    fn sweep_two<V: PairVisitor>(&self, one: [&[End]; 2], around: [&Aabb; 2], boxes: &[Aabb], visitor: &mut V) {
        let mut next = [0, 0];
        while next[0] < one[0].len() && next[1] < one[1].len() {
            let first = usize::from(one[1][next[1]].low < one[0][next[0]].low);
            let other = 1 - first;
            let a = one[first][next[first]].owner;
            next[first] += 1;
            let aabb = &boxes[a as usize];
            if !boxes_meet(aabb, around[other]) {
                continue;
            }
            for b in one[other][next[other]..].iter().take_while(|b| b.low <= aabb.max[self.axis]) {
                if boxes_meet(aabb, &boxes[b.owner as usize]) {
                    // As above.
                    let _ = visitor.pair(a, b.owner);
                }
            }
        }
    }
}

/// Sorts ends that were in order before a motion, by insertion.
fn sort_again(list: &mut [End]) {
    for next in 1..list.len() {
        let end = list[next];
        let mut at = next;
        while at > 0 && list[at - 1].low > end.low {
            list[at] = list[at - 1];
            at -= 1;
        }
        list[at] = end;
    }
}

/// The first of the axes along which a box is longest.
fn longest_axis(aabb: &Aabb) -> usize {
    let extent = aabb.extent();
    (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best })
}
