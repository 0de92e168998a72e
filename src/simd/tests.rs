//! Every level against the portable one, bit for bit.

use proptest::prelude::*;

use super::{Halves, Lanes, Simd, SimdLevel, Stack, Task, Texels, dispatch, key_floor};

/// Bits of every operation's result on three rows of numbers; NaN of any kind is one value.
struct Operations<'a> {
    a: &'a [f32],
    b: &'a [f32],
    wide: (&'a [f64], &'a [f64]),
}

fn bits32(values: &[f32]) -> impl Iterator<Item = u64> + '_ {
    values.iter().map(|v| if v.is_nan() { u64::MAX } else { u64::from(v.to_bits()) })
}

fn bits64(values: &[f64]) -> impl Iterator<Item = u64> + '_ {
    values.iter().map(|v| if v.is_nan() { u64::MAX } else { v.to_bits() })
}

/// A byte of each of eight numbers.
fn words_of(numbers: &[f32]) -> [u8; 8] {
    std::array::from_fn(|i| numbers[i].to_bits().to_le_bytes()[i % 4])
}

fn stored<V: Lanes<Elem = f32>>(lanes: V) -> [f32; 16] {
    let mut row = [0.0; 16];
    lanes.store(&mut row);
    row
}

/// All operations on vectors of one type, over rows of 16 numbers; `zero` is any number.
#[inline(always)]
fn each<V: Lanes>(a: &[V::Elem], b: &[V::Elem], zero: V::Elem) -> (Vec<V::Elem>, u32, u32) {
    let operations: [fn(V, V) -> V; 11] = [
        |a, b| a + b,
        |a, b| a - b,
        |a, b| a * b,
        |a, b| a / b,
        V::min,
        V::max,
        |a, _| -a,
        |a, _| a.abs(),
        |a, _| a.sqrt(),
        |a, _| a.floor(),
        |a, b| V::select(a.lt(b), b - a, a),
    ];
    let mut rows = Vec::new();
    let (mut below, mut at_most) = (0, 0);
    for operation in operations {
        for first in (0..16).step_by(V::LEN) {
            let mut out = [zero; 16];
            operation(V::load(&a[first..]), V::load(&b[first..])).store(&mut out);
            rows.extend(&out[..V::LEN]);
        }
    }
    for first in (0..16).step_by(V::LEN) {
        below |= V::load(&a[first..]).lt(V::load(&b[first..])) << first;
        at_most |= V::load(&a[first..]).le(V::load(&b[first..])) << first;
    }
    (rows, below, at_most)
}

impl Operations<'_> {
    /// Texels, against what they are said to be.
    #[inline(always)]
    fn check_texels<S: Simd>(&self) {
        let bytes: Vec<[u8; 4]> = self.a.iter().chain(self.b).map(|v| v.to_bits().to_le_bytes()).collect();
        let words: Vec<[u16; 4]> =
            bytes.iter().map(|b| b.map(|byte| u16::from(byte).wrapping_mul(257) ^ u16::from(b[0]))).collect();
        let table: [f32; 256] = std::array::from_fn(|i| (i * i) as f32);
        for len in [1, 7, bytes.len()] {
            let places: [u32; 16] =
                std::array::from_fn(|i| if i % 5 == 4 { u32::MAX >> i } else { self.b[i].to_bits() % 40 });
            let fine = S::F::of_bytes(&bytes[..len], &table, &places).map(stored);
            let coarse = S::F::of_words(&words[..len], &places).map(stored);
            for lane in 0..S::F::LEN {
                let place = (places[lane] as usize).min(len - 1);
                let [r, g, b, a] = bytes[place];
                let due = [table[r as usize], table[g as usize], table[b as usize], f32::from(a) * (1.0 / 255.0)];
                assert!(bits32(&fine.map(|row| row[lane])).eq(bits32(&due)));
                let due = words[place].map(|word| f32::from(word) * (1.0 / 65535.0));
                assert!(bits32(&coarse.map(|row| row[lane])).eq(bits32(&due)));
            }
        }
    }

    /// What takes triangles apart, against what it is said to give.
    #[inline(always)]
    fn check_triangles<S: Simd>(&self) {
        let vertices: &[[f32; 3]] = self.a.as_chunks().0;
        let finite: [f32; 16] = std::array::from_fn(|i| if self.a[i].is_nan() { 1.0 } else { self.a[i] + 0.0 });
        let records = [[0, 3, 1, 9], [2, 2, 0, 9], [3, 1, 1, 9], [1, 0, 3, 9], [0, 0, 0, 9]];
        for count in 1..5 {
            // The last records of all, or not.
            let records = if self.a[0] < self.b[0] { &records[..] } else { &records[..count] };
            let corners = S::corners(vertices, records, count).expect("none is the last");
            for i in 0..4 {
                let (part, first) = (4 * i / S::F::LEN, 4 * i % S::F::LEN);
                for corner in 0..3 {
                    let (mut row, mut rotated) = ([0.0; 16], [0.0; 16]);
                    corners[part][corner].store(&mut row);
                    S::rotated(corners[part][corner]).store(&mut rotated);
                    let at = 3 * records[i.min(count - 1)][corner] as usize;
                    assert!(bits32(&row[first..][..4]).eq(bits32(&self.a[at..][..4])));
                    let [x, y, z] = vertices[at / 3];
                    assert!(bits32(&rotated[first..][..3]).eq(bits32(&[y, z, x])));
                }
            }
        }
        for last in [4, 5, u32::MAX, u32::MAX / 3 + 1] {
            assert!(S::corners(vertices, &[[0, 1, last, 0]], 1).is_none());
        }
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        S::least_four(S::F::load(&finite)).store(&mut low);
        S::greatest_four(S::F::load(&finite)).store(&mut high);
        for (lane, (low, high)) in low.into_iter().zip(high).enumerate() {
            let column = finite[..S::F::LEN].iter().skip(lane).step_by(4);
            assert!(column.clone().all(|&x| low <= x && x <= high));
            assert!(column.clone().any(|&x| x <= low) && column.clone().any(|&x| x >= high));
        }
    }
}

impl Task for Operations<'_> {
    type Output = Vec<u64>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<u64> {
        let mut out = Vec::new();
        let mut add = |values: Vec<u64>, below: u32, at_most: u32| {
            out.extend(values);
            out.extend([u64::from(below), u64::from(at_most)]);
        };
        let (rows, below, at_most) = each::<S::F>(self.a, self.b, 0.0);
        add(bits32(&rows).collect(), below, at_most);
        let (rows, below, at_most) = each::<S::F4>(self.a, self.b, 0.0);
        add(bits32(&rows).collect(), below, at_most);
        let (rows, below, at_most) = each::<S::F8>(self.a, self.b, 0.0);
        add(bits32(&rows).collect(), below, at_most);
        let (rows, below, at_most) = each::<S::D>(self.wide.0, self.wide.1, 0.0);
        add(bits64(&rows).collect(), below, at_most);
        let (rows, below, at_most) = each::<S::D4>(self.wide.0, self.wide.1, 0.0);
        add(bits64(&rows).collect(), below, at_most);
        let four = S::F4::load(self.a);
        for swap in [false, true] {
            let mut row = [0.0; 4];
            four.swapped(S::F4::swap(swap)).store(&mut row);
            out.extend(bits32(&row));
        }
        let mut row = [0.0; 4];
        four.high_half().store(&mut row);
        out.extend(bits32(&row));
        out.extend(bits32(&[four.first(), four.second()]));
        let mut wide = [0.0; 4];
        S::widen(four).store(&mut wide);
        out.extend(bits64(&wide));
        let words: [u32; 8] = std::array::from_fn(|i| self.b[i].to_bits());
        let words = S::flipped(S::words(&words), 0x0820_0000);
        let (a, b) = (S::F8::load(self.a), S::F8::load(&self.a[8..]));
        let (chosen, other) = (S::with_bit::<0>(words), S::with_bit::<4>(words));
        let rows = [
            S::max_where(chosen, a, b),
            S::min_unless(other, a, b),
            S::picked::<25>(a, words),
            S::picked::<29>(b, words),
        ];
        for lanes in rows {
            let mut row = [0.0; 8];
            lanes.store(&mut row);
            out.extend(bits32(&row));
        }
        let mut wide = [0.0; 16];
        for first in (0..16).step_by(S::D::LEN) {
            S::load_wide(&self.a[first..]).store(&mut wide[first..]);
        }
        out.extend(bits64(&wide));
        let records: Vec<[f32; 8]> = (0..16).map(|i| std::array::from_fn(|j| self.a[(3 * i + j) % 16])).collect();
        for first in (0..16).step_by(S::F::LEN) {
            let mut rows = [[0.0; 16]; 8];
            S::columns(&records[first..], &mut rows);
            for (j, row) in rows.iter().enumerate() {
                let expected: Vec<f32> = records[first..][..S::F::LEN].iter().map(|record| record[j]).collect();
                assert!(bits32(&row[..S::F::LEN]).eq(bits32(&expected)));
            }
        }
        let (records, mut rows) = (records.first_chunk().expect("sixteen"), [[0.0; 8]; 8]);
        S::eight_columns(records, &mut rows);
        for (j, row) in rows.iter().enumerate() {
            assert!(bits32(row).eq(bits32(&records.map(|record| record[j]))));
        }
        let bytes = words_of(self.b);
        assert_eq!(S::to_bytes(S::of_bytes(&bytes)), bytes);
        let mut row = [0.0; 8];
        S::of_bytes(&bytes).store(&mut row);
        out.extend(bits32(&row));
        let mut row = [0.0; 4];
        four.rotated().store(&mut row);
        out.extend(bits32(&row));
        self.check_triangles::<S>();
        self.check_texels::<S>();
        let mut ends = [f32::INFINITY, f32::NEG_INFINITY];
        for first in (0..16).step_by(S::F::LEN) {
            let numbers: Vec<f32> = self.b.iter().map(|b| if b.is_nan() { 0.0 } else { *b }).collect();
            let [least, greatest] = S::range(S::F::load(&numbers[first..]), 0b0101_1010_0111_0010 >> first);
            ends = [if least < ends[0] { least } else { ends[0] }, if greatest > ends[1] { greatest } else { ends[1] }];
        }
        // The sign of a zero among equals is left open.
        out.extend(bits32(&ends.map(|end| end + 0.0)));
        let (mut row, mut agreed) = ([0.0; 16], 0);
        for first in (0..16).step_by(S::D::LEN) {
            let (a, b) = (S::D::load(&self.wide.0[first..]), S::D::load(&self.wide.1[first..]));
            agreed |= S::agreed(a, b, &mut row[first..]) << first;
        }
        out.extend(bits32(&row));
        out.push(u64::from(agreed));
        for first in (0..16).step_by(S::F::LEN) {
            let mut places = [7; 16];
            S::write_where(0b1001_0110_1110_0101 >> first, 0xf000_0001, &mut places);
            out.extend(places[..S::F::LEN].iter().map(|&word| u64::from(word)));
        }
        out
    }
}

/// The fused forms may round once or twice: both are within the last place of the exact value's terms.
struct Fused([f64; 3]);

impl Task for Fused {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<S: Simd>(self) -> [f64; 2] {
        let [a, b, c] = self.0.map(S::D4::splat);
        let (mut add, mut sub) = ([0.0; 4], [0.0; 4]);
        a.mul_add_loose(b, c).store(&mut add);
        a.mul_sub_loose(b, c).store(&mut sub);
        [add[0], sub[3]]
    }
}

fn numbers() -> impl Strategy<Value = Vec<f32>> {
    let special = prop::sample::select(vec![0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-45, f32::MAX]);
    prop::collection::vec(prop_oneof![3 => any::<f32>(), 1 => special, 2 => -2.0_f32..2.0], 16)
}

proptest! {
    #[test]
    fn every_level_equals_the_portable_one(a in numbers(), b in numbers()) {
        let wide = |row: &[f32]| row.iter().map(|&v| f64::from(v) * 1.000_000_1).collect::<Vec<_>>();
        let (wide_a, wide_b) = (wide(&a), wide(&b));
        let operations = || Operations { a: &a, b: &b, wide: (&wide_a, &wide_b) };
        let due = dispatch(SimdLevel::Scalar, operations());
        for level in SimdLevel::available() {
            // Lanes differ in number, so rows are compared as a whole.
            prop_assert_eq!(&dispatch(level, operations()), &due, "{}", level);
        }
    }

    #[test]
    fn fused_forms_stay_within_two_roundings(a in -1e3_f64..1e3, b in -1e3_f64..1e3, c in -1e3_f64..1e3) {
        for level in SimdLevel::available() {
            let [add, sub] = dispatch(level, Fused([a, b, c]));
            let slack = f64::EPSILON * ((a * b).abs() + (a * b + c).abs() + (a * b - c).abs());
            prop_assert!((add - (a * b + c)).abs() <= slack, "{}", level);
            prop_assert!((sub - (a * b - c)).abs() <= slack, "{}", level);
        }
    }
}

#[test]
fn levels_are_ordered_and_the_least_is_always_there() {
    assert!(SimdLevel::Scalar.is_available());
    assert!(SimdLevel::best().is_available());
    assert_eq!(SimdLevel::available().last(), Some(SimdLevel::best()));
    for level in SimdLevel::ALL {
        assert_eq!(level.name().parse(), Ok(level));
    }
}

/// The chosen words in order, then the keys and words of the chosen lanes by descending number.
struct Selection {
    numbers: [f32; 8],
    words: [u32; 8],
    chosen: u32,
}

impl Task for Selection {
    type Output = [Vec<u32>; 3];

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let count = self.chosen.count_ones() as usize;
        let (mut compressed, mut keys, mut sorted) = ([0; 8], [0; 8], [0; 8]);
        S::compress(&self.words, self.chosen, &mut compressed);
        S::descending(S::F8::load(&self.numbers), self.chosen, &self.words, &mut keys, &mut sorted);
        [compressed, keys, sorted].map(|words| words[..count].to_vec())
    }
}

struct AtMost {
    words: [u32; 8],
    most: u32,
}

impl Task for AtMost {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self) -> u32 {
        S::at_most(&self.words, self.most)
    }
}

proptest! {
    #[test]
    fn chosen_lanes_are_kept_in_order_and_sorted_by_their_numbers(
        numbers in prop::array::uniform8(prop_oneof![Just(0.0_f32), 0.0_f32..4.0, 0.0_f32..=f32::MAX]),
        words in prop::array::uniform8(any::<u32>()),
        chosen in 0_u32..256,
    ) {
        let lanes: Vec<usize> = (0..8).filter(|&lane| chosen >> lane & 1 == 1).collect();
        for level in SimdLevel::available() {
            let [compressed, keys, sorted] = dispatch(level, Selection { numbers, words, chosen });
            prop_assert_eq!(compressed, lanes.iter().map(|&lane| words[lane]).collect::<Vec<_>>(), "{}", level);
            let mut due = lanes.clone();
            due.sort_by_key(|&lane| std::cmp::Reverse((numbers[lane].to_bits() >> 3, lane)));
            prop_assert_eq!(sorted, due.iter().map(|&lane| words[lane]).collect::<Vec<_>>(), "{}", level);
            for (&key, &lane) in keys.iter().zip(&due) {
                let floor = key_floor(key);
                prop_assert!(key > 0 && floor <= numbers[lane] && numbers[lane].to_bits() - floor.to_bits() < 8);
            }
        }
    }

    #[test]
    fn words_up_to_another_are_found(words in prop::array::uniform8(any::<u32>()), most in any::<u32>(), at in 0..16_usize) {
        let most = *words.get(at).unwrap_or(&most);
        let due = (0..8).filter(|&i| words[i] <= most).map(|i| 1 << i).sum::<u32>();
        for level in SimdLevel::available() {
            prop_assert_eq!(dispatch(level, AtMost { words, most }), due, "{}", level);
        }
    }

    #[test]
    fn stacks_give_back_what_was_pushed_last(steps in prop::collection::vec(prop::option::of(any::<u64>()), 0..64)) {
        let (mut stack, mut model) = (Stack::<u64, 64>::new(), Vec::new());
        for step in steps {
            if let Some(value) = step {
                stack.push(value);
                model.push(value);
            } else {
                prop_assert_eq!(stack.pop(), model.pop());
            }
        }
    }
}

#[test]
#[should_panic(expected = "index out of bounds")]
fn full_stacks_refuse_more() {
    let mut stack = Stack::<u8, 2>::new();
    for value in 0..3 {
        stack.push(value);
    }
}
