//! How near two trees come: pairs of items by distance.

use std::{cmp::Ordering, collections::BinaryHeap};

use super::{LEAF, Tree, near::square_between};

/// Looks at pairs of items of two trees, nearer boxes first.
pub(in crate::collide) trait NearPairs {
    /// No pair further apart matters any more: a squared distance.
    fn limit(&self) -> f64;
    /// A pair whose boxes may be that near.
    fn visit(&mut self, a: u32, b: u32);
}

/// Two nodes that wait, the nearest first, then in order of their numbers.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    square: f64,
    links: (u32, u32),
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.square.total_cmp(&self.square).then(other.links.cmp(&self.links))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Waiting {}

impl Tree {
    /// Shows `near` every pair of items whose boxes come as near as the limit, and some others.
    pub(in crate::collide) fn near_pairs<N: NearPairs>(&self, other: &Self, near: &mut N) {
        let mut heap = BinaryHeap::new();
        if !self.nodes.is_empty() && !other.nodes.is_empty() {
            heap.push(Waiting { square: 0.0, links: (0, 0) });
        }
        while let Some(Waiting { square, links }) = heap.pop() {
            if square > near.limit() {
                return;
            }
            let (a, b) = ((links.0 & !LEAF) as usize, (links.1 & !LEAF) as usize);
            let (one, two) = (&self.nodes[a], &other.nodes[b]);
            // The larger of two inner nodes is opened; of two leaves, both.
            let open_first = !one.is_leaf && (two.is_leaf || self.bounds[a].half_area() >= other.bounds[b].half_area());
            if open_first {
                for lane in 0..one.count as usize {
                    let square = square_between(&one.get(lane), &other.bounds[b].aabb());
                    if square <= near.limit() {
                        heap.push(Waiting { square, links: (one.links[lane], links.1) });
                    }
                }
                continue;
            }
            for lane in 0..two.count as usize {
                let aabb = two.get(lane);
                if !one.is_leaf || !two.is_leaf {
                    let square = square_between(&self.bounds[a].aabb(), &aabb);
                    if square <= near.limit() {
                        heap.push(Waiting { square, links: (links.0, two.links[lane]) });
                    }
                    continue;
                }
                for row in 0..one.count as usize {
                    if square_between(&one.get(row), &aabb) <= near.limit() {
                        near.visit(one.links[row], two.links[lane]);
                    }
                }
            }
        }
    }
}
