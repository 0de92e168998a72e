//! A hierarchy of sorted event lists: neighbouring boxes in volumes, each with one list of its boxes in the order of their lower ends along an axis.
//!
//! Lists are sorted again by insertion, which costs as much as the order has changed. Then their boxes stand in blocks of eight by component, in that
//! order. A box is compared with a block at a time, and not with blocks that begin after its end or end before its beginning. Volumes whose boxes
//! meet are swept together. Flat lists over everything lose to trees at any size, since along one axis nearly everything overlaps nearly everything.
//!
//! # Source
//! The volumes are those of Fournier and Poulin, "A Ray Tracing Accelerator Based on a Hierarchy of 1D Sorted Lists", 1993, filled from a
//! tree; the sort is that of Baraff, "Dynamic Simulation of Non-Penetrating Rigid Bodies", 1992.

use std::ops::ControlFlow;

use crate::{
    collide::tree::{Ends, Node, PairVisitor, Tree, WIDTH},
    geom::Aabb,
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Blocks a volume.
const BLOCKS: usize = 4;

/// Boxes a volume.
const VOLUME: usize = BLOCKS * WIDTH;

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
    /// The boxes, a block for every eight ends.
    blocks: Vec<Node>,
    /// Around the boxes of each block.
    around: Vec<Aabb>,
    volumes: Vec<Aabb>,
    /// Over the volumes.
    tree: Tree,
    /// Pairs of volumes that meet.
    couples: Vec<[u32; 2]>,
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
        self.blocks.clear();
        self.around.clear();
        for list in self.ends.chunks_mut(VOLUME) {
            for end in list.iter_mut() {
                let aabb = &boxes[end.owner as usize];
                // Empty boxes come last and meet nothing.
                end.low = if aabb.is_empty() { f32::INFINITY } else { aabb.min[axis] };
            }
            sort_again(list);
            let mut volume = Ends::EMPTY;
            for run in list.chunks(WIDTH) {
                let mut block = Node::new(true);
                let mut ends = [Ends::EMPTY; WIDTH];
                for (lane, end) in run.iter().enumerate() {
                    ends[lane] = Ends::new(&boxes[end.owner as usize]);
                    block.links[lane] = end.owner;
                    block.count += 1;
                }
                let (around, _) = block.take(&ends);
                self.blocks.push(block);
                self.around.push(around.aabb());
                volume = volume.union(around);
            }
            self.volumes.push(volume.aabb());
        }
        let volumes = &self.volumes;
        if fresh {
            self.tree.rebuild(volumes.len(), |i| volumes[i as usize]);
        } else {
            self.tree.refit(&|i: u32| volumes[i as usize]);
        }
    }

    /// Every pair of boxes that meet, each once.
    pub(super) fn pairs<V: PairVisitor>(&mut self, visitor: &mut V) {
        let couples = &mut self.couples;
        couples.clear();
        self.tree.own_pairs(&mut |a: u32, b: u32| {
            couples.push([a, b]);
            ControlFlow::Continue(())
        });
        dispatch(SimdLevel::best(), Sweep { lists: self, visitor });
    }
}

struct Sweep<'a, V> {
    lists: &'a Lists,
    visitor: &'a mut V,
}

impl<V: PairVisitor> Task for Sweep<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { lists, visitor } = self;
        for volume in 0..lists.volumes.len() {
            lists.sweep_one::<S, V>(volume, visitor);
        }
        for &[a, b] in &lists.couples {
            lists.sweep_two::<S, V>(a as usize, b as usize, visitor);
        }
    }
}

impl Lists {
    /// The numbers of a volume's blocks.
    #[inline(always)]
    fn range(&self, volume: usize) -> std::ops::Range<usize> {
        volume * BLOCKS..((volume + 1) * BLOCKS).min(self.blocks.len())
    }

    #[inline(always)]
    fn sweep_one<S: Simd, V: PairVisitor>(&self, volume: usize, visitor: &mut V) {
        let range = self.range(volume);
        for number in range.clone() {
            let block = &self.blocks[number];
            for row in 0..block.count as usize {
                let aabb = block.get(row);
                // Later places only: each pair once.
                report(block, block.meets::<S>(&aabb) & (u32::MAX << row << 1), block.links[row], visitor);
                for later in number + 1..range.end {
                    if self.around[later].min[self.axis] > aabb.max[self.axis] {
                        break;
                    }
                    let other = &self.blocks[later];
                    report(other, other.meets::<S>(&aabb), block.links[row], visitor);
                }
            }
        }
    }

    /// Boxes of the one that meet the other's volume are compared with the blocks that they meet.
    #[inline(always)]
    fn sweep_two<S: Simd, V: PairVisitor>(&self, a: usize, b: usize, visitor: &mut V) {
        let axis = self.axis;
        let volume = &self.volumes[b];
        for one in self.range(a) {
            if self.around[one].min[axis] > volume.max[axis] {
                break;
            }
            let block = &self.blocks[one];
            let mut rows = block.meets::<S>(volume);
            while rows != 0 {
                let row = rows.trailing_zeros() as usize & 7;
                rows &= rows - 1;
                let aabb = block.get(row);
                for other in self.range(b) {
                    let around = &self.around[other];
                    if around.min[axis] > aabb.max[axis] {
                        break;
                    }
                    if around.max[axis] >= aabb.min[axis] {
                        let other = &self.blocks[other];
                        report(other, other.meets::<S>(&aabb), block.links[row], visitor);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn report<V: PairVisitor>(block: &Node, mut mask: u32, one: u32, visitor: &mut V) {
    while mask != 0 {
        // The visitors of this module never break.
        let _ = visitor.pair(one, block.links[mask.trailing_zeros() as usize & 7]);
        mask &= mask - 1;
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
