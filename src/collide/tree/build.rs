//! Builds: cuts by the surface-area heuristic over bins, eight pieces a node.
//!
//! # Source
//! Binned cuts: Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007; along the longest axis of the centres only. Runs of a few
//! hundred items are cut at whole leaves, so that nearly all leaves are full.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "items are counted in 31 bits; places of bins saturate and are clamped"
)]

use std::{ops::Range, sync::OnceLock};

use glam::Vec3;

use super::{BUILDS, Ends, LEAF, NONE, Node, Ordering, Tree, WIDTH};
use crate::{
    geom::Aabb,
    world::{BINS, cheapest_border},
};

/// Runs up to this long are cut at multiples of [`WIDTH`].
const ALIGNED: usize = 512;

/// Runs up to this long are cut in the middle.
const SMALL: usize = 64;

/// Most items.
pub(in crate::collide) const MAX_ITEMS: usize = 1 << 30;

#[derive(Clone, Copy, Debug)]
struct Item {
    aabb: Aabb,
    id: u32,
}

impl Item {
    /// Midpoint, halved first: the sum may overflow. 0 for empty boxes; infinite ends count as the largest numbers.
    #[inline(always)]
    fn center(&self) -> Vec3 {
        let Aabb { min, max } = self.aabb;
        if min.x > max.x {
            return Vec3::ZERO;
        }
        let whole = Vec3::splat(f32::MAX);
        min.max(-whole) * 0.5 + max.min(whole) * 0.5
    }
}

impl Tree {
    /// Builds over `count` boxes, at most [`MAX_ITEMS`].
    ///
    /// O(n log n), one thread. Equal boxes give equal trees.
    pub(in crate::collide) fn build(count: usize, boxes: impl Fn(u32) -> Aabb) -> Self {
        let mut tree = Self::default();
        tree.rebuild(count, boxes);
        tree
    }

    /// As [`Tree::build`], keeping the memory.
    pub(in crate::collide) fn rebuild(&mut self, count: usize, boxes: impl Fn(u32) -> Aabb) {
        assert!(count <= MAX_ITEMS, "{count} boxes");
        self.nodes.clear();
        self.bounds.clear();
        self.labels = OnceLock::new();
        self.build = BUILDS.fetch_add(1, Ordering::Relaxed);
        let mut items: Vec<Item> =
            (0..count as u32).map(|id| Item { aabb: Ends::new(&boxes(id)).aabb(), id }).collect();
        if count > 0 {
            self.emit(&mut items, 0);
        }
        self.bounds.resize(self.nodes.len(), Ends::EMPTY);
        self.refit(&boxes);
        self.fresh = self.now;
    }

    /// Emits the subtree over `items`; its link.
    fn emit(&mut self, items: &mut [Item], depth: usize) -> u32 {
        let number = self.nodes.len();
        if items.len() <= WIDTH {
            let mut leaf = Node::new(true);
            leaf.count = items.len() as u32;
            for (link, item) in leaf.links.iter_mut().zip(&*items) {
                *link = item.id;
            }
            self.nodes.push(leaf);
            return number as u32 | LEAF;
        }
        self.nodes.push(Node::new(false));
        let pieces = pieces(items, depth);
        let mut links = [NONE; WIDTH];
        for (link, range) in links.iter_mut().zip(&pieces) {
            *link = self.emit(&mut items[range.clone()], depth + 1);
        }
        let node = &mut self.nodes[number];
        node.links = links;
        node.count = pieces.len() as u32;
        number as u32
    }
}

/// A run of items and how large it is.
struct Piece {
    range: Range<usize>,
    bounds: Aabb,
    centers: Aabb,
}

impl Piece {
    fn new(items: &[Item], range: Range<usize>) -> Self {
        let (mut bounds, mut centers) = (Aabb::EMPTY, Aabb::EMPTY);
        for item in &items[range.clone()] {
            bounds = bounds.union(item.aabb);
            centers = centers.grown(item.center());
        }
        Self { range, bounds, centers }
    }

    /// How much a cut of it may save; nothing for a leaf.
    fn weight(&self) -> f64 {
        let count = self.range.len();
        if count <= WIDTH { -1.0 } else { (f64::from(self.bounds.half_area()).min(1e300) + 1e-300) * count as f64 }
    }
}

/// Cuts a run into two to eight.
fn pieces(items: &mut [Item], depth: usize) -> arrayvec::ArrayVec<Range<usize>, WIDTH> {
    let mut pieces = arrayvec::ArrayVec::<Piece, WIDTH>::new();
    pieces.push(Piece::new(items, 0..items.len()));
    while pieces.len() < WIDTH {
        let heaviest =
            (0..pieces.len()).fold(0, |best, i| if pieces[i].weight() > pieces[best].weight() { i } else { best });
        if pieces[heaviest].weight() < 0.0 {
            break;
        }
        let piece = pieces.remove(heaviest);
        let Range { start, end } = piece.range;
        let middle = start + cut(&mut items[start..end], &piece, depth);
        pieces.insert(heaviest, Piece::new(items, middle..end));
        pieces.insert(heaviest, Piece::new(items, start..middle));
    }
    pieces.into_iter().map(|piece| piece.range).collect()
}

/// Levels below which runs are halved, whatever their shape.
const MAX_UNEVEN: usize = 16;

/// Reorders the items and returns where the second half begins.
fn cut(items: &mut [Item], piece: &Piece, depth: usize) -> usize {
    let extent = piece.centers.extent();
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    let count = items.len();
    let (low, scale) = (piece.centers.min[axis], BINS as f32 / extent[axis]);
    let aligned = |place: usize| {
        let whole = (place + WIDTH / 2) / WIDTH * WIDTH;
        whole.clamp(WIDTH, (count - 1) / WIDTH * WIDTH)
    };
    if count <= SMALL || depth >= MAX_UNEVEN || !(scale.is_finite() && extent[axis].is_finite()) {
        return select(items, axis, aligned(count / 2));
    }
    let bin = |item: &Item| (((item.center()[axis] - low) * scale) as usize).min(BINS - 1);
    let border = cheapest_border(items.iter().map(|item| (bin(item), item.aabb)), WIDTH);
    if count > ALIGNED {
        let middle = partition(items, |item| bin(item) < border);
        if middle > 0 && middle < count {
            return middle;
        }
        return select(items, axis, aligned(count / 2));
    }
    let middle = items.iter().filter(|item| bin(item) < border).count();
    select(items, axis, aligned(middle))
}

/// Puts the `middle` items of lowest centre first.
fn select(items: &mut [Item], axis: usize, middle: usize) -> usize {
    items.select_nth_unstable_by(middle, |a, b| a.center()[axis].total_cmp(&b.center()[axis]).then(a.id.cmp(&b.id)));
    middle
}

#[inline(always)]
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> usize {
    let (mut low, mut high) = (0, items.len());
    while low < high {
        if first(&items[low]) {
            low += 1;
        } else {
            high -= 1;
            items.swap(low, high);
        }
    }
    low
}
