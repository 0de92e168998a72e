//! What a moving box comes upon, in the order of time.

use std::{cmp::Ordering, collections::BinaryHeap};

use glam::Vec3;

use super::{LEAF, Tree};
use crate::geom::Aabb;

/// Looks at items that a moving box may touch.
pub(in crate::collide) trait Along {
    /// Nothing touched later matters any more: a time in [0, 1].
    fn limit(&self) -> f64;
    /// An item whose box may be touched by then.
    fn visit(&mut self, item: u32);
}

/// What is touched at some time, the earliest first, then in order of numbers.
#[derive(Clone, Copy, Debug)]
struct Ahead {
    time: f64,
    link: u32,
    is_item: bool,
}

impl Ord for Ahead {
    fn cmp(&self, other: &Self) -> Ordering {
        other.time.total_cmp(&self.time).then((other.is_item, other.link).cmp(&(self.is_item, self.link)))
    }
}

impl PartialOrd for Ahead {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ahead {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ahead {}

impl Tree {
    /// Shows `along` every item whose box the closed box `start`, moving by `motion` (finite) while time goes from 0 to 1, touches up to
    /// the limit, and some others.
    pub(in crate::collide) fn along<A: Along>(&self, start: &Aabb, motion: Vec3, along: &mut A) {
        let mut heap = BinaryHeap::new();
        if !self.nodes.is_empty() {
            heap.push(Ahead { time: 0.0, link: 0, is_item: false });
        }
        while let Some(Ahead { time, link, is_item }) = heap.pop() {
            if time > along.limit() {
                return;
            }
            if is_item {
                along.visit(link);
                continue;
            }
            let node = &self.nodes[(link & !LEAF) as usize];
            for lane in 0..node.count as usize {
                if let Some(time) = touch(start, motion, &node.get(lane)).filter(|t| *t <= along.limit()) {
                    heap.push(Ahead { time, link: node.links[lane], is_item: node.is_leaf });
                }
            }
        }
    }
}

/// Beyond the rounding of a difference and a quotient.
const MARGIN: f64 = 4.0 * f64::EPSILON;

/// At most the time at which a moving box touches another at rest; `None` when it surely does not.
fn touch(start: &Aabb, motion: Vec3, other: &Aabb) -> Option<f64> {
    let (mut enter, mut exit) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        let wide = |x: f32| f64::from(x);
        let (low, high) =
            (wide(other.min[axis]) - wide(start.max[axis]), wide(other.max[axis]) - wide(start.min[axis]));
        let speed = wide(motion[axis]);
        if speed == 0.0 {
            if !(low <= 0.0 && high >= 0.0) {
                return None;
            }
            continue;
        }
        let (first, last) = if speed > 0.0 { (low / speed, high / speed) } else { (high / speed, low / speed) };
        enter = enter.max(first * (1.0 - MARGIN));
        exit = exit.min(last * (1.0 + MARGIN));
    }
    (enter <= exit).then_some(enter)
}
