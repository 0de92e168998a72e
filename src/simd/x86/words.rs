//! Eight words of 32 bits, and bytes: keys in order, the chosen ones, numbers.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;

use super::vectors::F32x8;
use crate::simd::ordered::{BASE, LANE};

#[inline(always)]
pub(super) fn load_words(from: &[u32; 8]) -> __m256i {
    // SAFETY: the array is as long as the unaligned load; AVX is in the level (head of `x86`).
    unsafe { _mm256_loadu_si256(from.as_ptr().cast()) }
}

#[inline(always)]
pub(super) fn store_words(words: __m256i, to: &mut [u32; 8]) {
    // SAFETY: the array is as long as the unaligned store; AVX is in the level (head of `x86`).
    unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), words) };
}

/// The keys of [`crate::simd::Simd::descending`], all lanes.
#[inline(always)]
pub(super) fn keys(numbers: F32x8) -> __m256i {
    let lane = call!(_mm256_set1_epi32(LANE.cast_signed()));
    let high = call!(_mm256_andnot_si256(lane, call!(_mm256_castps_si256(numbers.0))));
    let base = BASE.cast_signed();
    let low = call!(_mm256_setr_epi32(base, base + 1, base + 2, base + 3, base + 4, base + 5, base + 6, base + 7));
    call!(_mm256_add_epi32(high, low))
}

/// The lanes of each four with those of a pair changed, and in the opposite order.
const PAIRS: i32 = 0b10_11_00_01;
const MIRROR: i32 = 0b00_01_10_11;

/// One step of a sorting network: of each pair of lanes, one here and one in `other`, the lesser goes to those whose bit is set in `LESSER`.
#[inline(always)]
pub(super) fn exchanged<const LESSER: i32>(keys: __m256i, other: __m256i) -> __m256i {
    let (greater, lesser) = (call!(_mm256_max_epu32(keys, other)), call!(_mm256_min_epu32(keys, other)));
    call!(_mm256_blend_epi32::<LESSER>(greater, lesser))
}

/// Writes keys in descending order, and the words of their lanes.
#[inline(always)]
pub(super) fn sort(keys: __m256i, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
    const HALVES: i32 = 0b01_00_11_10;
    let keys = exchanged::<0b1010_1010>(keys, call!(_mm256_shuffle_epi32::<PAIRS>(keys)));
    let keys = exchanged::<0b1100_1100>(keys, call!(_mm256_shuffle_epi32::<MIRROR>(keys)));
    let keys = exchanged::<0b1010_1010>(keys, call!(_mm256_shuffle_epi32::<PAIRS>(keys)));
    let mirror = call!(_mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0));
    let keys = exchanged::<0b1111_0000>(keys, call!(_mm256_permutevar8x32_epi32(keys, mirror)));
    let keys = exchanged::<0b1100_1100>(keys, call!(_mm256_shuffle_epi32::<HALVES>(keys)));
    let keys = exchanged::<0b1010_1010>(keys, call!(_mm256_shuffle_epi32::<PAIRS>(keys)));
    store_words(keys, to_keys);
    store_words(call!(_mm256_permutevar8x32_epi32(load_words(words), keys)), to_words);
}

/// As [`sort`] for keys whose upper four lanes are 0.
#[inline(always)]
pub(super) fn sort_four(keys: __m256i, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
    let keys = call!(_mm256_castsi256_si128(keys));
    let keys = exchanged_four::<0b1010>(keys, call!(_mm_shuffle_epi32::<PAIRS>(keys)));
    let keys = exchanged_four::<0b1100>(keys, call!(_mm_shuffle_epi32::<MIRROR>(keys)));
    let keys = exchanged_four::<0b1010>(keys, call!(_mm_shuffle_epi32::<PAIRS>(keys)));
    store_four(keys, to_keys);
    let words = call!(_mm256_permutevar8x32_epi32(load_words(words), call!(_mm256_castsi128_si256(keys))));
    store_four(call!(_mm256_castsi256_si128(words)), to_words);
}

/// As [`exchanged`], for four lanes.
#[inline(always)]
fn exchanged_four<const LESSER: i32>(keys: __m128i, other: __m128i) -> __m128i {
    let (greater, lesser) = (call!(_mm_max_epu32(keys, other)), call!(_mm_min_epu32(keys, other)));
    call!(_mm_blend_epi32::<LESSER>(greater, lesser))
}

#[inline(always)]
fn store_four(words: __m128i, to: &mut [u32; 8]) {
    // SAFETY: the array is longer than the unaligned store.
    unsafe { _mm_storeu_si128(to.as_mut_ptr().cast(), words) };
}

/// For every choice among eight lanes, the chosen ones in order, then the others.
pub(super) static COMPRESS: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut chosen = 0;
    while chosen < 256 {
        let (mut lane, mut len) = (0_u32, 0);
        while lane < 16 {
            if (chosen >> (lane % 8) & 1 == 1) == (lane < 8) {
                table[chosen][len] = lane % 8;
                len += 1;
            }
            lane += 1;
        }
        chosen += 1;
    }
    table
};

#[inline(always)]
pub(super) fn of_bytes(bytes: &[u8; 8]) -> F32x8 {
    let bytes = call!(_mm_cvtsi64_si128(i64::from_le_bytes(*bytes)));
    F32x8(call!(_mm256_cvtepi32_ps(call!(_mm256_cvtepu8_epi32(bytes)))))
}
