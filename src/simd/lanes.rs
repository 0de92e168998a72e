use std::{
    fmt::Debug,
    ops::{Add, Div, Mul, Neg, Sub},
};

use super::{SimdLevel, Task, Texels};

/// The wide types of one level. Only this module implements it; the types of levels that a machine may lack are
/// private, so code runs with them only below [`super::dispatch`].
pub trait Simd: Copy + Send + Sync + 'static {
    /// The level that the implementor stands for.
    const LEVEL: SimdLevel;
    /// Four f32: the planes of two sibling boxes on one axis.
    type F4: Halves;
    /// Eight f32: a plane of each of eight boxes.
    type F8: Lanes<Elem = f32>;
    /// Eight words beside them.
    type U8: Copy + Debug;
    /// A choice among eight lanes.
    type M8: Copy + Debug;
    /// Four f64: a block of four triangles.
    type D4: Lanes<Elem = f64>;
    /// The widest f32: one lane a ray of a packet.
    type F: Texels;
    /// Half as many f64 as there are lanes in `F`, or all of them where that is a single vector.
    type D: Lanes<Elem = f64>;

    /// Four f32 as f64, exactly.
    fn widen(narrow: Self::F4) -> Self::D4;

    /// The first numbers of a slice as f64, exactly. Panics when it is too short.
    fn load_wide(from: &[f32]) -> Self::D;

    /// The columns of as many records as `F` has lanes: number j of record i goes to lane i of row j. Panics when there are fewer records.
    fn columns(records: &[[f32; 8]], to: &mut [[f32; 16]; 8]);

    /// The columns of eight records: number j of record i goes to lane i of row j.
    fn eight_columns(records: &[[f32; 8]; 8], to: &mut [[f32; 8]; 8]);

    /// The corners of `count` triangles, one to four, each named by the first three words of a record; the last stands in for those that four lack. A corner takes four lanes,
    /// with any number in the fourth: vectors of eight lanes hold the first two triangles and the others, those of sixteen all of them, both times. `None` where
    /// a corner is the last vertex of all or is none.
    fn corners(from: &[[f32; 3]], records: &[[u32; 4]], count: usize) -> Option<[[Self::F; 3]; 2]>;

    /// `[1, 2, 0, 3]` in each four lanes.
    fn rotated(numbers: Self::F) -> Self::F;

    /// [`Lanes::min`] of all fours of lanes, for numbers that are not NaN.
    fn least_four(numbers: Self::F) -> Self::F4;

    /// [`Lanes::max`] of all fours of lanes, for numbers that are not NaN.
    fn greatest_four(numbers: Self::F) -> Self::F4;

    /// Eight bytes as numbers.
    fn of_bytes(bytes: &[u8; 8]) -> Self::F8;

    /// Eight whole numbers, each from 0 to 255, as bytes.
    fn to_bytes(numbers: Self::F8) -> [u8; 8];

    /// The least and the greatest number of the chosen lanes; infinity and its negative where there are none. No number may be NaN.
    fn range(numbers: Self::F, chosen: u32) -> [f32; 2];

    /// Rounds the ends of intervals to f32 and writes those of `low`, 0 as +0: the lanes whose ends agree. Panics when `to` is too short.
    fn agreed(low: Self::D, high: Self::D, to: &mut [f32]) -> u32;

    /// Writes `word` to the places whose bit is set, as many as `F` has lanes.
    fn write_where(chosen: u32, word: u32, to: &mut [u32; 16]);

    /// Eight words.
    fn words(from: &[u32; 8]) -> Self::U8;

    /// The words with the bits of `flips` inverted in all of them.
    fn flipped(words: Self::U8, flips: u32) -> Self::U8;

    /// Lanes whose word has bit `31 - LEFT`.
    fn with_bit<const LEFT: i32>(words: Self::U8) -> Self::M8;

    /// [`Lanes::max`] in the chosen lanes, `b` elsewhere.
    fn max_where(chosen: Self::M8, a: Self::F8, b: Self::F8) -> Self::F8;

    /// `b` in the chosen lanes, [`Lanes::min`] elsewhere.
    fn min_unless(chosen: Self::M8, a: Self::F8, b: Self::F8) -> Self::F8;

    /// In each lane the number of `table` whose place is in the word's three bits from bit `RIGHT` on.
    fn picked<const RIGHT: i32>(table: Self::F8, words: Self::U8) -> Self::F8;

    /// Writes the words whose bit is set, in order; any of the words or 0 may follow.
    fn compress(words: &[u32; 8], chosen: u32, to: &mut [u32; 8]);

    /// Bits of the words that are at most `most`.
    fn at_most(words: &[u32; 8], most: u32) -> u32;

    /// Orders the lanes whose bit is set by their numbers, which are finite and not negative, the greatest first: writes a key of each, and its word. The lowest three
    /// bits of a number do not count; equal ones go by lane. See [`key_floor`](super::key_floor). Anything may follow.
    fn descending(numbers: Self::F8, chosen: u32, words: &[u32; 8], keys: &mut [u32; 8], sorted: &mut [u32; 8]);

    /// Runs `task` in a function of its own, compiled for this level once for all callers: for work that is worth a
    /// call but not a copy at every call site.
    fn call<T: Task>(task: T) -> T::Output;
}

/// A vector of numbers. Bit i of a mask belongs to lane i.
pub trait Lanes:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// `f32` or `f64`.
    type Elem: Copy + PartialOrd;
    /// Number of lanes.
    const LEN: usize;
    /// The mask of all lanes.
    const ALL: u32 = (1 << Self::LEN) - 1;

    /// The same number in every lane.
    fn splat(value: Self::Elem) -> Self;
    /// The first lanes of a slice. Panics when it is too short.
    fn load(from: &[Self::Elem]) -> Self;
    /// Writes all lanes to the front of a slice. Panics when it is too short.
    fn store(self, to: &mut [Self::Elem]);
    /// `self < other ? self : other`: `other` where either is NaN.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// `self > other ? self : other`: `other` where either is NaN.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// Absolute values.
    #[must_use]
    fn abs(self) -> Self;
    /// Square roots, correctly rounded; NaN below zero.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The largest whole numbers not above; NaN and infinities stay.
    #[must_use]
    fn floor(self) -> Self;
    /// Lanes of `a` whose bit is set in `mask`, of `b` elsewhere.
    fn select(mask: u32, a: Self, b: Self) -> Self;
    /// `self * b + c`, rounded once or twice depending on the level: only for values that are used with a bound that
    /// covers both.
    #[must_use]
    fn mul_add_loose(self, b: Self, c: Self) -> Self;
    /// `self * b - c`, as [`Lanes::mul_add_loose`].
    #[must_use]
    fn mul_sub_loose(self, b: Self, c: Self) -> Self;
    /// Lanes where `self < other`; false where either is NaN.
    fn lt(self, other: Self) -> u32;
    /// Lanes where `self <= other`; false where either is NaN.
    fn le(self, other: Self) -> u32;
}

/// Four lanes as two halves.
pub trait Halves: Lanes<Elem = f32> {
    /// Whether halves are to be swapped, ready for use.
    type Swap: Copy + Debug;

    /// Prepares [`Halves::swapped`].
    fn swap(on: bool) -> Self::Swap;
    /// `[2, 3, 0, 1]` when `swap` is on, unchanged else.
    #[must_use]
    fn swapped(self, swap: Self::Swap) -> Self;
    /// `[2, 3, 2, 3]`.
    #[must_use]
    fn high_half(self) -> Self;
    /// `[1, 2, 0, 3]`.
    #[must_use]
    fn rotated(self) -> Self;
    /// Lane 0.
    fn first(self) -> f32;
    /// Lane 1.
    fn second(self) -> f32;
}
