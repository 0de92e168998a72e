//! AVX2 with FMA.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;

use super::{
    columns::{ROTATED, eight_columns, four_columns, two_vertices},
    vectors::{F32x4, F32x8, F64x4, UPPER, least_of, quarters, widen},
    words::{COMPRESS, keys, load_words, of_bytes, sort, sort_four, store_words},
};
use crate::simd::{Lanes, Simd, SimdLevel, Task, dispatch::call_avx2};

/// AVX2 with FMA.
#[derive(Clone, Copy, Debug)]
pub(in crate::simd) struct Avx2;

impl Simd for Avx2 {
    const LEVEL: SimdLevel = SimdLevel::Avx2;
    type F4 = F32x4;
    type F8 = F32x8;
    type U8 = __m256i;
    type M8 = __m256;
    type D4 = F64x4;
    type F = F32x8;
    type D = F64x4;

    #[inline(always)]
    fn widen(narrow: F32x4) -> F64x4 {
        widen(narrow)
    }

    #[inline(always)]
    fn load_wide(from: &[f32]) -> F64x4 {
        widen(F32x4::load(from))
    }

    #[inline(always)]
    fn columns(records: &[[f32; 8]], to: &mut [[f32; 16]; 8]) {
        let records: &[[f32; 8]; 8] = records[..8].try_into().expect("the slice has that length");
        for half in 0..2 {
            let [a, b, c, d] = four_columns(records, half);
            a.store(&mut to[4 * half]);
            b.store(&mut to[4 * half + 1]);
            c.store(&mut to[4 * half + 2]);
            d.store(&mut to[4 * half + 3]);
        }
    }

    #[inline(always)]
    fn eight_columns(records: &[[f32; 8]; 8], to: &mut [[f32; 8]; 8]) {
        eight_columns(records, to);
    }

    #[inline(always)]
    fn corners(from: &[[f32; 3]], records: &[[u32; 4]], count: usize) -> Option<[[F32x8; 3]; 2]> {
        let (a, b) = (&records[0], &records[1.min(count - 1)]);
        let (c, d) = (&records[2.min(count - 1)], &records[count - 1]);
        let first = [two_vertices(from, a[0], b[0])?, two_vertices(from, a[1], b[1])?, two_vertices(from, a[2], b[2])?];
        let second =
            [two_vertices(from, c[0], d[0])?, two_vertices(from, c[1], d[1])?, two_vertices(from, c[2], d[2])?];
        Some([first, second])
    }

    #[inline(always)]
    fn rotated(numbers: F32x8) -> F32x8 {
        F32x8(call!(_mm256_permute_ps::<ROTATED>(numbers.0)))
    }

    #[inline(always)]
    fn least_four(numbers: F32x8) -> F32x4 {
        let (low, high) = quarters(numbers);
        low.min(high)
    }

    #[inline(always)]
    fn greatest_four(numbers: F32x8) -> F32x4 {
        let (low, high) = quarters(numbers);
        low.max(high)
    }

    #[inline(always)]
    fn of_bytes(bytes: &[u8; 8]) -> F32x8 {
        of_bytes(bytes)
    }

    #[inline(always)]
    fn to_bytes(numbers: F32x8) -> [u8; 8] {
        let words = call!(_mm256_cvttps_epi32(numbers.0));
        let (low, high) = (call!(_mm256_castsi256_si128(words)), call!(_mm256_extracti128_si256::<UPPER>(words)));
        let halves = call!(_mm_packus_epi32(low, high));
        call!(_mm_cvtsi128_si64(call!(_mm_packus_epi16(halves, halves)))).to_le_bytes()
    }

    #[inline(always)]
    fn range(numbers: F32x8, chosen: u32) -> [f32; 2] {
        let least = F32x8::select(chosen, numbers, F32x8::splat(f32::INFINITY));
        let greatest = F32x8::select(chosen, numbers, F32x8::splat(f32::NEG_INFINITY));
        [least_of(least), -least_of(-greatest)]
    }

    #[inline(always)]
    fn agreed(low: F64x4, high: F64x4, to: &mut [f32]) -> u32 {
        let (low, high) = (call!(_mm256_cvtpd_ps(low.0)), call!(_mm256_cvtpd_ps(high.0)));
        F32x4(call!(_mm_add_ps(low, call!(_mm_setzero_ps())))).store(to);
        call!(_mm_movemask_ps(call!(_mm_cmpeq_ps(low, high)))).cast_unsigned()
    }

    #[inline(always)]
    fn write_where(chosen: u32, word: u32, to: &mut [u32; 16]) {
        let to = to.first_chunk_mut().expect("eight of sixteen");
        let all = F32x8(call!(_mm256_castsi256_ps(call!(_mm256_set1_epi32(word.cast_signed())))));
        let old = F32x8(call!(_mm256_castsi256_ps(load_words(to))));
        store_words(call!(_mm256_castps_si256(F32x8::select(chosen, all, old).0)), to);
    }

    #[inline(always)]
    fn words(from: &[u32; 8]) -> __m256i {
        load_words(from)
    }

    #[inline(always)]
    fn flipped(words: __m256i, flips: u32) -> __m256i {
        call!(_mm256_xor_si256(words, call!(_mm256_set1_epi32(flips.cast_signed()))))
    }

    #[inline(always)]
    fn with_bit<const LEFT: i32>(words: __m256i) -> __m256 {
        call!(_mm256_castsi256_ps(call!(_mm256_slli_epi32::<LEFT>(words))))
    }

    #[inline(always)]
    fn max_where(chosen: __m256, a: F32x8, b: F32x8) -> F32x8 {
        F32x8(call!(_mm256_blendv_ps(b.0, a.max(b).0, chosen)))
    }

    #[inline(always)]
    fn min_unless(chosen: __m256, a: F32x8, b: F32x8) -> F32x8 {
        F32x8(call!(_mm256_blendv_ps(a.min(b).0, b.0, chosen)))
    }

    #[inline(always)]
    fn picked<const RIGHT: i32>(table: F32x8, words: __m256i) -> F32x8 {
        // Bits above the lowest three do not count.
        F32x8(call!(_mm256_permutevar8x32_ps(table.0, call!(_mm256_srli_epi32::<RIGHT>(words)))))
    }

    #[inline(always)]
    fn compress(words: &[u32; 8], chosen: u32, to: &mut [u32; 8]) {
        let order = load_words(&COMPRESS[(chosen & 0xff) as usize]);
        store_words(call!(_mm256_permutevar8x32_epi32(load_words(words), order)), to);
    }

    #[inline(always)]
    fn at_most(words: &[u32; 8], most: u32) -> u32 {
        let (words, most) = (load_words(words), call!(_mm256_set1_epi32(most.cast_signed())));
        let within = call!(_mm256_cmpeq_epi32(call!(_mm256_max_epu32(words, most)), most));
        call!(_mm256_movemask_ps(call!(_mm256_castsi256_ps(within)))).cast_unsigned()
    }

    #[inline(always)]
    fn descending(numbers: F32x8, chosen: u32, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
        let lanes = call!(_mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128));
        let bits = call!(_mm256_and_si256(call!(_mm256_set1_epi32(chosen.cast_signed())), lanes));
        let keys = call!(_mm256_and_si256(keys(numbers), call!(_mm256_cmpeq_epi32(bits, lanes))));
        if chosen.count_ones() <= 4 {
            let order = load_words(&COMPRESS[(chosen & 0xff) as usize]);
            sort_four(call!(_mm256_permutevar8x32_epi32(keys, order)), words, to_keys, to_words);
        } else {
            sort(keys, words, to_keys, to_words);
        }
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        // SAFETY: the type is private to `simd`, so code names it only below a dispatch that found its features.
        unsafe { call_avx2(task) }
    }
}
