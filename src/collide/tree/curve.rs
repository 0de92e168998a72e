//! Quick builds: items in the order of a space-filling curve, every eight of them a leaf, every eight nodes a parent.
//!
//! For boxes that move so far that a tree serves one frame. Several times as quick as cuts by area; walks take about a third longer.
//!
//! # Source
//! The order is Morton's; hierarchies by it: Lauterbach et al., "Fast BVH Construction on GPUs", 2009.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "items are counted in 31 bits; places on the curve saturate"
)]

use std::sync::OnceLock;

use glam::Vec3;

use super::{BUILDS, Ends, LEAF, Node, Ordering, Tree, WIDTH, build::MAX_ITEMS};
use crate::geom::Aabb;

/// Cells along an axis.
const CELLS: f32 = 1024.0;

/// Bits of a pass of the sort, and passes over three times ten bits.
const DIGIT: u32 = 10;
const PASSES: u32 = 3;

impl Tree {
    /// As [`Tree::rebuild`], by a curve. Keeps the memory, and what is handed in to sort with.
    pub(in crate::collide) fn rebuild_by_curve(&mut self, boxes: &[Aabb], keys: &mut Vec<u64>, other: &mut Vec<u64>) {
        assert!(boxes.len() <= MAX_ITEMS, "{} boxes", boxes.len());
        self.build = BUILDS.fetch_add(1, Ordering::Relaxed);
        self.labels = OnceLock::new();
        self.nodes.clear();
        self.bounds.clear();
        if boxes.is_empty() {
            return;
        }
        sort_along_curve(boxes, keys, other);
        self.lay_out(boxes, keys);
        self.bounds.resize(self.nodes.len(), Ends::EMPTY);
        let all = |i: u32| boxes[i as usize];
        self.refit(&all);
        self.fresh = self.now;
    }

    /// Nodes level by level from the root, all full but for the last of each level.
    fn lay_out(&mut self, boxes: &[Aabb], keys: &[u64]) {
        let mut levels = arrayvec::ArrayVec::<usize, 12>::new();
        let mut count = boxes.len().div_ceil(WIDTH);
        levels.push(count);
        while count > 1 {
            count = count.div_ceil(WIDTH);
            levels.push(count);
        }
        let mut first = 0;
        for (above, &nodes) in levels.iter().enumerate().rev() {
            let next = first + nodes;
            let children = if above == 0 { boxes.len() } else { levels[above - 1] };
            for number in 0..nodes {
                let mut node = Node::new(above == 0);
                let from = number * WIDTH;
                node.count = (children - from).min(WIDTH) as u32;
                for lane in 0..node.count as usize {
                    node.links[lane] = match above {
                        0 => keys[from + lane] as u32,
                        1 => (next + from + lane) as u32 | LEAF,
                        _ => (next + from + lane) as u32,
                    };
                }
                self.nodes.push(node);
            }
            first = next;
        }
    }
}

/// Items by their centre's place on the curve, then by number: that is the lower half of a key.
fn sort_along_curve(boxes: &[Aabb], keys: &mut Vec<u64>, other: &mut Vec<u64>) {
    let centers = boxes.iter().map(center).filter(|c| c.is_finite());
    let Aabb { min, max } = Aabb::from_points(centers);
    let scale = Vec3::splat(CELLS) / (max - min);
    let scale = Vec3::select(scale.is_finite_mask(), scale, Vec3::ZERO);
    keys.clear();
    keys.extend((0..).zip(boxes).map(|(i, aabb): (u64, &Aabb)| {
        let cell = (center(aabb) - min) * scale;
        let place = |x: f32| u64::from((x as u32).min(CELLS as u32 - 1));
        let code = spread(place(cell.x)) << 2 | spread(place(cell.y)) << 1 | spread(place(cell.z));
        code << 32 | i
    }));
    other.clear();
    other.resize(keys.len(), 0);
    for pass in 0..PASSES {
        let digit = |key: u64| (key >> (32 + pass * DIGIT)) as usize & ((1 << DIGIT) - 1);
        let mut places = [0_u32; 1 << DIGIT];
        for &key in &*keys {
            places[digit(key)] += 1;
        }
        let mut sum = 0;
        for place in &mut places {
            sum += std::mem::replace(place, sum);
        }
        for &key in &*keys {
            let place = &mut places[digit(key)];
            other[*place as usize] = key;
            *place += 1;
        }
        std::mem::swap(keys, other);
    }
}

/// Midpoint, halved first: the sum may overflow. NaN for what has none.
#[inline(always)]
fn center(aabb: &Aabb) -> Vec3 {
    let Aabb { min, max } = Ends::new(aabb).aabb();
    min * 0.5 + max * 0.5
}

/// Ten bits with two zeros before each.
#[inline(always)]
fn spread(mut x: u64) -> u64 {
    x = (x | x << 16) & 0x0300_00ff;
    x = (x | x << 8) & 0x0300_f00f;
    x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}
