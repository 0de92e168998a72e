//! The broad phase: which of many moving boxes meet.
//!
//! One object for calm and for wild motion. While boxes stay within slightly larger ones around them, the pairs of those are kept and only
//! tested again ([`BroadMethod::Keep`]). When some leave, pairs are collected anew in the way that measured cheapest for such motion: a
//! hierarchy of sorted event lists is sorted again ([`BroadMethod::Resort`]), a tree is refitted ([`BroadMethod::Refit`]) or built
//! anew ([`BroadMethod::Rebuild`]). A few stray boxes are looked up one by one. The pairs are always the exact ones, in ascending order, whichever way won.

mod choice;
mod lists;
mod sorting;
#[cfg(test)]
mod tests;

use std::{ops::ControlFlow, time::Instant};

use glam::Vec4;

use super::{boxes_meet, tree::Tree};
use crate::{geom::Aabb, simd::Scalar};
use choice::Choice;
use lists::Lists;
use sorting::{merge, sort_pairs};

/// How the pairs of a frame were found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BroadMethod {
    /// The pairs of an earlier frame's larger boxes, tested again.
    Keep,
    /// Sorted event lists, sorted again.
    Resort,
    /// A refitted tree.
    Refit,
    /// A tree built anew.
    #[default]
    Rebuild,
}

impl BroadMethod {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Keep, Self::Resort, Self::Refit, Self::Rebuild];

    /// `keep`, `resort`, `refit` or `rebuild`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Resort => "resort",
            Self::Refit => "refit",
            Self::Rebuild => "rebuild",
        }
    }
}

/// Finds the pairs of boxes that meet, frame after frame.
///
/// Which way is taken depends on measured times, what is found does not: another machine or run may take other ways and finds the same pairs. A way
/// that was dearer when last tried is tried again when a fiftieth of the time since then pays for it.
#[derive(Debug, Default)]
pub struct BroadPhase {
    /// Of the last frame.
    boxes: Vec<Aabb>,
    /// What candidates were collected for: the boxes, or larger ones.
    fat: Vec<Aabb>,
    /// Over `fat` as it was when the tree was last refitted or built.
    tree: Tree,
    /// The tree is of an earlier frame than `fat`, since lists were used.
    is_behind: bool,
    lists: Lists,
    /// Pairs of `fat` that meet, ascending.
    candidates: Vec<[u32; 2]>,
    /// Pairs of `boxes` that meet, ascending.
    pairs: Vec<[u32; 2]>,
    /// Boxes whose fat one is not that of the tree.
    loose: Vec<u32>,
    strays: Vec<u32>,
    scratch: Vec<u32>,
    spare: Vec<[u32; 2]>,
    /// Ends of the boxes, for wide comparisons.
    wide: Vec<[Vec4; 2]>,
    keys: Vec<u64>,
    other_keys: Vec<u64>,
    choice: Choice,
    last: BroadMethod,
    counts: [u64; 4],
}

/// Boxes are made larger by at most this share of their mean edge.
const LARGEST_MARGIN: f32 = 0.1;

/// Frames that boxes shall stay within their larger ones.
const FRAMES: f32 = 8.0;

/// Margins that hold for fewer frames than this are not worth their pairs.
const LEAST_FRAMES: f32 = 2.0;

/// Share of boxes that may be looked up one by one.
const STRAYS: usize = 64;

impl BroadPhase {
    /// Takes the boxes of the next frame: the pairs `[i, j]`, `i < j`, of closed ones that share a point, ascending.
    ///
    /// Empty boxes and those with NaN meet nothing; infinite ends are legal. Their number may change, which makes everything anew. In steady state
    /// nothing is allocated.
    ///
    /// Cost: for boxes about as large as their distances, some 25 ns a box in frames that keep pairs, 150 to 250 ns where all moved far. One thread.
    ///
    /// # Panics
    /// With more than 2^30 boxes.
    pub fn update(&mut self, boxes: &[Aabb]) -> &[[u32; 2]] {
        let method = self.find(boxes);
        self.last = method;
        self.counts[method as usize] += 1;
        self.boxes.clear();
        self.boxes.extend_from_slice(boxes);
        &self.pairs
    }

    /// The pairs of the last frame.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// How they were found.
    pub fn last_method(&self) -> BroadMethod {
        self.last
    }

    /// In how many frames a method was the one.
    pub fn frames_by(&self, method: BroadMethod) -> u64 {
        self.counts[method as usize]
    }

    fn find(&mut self, boxes: &[Aabb]) -> BroadMethod {
        if boxes.len() != self.fat.len() {
            self.lists.clear();
            self.fatten(boxes, 0.0);
            let began = Instant::now();
            self.collect(BroadMethod::Rebuild, boxes, false);
            self.choice.begin(false, began.elapsed());
            return BroadMethod::Rebuild;
        }
        if self.stays(boxes) {
            self.test_candidates(boxes);
            return BroadMethod::Keep;
        }
        let (motion, edge) = motion(&self.boxes, boxes);
        let margin = (FRAMES * motion).min(LARGEST_MARGIN * edge);
        let margin = if margin >= LEAST_FRAMES * motion && margin.is_finite() { margin } else { 0.0 };
        // Where boxes stay for a while, a better tree pays.
        let wild = margin <= 0.0;
        let method = self.choice.next(motion, wild);
        self.fatten(boxes, margin);
        let began = Instant::now();
        self.collect(method, boxes, wild);
        self.choice.note(method, wild, motion, began.elapsed());
        method
    }

    /// Whether boxes are within their fat ones, but for a few, whose candidates are then looked up.
    fn stays(&mut self, boxes: &[Aabb]) -> bool {
        self.strays.clear();
        let most = boxes.len() / STRAYS;
        for (number, (aabb, fat)) in (0..).zip(boxes.iter().zip(&self.fat)) {
            if !within(fat, aabb) {
                if self.strays.len() >= most {
                    return false;
                }
                self.strays.push(number);
            }
        }
        if self.strays.is_empty() {
            return true;
        }
        if self.loose.len() + self.strays.len() > most {
            return false;
        }
        self.look_up_strays(boxes);
        true
    }

    fn look_up_strays(&mut self, boxes: &[Aabb]) {
        if std::mem::take(&mut self.is_behind) {
            // No box is loose yet: that would have been a stray.
            let fat = &self.fat;
            self.tree.refit(&|i: u32| fat[i as usize]);
        }
        for &stray in &self.strays {
            let (old, new) = (self.boxes[stray as usize], boxes[stray as usize]);
            // As far as it came in this frame, each way.
            let moved = (new.min - old.min).abs().max((new.max - old.max).abs()).max_element();
            self.fat[stray as usize] = if moved.is_finite() { grown(&new, moved) } else { new };
        }
        for &stray in &self.strays {
            if !self.loose.contains(&stray) {
                self.loose.push(stray);
            }
        }
        let (strays, fat, loose) = (&self.strays, &self.fat, &self.loose);
        self.candidates.retain(|[a, b]| strays.binary_search(a).is_err() && strays.binary_search(b).is_err());
        let mut found = Vec::new();
        for &stray in strays {
            let around = fat[stray as usize];
            let mut offer = |other: u32| {
                // Of two strays the first finds the pair.
                let known = other == stray || (other < stray && strays.binary_search(&other).is_ok());
                if !known && boxes_meet(&around, &fat[other as usize]) {
                    found.push([stray.min(other), stray.max(other)]);
                }
            };
            // The visitor never breaks.
            let _ = self.tree.meeting::<Scalar>(&around, &mut self.scratch, &mut |other| {
                if !loose.contains(&other) {
                    offer(other);
                }
                ControlFlow::Continue(())
            });
            for &other in loose {
                offer(other);
            }
        }
        found.sort_unstable();
        merge(&mut self.candidates, &found);
    }

    fn fatten(&mut self, boxes: &[Aabb], margin: f32) {
        self.loose.clear();
        self.fat.clear();
        if margin > 0.0 {
            self.fat.extend(boxes.iter().map(|aabb| grown(aabb, margin)));
        } else {
            self.fat.extend_from_slice(boxes);
        }
    }

    /// Finds the pairs of `fat` and of those the pairs of `boxes`.
    fn collect(&mut self, method: BroadMethod, boxes: &[Aabb], wild: bool) {
        let fat = &self.fat;
        let candidates = &mut self.candidates;
        candidates.clear();
        let mut push = |a: u32, b: u32| {
            candidates.push([a.min(b), a.max(b)]);
            ControlFlow::Continue(())
        };
        match method {
            BroadMethod::Rebuild if wild => self.tree.rebuild_by_curve(fat, &mut self.keys, &mut self.other_keys),
            BroadMethod::Rebuild => self.tree.rebuild(fat.len(), |i| fat[i as usize]),
            BroadMethod::Resort => {}
            _ => self.tree.refit(&|i: u32| fat[i as usize]),
        }
        self.is_behind = method == BroadMethod::Resort;
        if method == BroadMethod::Resort {
            self.lists.update(&self.tree, fat);
            self.lists.pairs(&mut push);
        } else {
            self.tree.own_pairs(&mut push);
        }
        sort_pairs(candidates, fat.len(), &mut self.scratch, &mut self.spare);
        self.test_candidates(boxes);
    }

    /// Of the candidates, whose boxes all have an inside.
    fn test_candidates(&mut self, boxes: &[Aabb]) {
        self.wide.clear();
        self.wide.extend(boxes.iter().map(|aabb| [aabb.min.extend(0.0), aabb.max.extend(0.0)]));
        let wide = &self.wide;
        let meet = |pair: &&[u32; 2]| {
            let ([low_a, high_a], [low_b, high_b]) = (&wide[pair[0] as usize], &wide[pair[1] as usize]);
            (low_a.cmple(*high_b) & low_b.cmple(*high_a)).all()
        };
        self.pairs.clear();
        self.pairs.extend(self.candidates.iter().filter(meet));
    }
}

/// Whether a box lies within another; an empty one in an empty one only.
fn within(fat: &Aabb, aabb: &Aabb) -> bool {
    let inside = fat.min.cmple(aabb.min) & aabb.max.cmple(fat.max) & aabb.min.cmple(aabb.max);
    inside.all() || (aabb.is_empty() && fat.is_empty())
}

/// A box made larger on all sides, by no less than `by` but for the least step of f32.
fn grown(aabb: &Aabb, by: f32) -> Aabb {
    if aabb.is_empty() { *aabb } else { Aabb { min: aabb.min - by, max: aabb.max + by } }
}

/// How far ends of boxes moved, the few fastest boxes left out, and the mean edge of the boxes; of finite ones.
fn motion(old: &[Aabb], new: &[Aabb]) -> (f32, f32) {
    // Counted by powers of two, with the furthest of each.
    let mut bins = [(0_usize, 0.0_f32); 256];
    let (mut edges, mut count) = (0.0_f64, 0_u32);
    for (a, b) in old.iter().zip(new) {
        let moved = (b.min - a.min).abs().max((b.max - a.max).abs()).max_element();
        let edge = b.extent();
        if moved.is_finite() && edge.is_finite() {
            let bin = &mut bins[(moved.to_bits() >> 23) as usize & 255];
            *bin = (bin.0 + 1, bin.1.max(moved));
            edges += f64::from(edge.element_sum());
            count += 3;
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "a mean of f32")]
    let mean = if count > 0 { (edges / f64::from(count)) as f32 } else { 0.0 };
    let mut faster = 0;
    let left_out = new.len() / STRAYS / 8;
    let furthest = bins.iter().rev().find_map(|&(boxes, furthest)| {
        faster += boxes;
        (faster > left_out).then_some(furthest)
    });
    (furthest.unwrap_or(0.0), mean.max(0.0))
}
