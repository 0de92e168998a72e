//! Clusters that are merged with each other, in the fastest memory.

#![expect(clippy::cast_possible_truncation, reason = "clusters are fewer than triangles, which are counted in u32")]

use super::{Builder, Cluster, Merger, PIECE, Rest, Slots, packed};
use crate::{
    accel::{
        sah::{BLOCK, COST_BLOCK, COST_TRAVERSE},
        topology::{
            Child, Settings,
            bounds::{greater, lesser},
        },
    },
    simd::prefetch,
};

/// Places looked at for one cluster: the seven next ones to both sides, itself, and one more that does not count.
const WINDOW: usize = 16;
const OWN: usize = WINDOW / 2;

/// The lanes of a window that do not count.
const NOT: [u32; WINDOW] = [u32::MAX, 0, 0, 0, 0, 0, 0, 0, u32::MAX, 0, 0, 0, 0, 0, 0, 0];

/// How often leaves are merged. More rounds make fuller leaves of triangles that are farther apart, which costs more than it gains.
const ROUNDS: usize = 2;

/// In how many of them only neighbours next to each other count.
const NEXT_ROUNDS: usize = 1;

/// Places of clusters, and those around them that are looked at.
const PLACES: usize = PIECE + WINDOW;

/// Half the extent of boxes where there is no cluster: their areas are finite and beyond any.
const FAR: f32 = 1e18;

/// Areas from here on are of no clusters that could be merged.
const NEVER: u32 = 1e30_f32.to_bits();

/// Marks a cluster that was merged into an earlier one.
const GONE: u32 = u32::MAX - 1;

/// The bits of a distance that give way to those in which the numbers of the pair differ.
const PAIR: u32 = 127;

/// Up to [`PIECE`] clusters; those by axis and `prims` stand [`OWN`] places later.
pub(super) struct Work<'a> {
    settings: &'a Settings,
    slots: Slots<'a>,
    /// Mergers made.
    made: usize,
    count: usize,
    low: [[f32; PLACES]; 3],
    high: [[f32; PLACES]; 3],
    prims: [u32; PLACES],
    /// The best neighbours: distances with the lowest bits replaced.
    near: [u32; PIECE],
    rest: [Rest; PIECE],
    /// Of clusters that are to be leaves: half the area of the box, and the triangles.
    areas: [f32; PIECE],
    members: [[u32; BLOCK]; PIECE],
}

impl<'a> Work<'a> {
    #[inline(always)]
    pub(super) fn new(settings: &'a Settings, slots: Slots<'a>) -> Self {
        Self {
            settings,
            slots,
            made: 0,
            count: 0,
            low: [[-FAR; PLACES]; 3],
            high: [[FAR; PLACES]; 3],
            prims: [0; PLACES],
            near: [u32::MAX; PIECE],
            rest: [Rest::NONE; PIECE],
            areas: [0.0; PIECE],
            members: [[0; BLOCK]; PIECE],
        }
    }

    /// Moves the clusters from place `first` of the list here.
    #[inline(always)]
    pub(super) fn load(&mut self, list: &mut Vec<Cluster>, first: usize) {
        let count = list.len() - first;
        for i in 0..count {
            let Cluster { low, high, prims, rest } = &list[first + i];
            self.set_box(i, low, high);
            self.prims[i + OWN] = *prims;
            self.rest[i] = *rest;
        }
        self.end(count);
        list.truncate(first);
    }

    /// Appends the clusters to the list.
    #[inline(always)]
    pub(super) fn store(&self, list: &mut Vec<Cluster>) {
        for i in 0..self.count {
            let (low, high) = self.bounds(i);
            list.push(Cluster { low, high, prims: self.prims[i + OWN], rest: self.rest[i] });
        }
    }

    /// Takes triangles of the order, each as a leaf.
    #[inline(always)]
    pub(super) fn take(&mut self, builder: &Builder<'_>, first: usize, count: usize) {
        let ahead = (first + PIECE).min(builder.curve.len())..(first + 2 * PIECE).min(builder.curve.len());
        for place in ahead {
            prefetch(builder.refs, builder.curve.number(place) as usize);
        }
        for i in 0..count {
            let number = builder.curve.number(first + i);
            let (low, high) = builder.refs[number as usize].corners();
            self.set_box(i, &low, &high);
            self.prims[i + OWN] = 1;
            self.areas[i] = half_area(&low, &high);
            self.members[i] = [number; BLOCK];
        }
        self.end(count);
    }

    #[inline(always)]
    fn set_box(&mut self, i: usize, low: &[f32; 3], high: &[f32; 3]) {
        for axis in 0..3 {
            self.low[axis][i + OWN] = low[axis];
            self.high[axis][i + OWN] = high[axis];
        }
    }

    #[inline(always)]
    fn bounds(&self, i: usize) -> ([f32; 3], [f32; 3]) {
        let at = i + OWN;
        let low = [self.low[0][at], self.low[1][at], self.low[2][at]];
        (low, [self.high[0][at], self.high[1][at], self.high[2][at]])
    }

    /// The box around two.
    #[inline(always)]
    fn union(&self, i: usize, other: usize) -> ([f32; 3], [f32; 3]) {
        let ((mut low, mut high), (low1, high1)) = (self.bounds(i), self.bounds(other));
        for axis in 0..3 {
            low[axis] = lesser(low[axis], low1[axis]);
            high[axis] = greater(high[axis], high1[axis]);
        }
        (low, high)
    }

    /// Moves the box and number of triangles of a cluster to an earlier place.
    #[inline(always)]
    fn keep(&mut self, i: usize, to: usize) {
        for axis in 0..3 {
            self.low[axis][to + OWN] = self.low[axis][i + OWN];
            self.high[axis][to + OWN] = self.high[axis][i + OWN];
        }
        self.prims[to + OWN] = self.prims[i + OWN];
    }

    /// Ends the list here: nothing is near what follows.
    #[inline(always)]
    fn end(&mut self, count: usize) {
        for i in count + OWN..(count + WINDOW).max(self.count + OWN) {
            for axis in 0..3 {
                self.low[axis][i] = -FAR;
                self.high[axis][i] = FAR;
            }
            self.prims[i] = 0;
        }
        self.count = count;
    }

    /// Finds the best neighbour of each cluster: that with which it has the smallest box. Those that would have more than `most` triangles do not count.
    #[inline(always)]
    fn search(&mut self, most: u32) {
        for i in 0..self.count {
            let own = i + OWN;
            let [lx, ly, lz] = [window(&self.low[0], i), window(&self.low[1], i), window(&self.low[2], i)];
            let [hx, hy, hz] = [window(&self.high[0], i), window(&self.high[1], i), window(&self.high[2], i)];
            let prims: &[u32; WINDOW] = self.prims[i..i + WINDOW].first_chunk().expect("as long");
            let room = most - self.prims[own];
            if room == 0 {
                self.near[i] = u32::MAX;
                continue;
            }
            let mut least = u32::MAX;
            for lane in 0..WINDOW {
                let x = greater(hx[lane], hx[OWN]) - lesser(lx[lane], lx[OWN]);
                let y = greater(hy[lane], hy[OWN]) - lesser(ly[lane], ly[OWN]);
                let z = greater(hz[lane], hz[OWN]) - lesser(lz[lane], lz[OWN]);
                let area = x * (y + z) + y * z;
                let key = area.to_bits() & !PAIR | (own ^ (i + lane)) as u32 | NOT[lane];
                let key = if prims[lane] > room { u32::MAX } else { key };
                least = if key < least { key } else { least };
            }
            self.near[i] = least;
        }
    }

    /// As [`Work::search`], among the clusters next to each.
    #[inline(always)]
    fn search_next(&mut self, most: u32) {
        let mut keys = [u32::MAX; PIECE + 1];
        let [lx, ly, lz] = &self.low;
        let [hx, hy, hz] = &self.high;
        for i in 0..PIECE {
            let (own, next) = (i + OWN, i + OWN + 1);
            let x = greater(hx[own], hx[next]) - lesser(lx[own], lx[next]);
            let y = greater(hy[own], hy[next]) - lesser(ly[own], ly[next]);
            let z = greater(hz[own], hz[next]) - lesser(lz[own], lz[next]);
            let area = x * (y + z) + y * z;
            let key = area.to_bits() & !PAIR | (own ^ next) as u32;
            keys[i + 1] = if self.prims[own] + self.prims[next] > most { u32::MAX } else { key };
        }
        for i in 0..PIECE {
            self.near[i] = keys[i].min(keys[i + 1]);
        }
    }

    /// The later cluster whose best neighbour a cluster is, if it is its own best one. A pair is asked for once.
    #[inline(always)]
    fn partner(&self, i: usize) -> Option<usize> {
        let near = self.near[i];
        if near >= NEVER {
            return None;
        }
        let other = ((i + OWN) ^ (near & PAIR) as usize).wrapping_sub(OWN) & (PIECE - 1);
        (other > i && self.near[other] == near).then_some(other)
    }

    /// Merges triangles until no two leaves can be one of a block, and writes the leaves.
    #[inline(always)]
    pub(super) fn merge_leaves(&mut self, leaves: &mut [u32], first: usize) {
        let most = self.settings.leaf.min(BLOCK) as u32;
        for round in 0..if most > 1 { ROUNDS } else { 0 } {
            let before = self.count;
            if round < NEXT_ROUNDS {
                self.search_next(most);
            } else {
                self.search(most);
            }
            let mut kept = 0;
            for i in 0..before {
                if self.near[i] == GONE {
                    continue;
                }
                let partner = self.partner(i);
                self.keep(i, kept);
                self.areas[kept] = self.areas[i];
                self.members[kept] = self.members[i];
                if let Some(other) = partner {
                    self.merge_leaf(kept, other);
                }
                kept += 1;
            }
            self.end(kept);
        }
        let mut place = 0;
        for i in 0..self.count {
            let (count, area) = (self.prims[i + OWN] as usize, self.areas[i]);
            let child = Child::leaf(first as u32 + place as u32, count);
            self.rest[i] = Rest { area, cost: area * COST_BLOCK as f32, child, ..Rest::NONE };
            leaves[place..place + count].copy_from_slice(&self.members[i][..count]);
            place += count;
        }
    }

    /// Merges a leaf into another when one block costs no more than a pair of two.
    #[inline(always)]
    fn merge_leaf(&mut self, into: usize, other: usize) {
        let (low, high) = self.union(into, other);
        let area = half_area(&low, &high);
        let gain = COST_BLOCK as f32 * (self.areas[into] + self.areas[other] - area) + COST_TRAVERSE as f32 * area;
        if gain < 0.0 {
            return;
        }
        self.near[other] = GONE;
        self.set_box(into, &low, &high);
        self.areas[into] = area;
        let (own, added) = (self.prims[into + OWN] as usize, self.members[other]);
        self.prims[into + OWN] += self.prims[other + OWN];
        for place in own..BLOCK {
            self.members[into][place] = added[place - own];
        }
    }

    /// Merges until at most so many are left.
    #[inline(always)]
    pub(super) fn merge(&mut self, left: usize) {
        while self.count > left {
            self.search(u32::MAX);
            let mut kept = 0;
            for i in 0..self.count {
                if self.near[i] == GONE {
                    continue;
                }
                if let Some(other) = self.partner(i) {
                    self.near[other] = GONE;
                    self.merge_pair(i, other, kept);
                } else {
                    self.keep(i, kept);
                    self.rest[kept] = self.rest[i];
                }
                kept += 1;
            }
            self.end(kept);
        }
    }

    /// Makes the pair of two clusters, or the leaf where that is cheaper.
    #[inline(always)]
    fn merge_pair(&mut self, i: usize, other: usize, to: usize) {
        let ((low0, high0), (low1, high1)) = (self.bounds(i), self.bounds(other));
        let mut ahead = [0.0; 3];
        for axis in 0..3 {
            ahead[axis] = (low1[axis] + high1[axis]) - (low0[axis] + high0[axis]);
        }
        let size = [ahead[0].abs(), ahead[1].abs(), ahead[2].abs()];
        let axis = if size[0] >= size[1] && size[0] >= size[2] { 0 } else { 1 + usize::from(size[2] > size[1]) };
        let (first, second) = if ahead[axis] < 0.0 { (other, i) } else { (i, other) };
        let (low, high) = self.union(i, other);
        let (below, prims) = (self.prims[first + OWN], self.prims[first + OWN] + self.prims[second + OWN]);
        let (first, second) = (self.rest[first], self.rest[second]);
        let area = half_area(&low, &high);
        let cost = area * COST_TRAVERSE as f32 + (first.cost + second.cost);
        let child = Child::inner(self.slots.first + self.made);
        let (pairs, height) = (first.pairs + second.pairs + 1, first.height.max(second.height) + 1);
        let mut rest = Rest { area, cost, child, pairs, height };
        let mut is_leaf = false;
        if prims as usize <= self.settings.leaf {
            let leaf_cost = area * self.settings.leaf_cost(prims);
            is_leaf = leaf_cost <= cost;
            if is_leaf {
                rest = Rest { cost: leaf_cost, pairs: 0, height: 0, ..rest };
            }
        }
        let children = [packed(first.child), packed(second.child)];
        let (axis, is_leaf) = (axis as u16, u16::from(is_leaf));
        self.slots.mergers[self.made] = Merger { children, area, axis, is_leaf, pairs: first.pairs, prims: below };
        self.made += 1;
        self.set_box(to, &low, &high);
        self.prims[to + OWN] = prims;
        self.rest[to] = rest;
    }
}

#[inline(always)]
fn half_area(low: &[f32; 3], high: &[f32; 3]) -> f32 {
    let (x, y, z) = (high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    x * (y + z) + y * z
}

#[inline(always)]
fn window(all: &[f32; PLACES], first: usize) -> &[f32; WINDOW] {
    all[first..].first_chunk().expect("places go on beyond the last cluster")
}
