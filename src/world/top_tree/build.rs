//! The splits of a tree over boxes.

use super::{Item, SAH_DEPTH, TopNode};
use crate::{
    geom::Aabb,
    world::border::{BINS, cheapest_border},
};

/// Runs of at least so many boxes are split by two threads.
const FORK: usize = 1024;

/// What becomes of a run of boxes, in order of their groups.
pub(super) struct Run<'a> {
    pub(super) items: &'a mut [Item],
    /// As many, of any content.
    pub(super) spare: &'a mut [Item],
    /// The nodes below that of the run, twice as many as items less two.
    pub(super) below: &'a mut [TopNode],
    /// The number of the first of them.
    pub(super) first: u32,
    pub(super) depth: usize,
}

impl Run<'_> {
    /// Fills `node` and what is below it.
    #[expect(clippy::cast_possible_truncation, reason = "two nodes a group, groups are numbered in 31 bits")]
    pub(super) fn split(self, node: &mut TopNode) {
        let Self { items, spare, below, first, depth } = self;
        let aabb = items.iter().fold(Aabb::EMPTY, |all, i| all.union(i.aabb));
        if let [only] = items {
            *node = TopNode { aabb, link: only.group, leaf: true };
            return;
        }
        *node = TopNode { aabb, link: first, leaf: false };
        let mid = if depth < SAH_DEPTH { partition(items, spare) } else { items.len() / 2 };
        let fork = items.len() >= FORK;
        let (pair, below) = below.split_at_mut(2);
        let (one, other) = pair.split_at_mut(1);
        let (left_items, right_items) = items.split_at_mut(mid);
        let (left_spare, right_spare) = spare.split_at_mut(mid);
        let (left_below, right_below) = below.split_at_mut(2 * mid - 2);
        let (first, depth) = (first + 2, depth + 1);
        let past = first + left_below.len() as u32;
        let left = Run { items: left_items, spare: left_spare, below: left_below, first, depth };
        let right = Run { items: right_items, spare: right_spare, below: right_below, first: past, depth };
        if fork {
            rayon::join(|| left.split(&mut one[0]), || right.split(&mut other[0]));
        } else {
            left.split(&mut one[0]);
            right.split(&mut other[0]);
        }
    }
}

/// Reorders `items` (two or more) and returns where the second half begins: the cheapest of the bin borders
/// along the widest axis of the centres, or the middle when all centres agree. Each half keeps its order.
fn partition(items: &mut [Item], spare: &mut [Item]) -> usize {
    let centers = Aabb::from_points(items.iter().map(|i| i.aabb.center()));
    let extent = centers.extent();
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    let scale = BINS as f32 / extent[axis];
    if !(scale.is_finite() && extent[axis].is_finite()) {
        return items.len() / 2;
    }
    let bin = |item: &Item| bin_of((item.aabb.center()[axis] - centers.min[axis]) * scale);
    let border = cheapest_border(items.iter().map(|item| (bin(item), item.aabb)), 1);
    let (mut low, mut high) = (0, 0);
    for at in 0..items.len() {
        let item = items[at];
        if bin(&item) < border {
            items[low] = item;
            low += 1;
        } else {
            spare[high] = item;
            high += 1;
        }
    }
    items[low..].copy_from_slice(&spare[..high]);
    if low == 0 || high == 0 { items.len() / 2 } else { low }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates; NaN is bin 0")]
fn bin_of(place: f32) -> usize {
    (place as usize).min(BINS - 1)
}
