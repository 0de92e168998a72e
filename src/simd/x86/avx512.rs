//! AVX-512 beside AVX2.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;

use super::{
    columns::{HIGHS, LOWS, ROTATED, eight_columns, near_pair, write_columns},
    corners::corners,
    vectors::{F32x4, F32x8, F32x16, F64x4, F64x8, halves, least_of, quarters, widen},
    words::{keys, load_words, of_bytes, sort, sort_four, store_words},
};
use crate::simd::{Lanes, Simd, SimdLevel, Task, dispatch::call_avx512};

/// AVX-512 besides.
#[derive(Clone, Copy, Debug)]
pub(in crate::simd) struct Avx512;

impl Simd for Avx512 {
    const LEVEL: SimdLevel = SimdLevel::Avx512;
    type F4 = F32x4;
    type F8 = F32x8;
    type U8 = __m256i;
    type M8 = __mmask8;
    type D4 = F64x4;
    type F = F32x16;
    type D = F64x8;

    #[inline(always)]
    fn widen(narrow: F32x4) -> F64x4 {
        widen(narrow)
    }

    #[inline(always)]
    fn load_wide(from: &[f32]) -> F64x8 {
        F64x8(call!(_mm512_cvtps_pd(F32x8::load(from).0)))
    }

    #[inline(always)]
    fn columns(records: &[[f32; 8]], to: &mut [[f32; 16]; 8]) {
        let records: &[[f32; 8]; 16] = records[..16].try_into().expect("the slice has that length");
        // All of two records four apart in each vector.
        let (a, b) = (near_pair(records, 0), near_pair(records, 1));
        let (c, d) = (near_pair(records, 2), near_pair(records, 3));
        let (e, f) = (near_pair(records, 8), near_pair(records, 9));
        let (g, h) = (near_pair(records, 10), near_pair(records, 11));
        let (ab, cd) = (call!(_mm512_unpacklo_ps(a, b)), call!(_mm512_unpacklo_ps(c, d)));
        let (ef, gh) = (call!(_mm512_unpacklo_ps(e, f)), call!(_mm512_unpacklo_ps(g, h)));
        let low = (call!(_mm512_shuffle_ps::<LOWS>(ab, cd)), call!(_mm512_shuffle_ps::<LOWS>(ef, gh)));
        write_columns(low, to, 0);
        let low = (call!(_mm512_shuffle_ps::<HIGHS>(ab, cd)), call!(_mm512_shuffle_ps::<HIGHS>(ef, gh)));
        write_columns(low, to, 1);
        let (ab, cd) = (call!(_mm512_unpackhi_ps(a, b)), call!(_mm512_unpackhi_ps(c, d)));
        let (ef, gh) = (call!(_mm512_unpackhi_ps(e, f)), call!(_mm512_unpackhi_ps(g, h)));
        let high = (call!(_mm512_shuffle_ps::<LOWS>(ab, cd)), call!(_mm512_shuffle_ps::<LOWS>(ef, gh)));
        write_columns(high, to, 2);
        let high = (call!(_mm512_shuffle_ps::<HIGHS>(ab, cd)), call!(_mm512_shuffle_ps::<HIGHS>(ef, gh)));
        write_columns(high, to, 3);
    }

    #[inline(always)]
    fn eight_columns(records: &[[f32; 8]; 8], to: &mut [[f32; 8]; 8]) {
        eight_columns(records, to);
    }

    #[inline(always)]
    fn corners(from: &[[f32; 3]], records: &[[u32; 4]], count: usize) -> Option<[[F32x16; 3]; 2]> {
        let corners = corners(from, records, count)?;
        Some([corners, corners])
    }

    #[inline(always)]
    fn rotated(numbers: F32x16) -> F32x16 {
        F32x16(call!(_mm512_permute_ps::<ROTATED>(numbers.0)))
    }

    #[inline(always)]
    fn least_four(numbers: F32x16) -> F32x4 {
        let (low, high) = halves(numbers);
        let (low, high) = quarters(low.min(high));
        low.min(high)
    }

    #[inline(always)]
    fn greatest_four(numbers: F32x16) -> F32x4 {
        let (low, high) = halves(numbers);
        let (low, high) = quarters(low.max(high));
        low.max(high)
    }

    #[inline(always)]
    fn of_bytes(bytes: &[u8; 8]) -> F32x8 {
        of_bytes(bytes)
    }

    #[inline(always)]
    fn to_bytes(numbers: F32x8) -> [u8; 8] {
        let words = call!(_mm256_cvttps_epi32(numbers.0));
        call!(_mm_cvtsi128_si64(call!(_mm256_cvtepi32_epi8(words)))).to_le_bytes()
    }

    #[inline(always)]
    fn range(numbers: F32x16, chosen: u32) -> [f32; 2] {
        let least = F32x16::select(chosen, numbers, F32x16::splat(f32::INFINITY));
        let greatest = F32x16::select(chosen, numbers, F32x16::splat(f32::NEG_INFINITY));
        let (low, high) = (halves(least), halves(-greatest));
        [least_of(low.0.min(low.1)), -least_of(high.0.min(high.1))]
    }

    #[inline(always)]
    fn agreed(low: F64x8, high: F64x8, to: &mut [f32]) -> u32 {
        let (low, high) = (call!(_mm512_cvtpd_ps(low.0)), call!(_mm512_cvtpd_ps(high.0)));
        F32x8(call!(_mm256_add_ps(low, call!(_mm256_setzero_ps())))).store(to);
        call!(_mm256_movemask_ps(call!(_mm256_cmp_ps::<_CMP_EQ_OQ>(low, high)))).cast_unsigned()
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a bit a lane")]
    fn write_where(chosen: u32, word: u32, to: &mut [u32; 16]) {
        let all = call!(_mm512_set1_epi32(word.cast_signed()));
        // SAFETY: the array is as long as the unaligned store; AVX-512 is in the level (head of `x86`).
        unsafe { _mm512_mask_storeu_epi32(to.as_mut_ptr().cast(), chosen as u16, all) };
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
    fn with_bit<const LEFT: i32>(words: __m256i) -> __mmask8 {
        call!(_mm256_test_epi32_mask(
            words,
            call!(_mm256_set1_epi32(i32::MIN.cast_unsigned().wrapping_shr(LEFT.cast_unsigned()).cast_signed()))
        ))
    }

    #[inline(always)]
    fn max_where(chosen: __mmask8, a: F32x8, b: F32x8) -> F32x8 {
        F32x8(call!(_mm256_mask_max_ps(b.0, chosen, a.0, b.0)))
    }

    #[inline(always)]
    fn min_unless(chosen: __mmask8, a: F32x8, b: F32x8) -> F32x8 {
        F32x8(call!(_mm256_mask_min_ps(b.0, !chosen, a.0, b.0)))
    }

    #[inline(always)]
    fn picked<const RIGHT: i32>(table: F32x8, words: __m256i) -> F32x8 {
        // Bits above the lowest three do not count.
        F32x8(call!(_mm256_permutevar8x32_ps(table.0, call!(_mm256_srli_epi32::<RIGHT>(words)))))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a bit a lane")]
    fn compress(words: &[u32; 8], chosen: u32, to: &mut [u32; 8]) {
        store_words(call!(_mm256_maskz_compress_epi32(chosen as u8, load_words(words))), to);
    }

    #[inline(always)]
    fn at_most(words: &[u32; 8], most: u32) -> u32 {
        let most = call!(_mm256_set1_epi32(most.cast_signed()));
        u32::from(call!(_mm256_cmple_epu32_mask(load_words(words), most)))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a bit a lane")]
    fn descending(numbers: F32x8, chosen: u32, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
        if chosen.count_ones() <= 4 {
            let keys = call!(_mm256_maskz_compress_epi32(chosen as u8, keys(numbers)));
            sort_four(keys, words, to_keys, to_words);
        } else {
            sort(call!(_mm256_maskz_mov_epi32(chosen as u8, keys(numbers))), words, to_keys, to_words);
        }
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        // SAFETY: the type is private to `simd`, so code names it only below a dispatch that found its features.
        unsafe { call_avx512(task) }
    }
}
