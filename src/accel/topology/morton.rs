//! Triangles in the order of a space-filling curve.
//!
//! # Source
//! Morton, "A Computer Oriented Geodetic Data Base", 1966: the codes. Departure: the number of a triangle stands in the same word as its code and
//! takes no more bits than it must; what is left of 64 makes the grid, so that few triangles share a cell, and no two words are equal.

#![expect(clippy::cast_possible_truncation, reason = "numbers are below 2^28")]

use rayon::prelude::*;

use super::{
    CHUNK,
    bounds::{Bounds, PrimRef, greater, lesser},
};
use crate::simd::{Simd, SimdLevel, Task, dispatch};

/// Most bits that an axis of the grid has.
const MAX_AXIS_BITS: u32 = 21;

/// Bits of a digit of the radix sort, and how many digits of a code it sorts by; the few triangles that are equal in these are sorted by comparison.
const DIGIT: u32 = 11;
const DIGITS: u32 = 3;

/// Numbers from here on have no fraction: the lowest bits of their form are those of the whole number that was added.
const WHOLE: f32 = 8_388_608.0;
const PLACE: u32 = (1 << MAX_AXIS_BITS) - 1;

/// Triangles whose codes are made together.
const GROUP: usize = 64;

/// Fewer words are sorted by comparison.
const FEW: usize = 1024;

/// The numbers of the triangles in their order along the curve.
pub(super) struct Order {
    words: Vec<u64>,
    number_bits: u32,
}

impl Order {
    /// Of all triangles, given the box of the centres of those that may be hit; those that are never hit come first.
    pub(super) fn new(refs: &[PrimRef], centers: &Bounds) -> Self {
        let grid = Grid::new(refs, centers);
        let mut words = vec![0; refs.len()];
        words.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, words)| {
            dispatch(SimdLevel::best(), Words(&grid, refs, chunk * CHUNK, words));
        });
        sort(&mut words, grid.number_bits, 3 * grid.axis_bits);
        Self { words, number_bits: grid.number_bits }
    }

    /// The cell of the triangle at a place of the order, along the curve.
    #[inline(always)]
    pub(super) fn code(&self, place: usize) -> u64 {
        self.words[place] >> self.number_bits
    }

    /// The triangle at a place of the order.
    #[inline(always)]
    pub(super) fn number(&self, place: usize) -> u32 {
        (self.words[place] & ((1 << self.number_bits) - 1)) as u32
    }
}

/// A grid of cubes around all centres.
struct Grid {
    low: [f32; 3],
    scale: f32,
    last: f32,
    number_bits: u32,
    axis_bits: u32,
}

impl Grid {
    fn new(refs: &[PrimRef], centers: &Bounds) -> Self {
        let number_bits = usize::BITS - refs.len().leading_zeros();
        let axis_bits = ((u64::BITS - number_bits) / 3).min(MAX_AXIS_BITS);
        let cells = ((1_u32 << axis_bits) - 1) as f32;
        let extent = centers.extent(0).max(centers.extent(1)).max(centers.extent(2));
        let scale = cells / extent;
        // An extent of 0, and one that is next to it, puts everything into one cell.
        let scale = if extent > 0.0 && scale.is_finite() { scale } else { 0.0 };
        Self { low: centers.low(), scale, last: cells, number_bits, axis_bits }
    }

    /// The words of the triangles from number `first` on.
    #[inline(always)]
    fn words(&self, refs: &[PrimRef], first: usize, words: &mut [u64]) {
        let mut places = [[0_u32; GROUP]; 3];
        let mut number = first;
        for words in words.chunks_mut(GROUP) {
            for i in 0..words.len() {
                let prim = &refs[number + i];
                let (center, is_absent) = (prim.center(), prim.is_absent());
                for axis in 0..3 {
                    let place = lesser(greater((center[axis] - self.low[axis]) * self.scale, 0.0), self.last);
                    places[axis][i] = if is_absent { 0 } else { (place + WHOLE).to_bits() & PLACE };
                }
            }
            let mut codes = [0; GROUP];
            for i in 0..GROUP {
                codes[i] = spread(places[0][i]) | spread(places[1][i]) << 1 | spread(places[2][i]) << 2;
            }
            for i in 0..words.len() {
                words[i] = codes[i] << self.number_bits | (number + i) as u64;
            }
            number += words.len();
        }
    }
}

/// [`Grid::words`] compiled for the machine.
struct Words<'a>(&'a Grid, &'a [PrimRef], usize, &'a mut [u64]);

impl Task for Words<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        self.0.words(self.1, self.2, self.3);
    }
}

/// The bits of a number of at most 21 with two zeros after each.
#[inline(always)]
fn spread(number: u32) -> u64 {
    let mut x = u64::from(number);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Sorts words whose bits from `low` on are codes of `bits` bits, in the current rayon pool. They differ, so that there is one order.
fn sort(words: &mut [u64], low: u32, bits: u32) {
    let mut other = vec![0; words.len()];
    let low = low + bits.saturating_sub(DIGIT * DIGITS);
    let pieces = rayon::current_num_threads().next_power_of_two().min(words.len() / CHUNK + 1);
    sort_pieces(words, &mut other, low, pieces);
}

fn sort_pieces(words: &mut [u64], other: &mut [u64], low: u32, pieces: usize) {
    if pieces < 2 {
        sort_alone(words, other, low);
        return;
    }
    let half = words.len() / 2;
    let (words0, words1) = words.split_at_mut(half);
    let (other0, other1) = other.split_at_mut(half);
    rayon::join(|| sort_pieces(words0, other0, low, pieces / 2), || sort_pieces(words1, other1, low, pieces / 2));
    merge(words0, words1, other, pieces);
    words.par_chunks_mut(CHUNK).zip(other.par_chunks(CHUNK)).for_each(|(to, from)| to.copy_from_slice(from));
}

/// Merges two sorted runs, in parallel pieces.
fn merge(first: &[u64], second: &[u64], out: &mut [u64], pieces: usize) {
    if pieces > 1 && first.len() > 1 {
        let half = first.len() / 2;
        let other = second.partition_point(|word| *word < first[half]);
        let (first0, first1) = first.split_at(half);
        let (second0, second1) = second.split_at(other);
        let (out0, out1) = out.split_at_mut(half + other);
        rayon::join(|| merge(first0, second0, out0, pieces / 2), || merge(first1, second1, out1, pieces / 2));
        return;
    }
    let (mut i, mut j) = (0, 0);
    for word in out {
        let a = first.get(i).copied().unwrap_or(u64::MAX);
        let b = second.get(j).copied().unwrap_or(u64::MAX);
        *word = a.min(b);
        i += usize::from(a < b);
        j += usize::from(a >= b);
    }
}

/// Sorts by digits, then what is equal in them by comparison.
fn sort_alone(words: &mut [u64], other: &mut [u64], low: u32) {
    if words.len() < FEW {
        words.sort_unstable();
        return;
    }
    let digits = DIGITS as usize;
    let mut counts = vec![[0_u32; 1 << DIGIT]; digits];
    for &word in &*words {
        for (digit, counts) in counts.iter_mut().enumerate() {
            counts[digit_of(word, low, digit as u32)] += 1;
        }
    }
    let (mut from, mut to) = (&mut *words, &mut *other);
    let mut is_swapped = false;
    for (digit, counts) in counts.iter_mut().enumerate() {
        if counts[digit_of(from[0], low, digit as u32)] as usize == from.len() {
            continue;
        }
        let mut next = 0;
        for count in &mut *counts {
            next += std::mem::replace(count, next);
        }
        for &word in &*from {
            let place = &mut counts[digit_of(word, low, digit as u32)];
            to[*place as usize] = word;
            *place += 1;
        }
        std::mem::swap(&mut from, &mut to);
        is_swapped = !is_swapped;
    }
    if is_swapped {
        to.copy_from_slice(from);
    }
    sort_equal(words, low);
}

#[inline(always)]
fn digit_of(word: u64, low: u32, digit: u32) -> usize {
    (word >> (low + DIGIT * digit)) as usize & ((1 << DIGIT) - 1)
}

/// Sorts the runs of words that are equal from bit `low` on.
fn sort_equal(words: &mut [u64], low: u32) {
    let mut first = 0;
    for i in 1..=words.len() {
        if i == words.len() || words[i] >> low != words[first] >> low {
            if i - first > 1 {
                words[first..i].sort_unstable();
            }
            first = i;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{accel::topology::bounds::normalize, geom::Triangles};

    proptest! {
        #[test]
        fn words_are_sorted_whatever_the_number_of_pieces(
            seed in 1_u64..u64::MAX,
            count in 0_usize..5000,
            distinct in 0_u32..33,
            pieces in 0_u32..4,
        ) {
            let mut state = seed;
            let mut words: Vec<u64> = (0..count as u64).map(|i| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> (64 - distinct - 1)) << 20 | i
            }).collect();
            let mut due = words.clone();
            due.sort_unstable();
            let mut other = vec![0; count];
            sort_pieces(&mut words, &mut other, 20, 1 << pieces);
            prop_assert_eq!(words, due);
        }
    }

    #[test]
    fn a_number_is_spread_to_every_third_bit() {
        for bit in 0..MAX_AXIS_BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread((1 << MAX_AXIS_BITS) - 1).count_ones(), MAX_AXIS_BITS);
    }

    #[test]
    fn triangles_along_a_line_keep_its_order_and_those_never_hit_come_first() {
        let mut positions: Vec<_> = (0..100_u8).map(|i| Vec3::new(f32::from(99 - i), 0.0, 0.0)).collect();
        positions[40].y = f32::NAN;
        let indices: Vec<_> = (0..100).map(|i| [i; 3]).collect();
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
        let mut refs: Vec<_> = (0..100).map(|id| PrimRef::new(&prims, id)).collect();
        let centers = normalize(&mut refs);
        let order = Order::new(&refs, &centers);
        let found: Vec<_> = (0..100).map(|place| order.number(place)).collect();
        let mut due = vec![40];
        due.extend((0..100).rev().filter(|&i| i != 40));
        assert_eq!(found, due);
    }
}
