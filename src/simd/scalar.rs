use std::{
    array,
    ops::{Add, Div, Mul, Neg, Sub},
};

use super::{Halves, Lanes, Simd, SimdLevel, Task, ordered::key};

/// Portable code.
#[derive(Clone, Copy, Debug)]
pub struct Scalar;

impl Simd for Scalar {
    const LEVEL: SimdLevel = SimdLevel::Scalar;
    type F4 = Array<f32, 4>;
    type F8 = Array<f32, 8>;
    type U8 = [u32; 8];
    type M8 = u32;
    type D4 = Array<f64, 4>;
    type F = Array<f32, 8>;
    type D = Array<f64, 4>;

    #[inline(always)]
    fn widen(narrow: Self::F4) -> Self::D4 {
        Array(narrow.0.map(f64::from))
    }

    #[inline(always)]
    fn load_wide(from: &[f32]) -> Self::D {
        let from = &from[..4];
        Array(array::from_fn(|i| f64::from(from[i])))
    }

    #[inline(always)]
    fn columns(records: &[[f32; 8]], to: &mut [[f32; 16]; 8]) {
        for (lane, record) in records[..8].iter().enumerate() {
            for (row, &number) in to.iter_mut().zip(record) {
                row[lane] = number;
            }
        }
    }

    #[inline(always)]
    fn eight_columns(records: &[[f32; 8]; 8], to: &mut [[f32; 8]; 8]) {
        for (lane, record) in records.iter().enumerate() {
            for (row, &number) in to.iter_mut().zip(record) {
                row[lane] = number;
            }
        }
    }

    #[inline(always)]
    fn corners(from: &[[f32; 3]], records: &[[u32; 4]], count: usize) -> Option<[[Self::F; 3]; 2]> {
        let mut out = [[Array([0.0; 8]); 3]; 2];
        for i in 0..4 {
            for corner in 0..3 {
                let vertex = records[i.min(count - 1)][corner] as usize;
                let [[x, y, z], [next, ..]] = *from.get(vertex..)?.first_chunk()?;
                out[i / 2][corner].0[4 * (i % 2)..][..4].copy_from_slice(&[x, y, z, next]);
            }
        }
        Some(out)
    }

    #[inline(always)]
    fn rotated(numbers: Self::F) -> Self::F {
        let [a, b, c, d, e, f, g, h] = numbers.0;
        Array([b, c, a, d, f, g, e, h])
    }

    #[inline(always)]
    fn least_four(numbers: Self::F) -> Self::F4 {
        let [a, b, c, d, e, f, g, h] = numbers.0;
        Array([a, b, c, d]).min(Array([e, f, g, h]))
    }

    #[inline(always)]
    fn greatest_four(numbers: Self::F) -> Self::F4 {
        let [a, b, c, d, e, f, g, h] = numbers.0;
        Array([a, b, c, d]).max(Array([e, f, g, h]))
    }

    #[inline(always)]
    fn of_bytes(bytes: &[u8; 8]) -> Self::F8 {
        Array(bytes.map(f32::from))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers of that range")]
    fn to_bytes(numbers: Self::F8) -> [u8; 8] {
        numbers.0.map(|number| number as u8)
    }

    #[inline(always)]
    fn range(numbers: Self::F, chosen: u32) -> [f32; 2] {
        let least = Lanes::select(chosen, numbers, Array([f32::INFINITY; 8]));
        let greatest = Lanes::select(chosen, numbers, Array([f32::NEG_INFINITY; 8]));
        [least.0.into_iter().fold(f32::INFINITY, f32::min), greatest.0.into_iter().fold(f32::NEG_INFINITY, f32::max)]
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::float_cmp, reason = "roundings are compared")]
    fn agreed(low: Self::D, high: Self::D, to: &mut [f32]) -> u32 {
        let mut agreed = 0;
        for (lane, to) in to[..4].iter_mut().enumerate() {
            let (low, high) = (low.0[lane] as f32, high.0[lane] as f32);
            *to = low + 0.0;
            agreed |= u32::from(low == high) << lane;
        }
        agreed
    }

    #[inline(always)]
    fn write_where(chosen: u32, word: u32, to: &mut [u32; 16]) {
        for (lane, to) in to[..8].iter_mut().enumerate() {
            *to = if chosen >> lane & 1 == 1 { word } else { *to };
        }
    }

    #[inline(always)]
    fn words(from: &[u32; 8]) -> [u32; 8] {
        *from
    }

    #[inline(always)]
    fn flipped(words: [u32; 8], flips: u32) -> [u32; 8] {
        words.map(|word| word ^ flips)
    }

    #[inline(always)]
    fn with_bit<const LEFT: i32>(words: [u32; 8]) -> u32 {
        words.iter().rev().fold(0, |mask, word| mask << 1 | word << LEFT >> 31)
    }

    #[inline(always)]
    fn max_where(chosen: u32, a: Self::F8, b: Self::F8) -> Self::F8 {
        Lanes::select(chosen, a.max(b), b)
    }

    #[inline(always)]
    fn min_unless(chosen: u32, a: Self::F8, b: Self::F8) -> Self::F8 {
        Lanes::select(chosen, b, a.min(b))
    }

    #[inline(always)]
    fn picked<const RIGHT: i32>(table: Self::F8, words: [u32; 8]) -> Self::F8 {
        Array(words.map(|word| table.0[(word >> RIGHT & 7) as usize]))
    }

    #[inline(always)]
    fn compress(words: &[u32; 8], chosen: u32, to: &mut [u32; 8]) {
        let mut len = 0;
        for (i, word) in words.iter().enumerate() {
            to[len & 7] = *word;
            len += (chosen >> i & 1) as usize;
        }
    }

    #[inline(always)]
    fn at_most(words: &[u32; 8], most: u32) -> u32 {
        let mut bits = 0;
        for (i, &word) in words.iter().enumerate() {
            bits |= u32::from(word <= most) << i;
        }
        bits
    }

    #[inline(always)]
    fn descending(numbers: Self::F8, chosen: u32, words: &[u32; 8], keys: &mut [u32; 8], sorted: &mut [u32; 8]) {
        let mut len = 0;
        for (lane, (&number, &word)) in (0..).zip(numbers.0.iter().zip(words)) {
            if chosen >> lane & 1 == 1 {
                let key = key(number, lane);
                let mut at = len;
                while at > 0 && keys[at - 1] < key {
                    (keys[at], sorted[at]) = (keys[at - 1], sorted[at - 1]);
                    at -= 1;
                }
                (keys[at], sorted[at]) = (key, word);
                len += 1;
            }
        }
    }

    #[inline(never)]
    fn call<T: Task>(task: T) -> T::Output {
        task.run::<Self>()
    }
}

/// Lanes as a plain array: the reference of every other level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Array<E, const N: usize>([E; N]);

impl<E: Copy, const N: usize> Array<E, N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(E, E) -> E) -> Self {
        Self(array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn mask(self, other: Self, f: impl Fn(E, E) -> bool) -> u32 {
        (0..N).fold(0, |bits, i| bits | (u32::from(f(self.0[i], other.0[i])) << i))
    }
}

macro_rules! array_lanes {
    ($elem:ty) => {
        impl<const N: usize> Add for Array<$elem, N> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                self.zip(other, |a, b| a + b)
            }
        }

        impl<const N: usize> Sub for Array<$elem, N> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                self.zip(other, |a, b| a - b)
            }
        }

        impl<const N: usize> Mul for Array<$elem, N> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                self.zip(other, |a, b| a * b)
            }
        }

        impl<const N: usize> Div for Array<$elem, N> {
            type Output = Self;
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                self.zip(other, |a, b| a / b)
            }
        }

        impl<const N: usize> Neg for Array<$elem, N> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(self.0.map(|a| -a))
            }
        }

        impl<const N: usize> Lanes for Array<$elem, N> {
            type Elem = $elem;
            const LEN: usize = N;

            #[inline(always)]
            fn splat(value: $elem) -> Self {
                Self([value; N])
            }
            #[inline(always)]
            fn load(from: &[$elem]) -> Self {
                let from = &from[..N];
                Self(array::from_fn(|i| from[i]))
            }
            #[inline(always)]
            fn store(self, to: &mut [$elem]) {
                to[..N].copy_from_slice(&self.0);
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.zip(other, |a, b| if a < b { a } else { b })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.zip(other, |a, b| if a > b { a } else { b })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.map(<$elem>::abs))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.0.map(<$elem>::sqrt))
            }
            #[inline(always)]
            fn floor(self) -> Self {
                Self(self.0.map(<$elem>::floor))
            }
            #[inline(always)]
            fn select(mask: u32, a: Self, b: Self) -> Self {
                Self(array::from_fn(|i| if mask >> i & 1 == 1 { a.0[i] } else { b.0[i] }))
            }
            #[inline(always)]
            fn mul_add_loose(self, b: Self, c: Self) -> Self {
                self * b + c
            }
            #[inline(always)]
            fn mul_sub_loose(self, b: Self, c: Self) -> Self {
                self * b - c
            }
            #[inline(always)]
            fn lt(self, other: Self) -> u32 {
                self.mask(other, |a, b| a < b)
            }
            #[inline(always)]
            fn le(self, other: Self) -> u32 {
                self.mask(other, |a, b| a <= b)
            }
        }
    };
}

array_lanes!(f32);
array_lanes!(f64);

impl Halves for Array<f32, 4> {
    type Swap = bool;

    #[inline(always)]
    fn swap(on: bool) -> bool {
        on
    }
    #[inline(always)]
    fn swapped(self, swap: bool) -> Self {
        let [a, b, c, d] = self.0;
        if swap { Self([c, d, a, b]) } else { self }
    }
    #[inline(always)]
    fn high_half(self) -> Self {
        let [_, _, c, d] = self.0;
        Self([c, d, c, d])
    }
    #[inline(always)]
    fn rotated(self) -> Self {
        let [a, b, c, d] = self.0;
        Self([b, c, a, d])
    }
    #[inline(always)]
    fn first(self) -> f32 {
        self.0[0]
    }
    #[inline(always)]
    fn second(self) -> f32 {
        self.0[1]
    }
}
