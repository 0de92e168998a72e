//! Texels by gathered loads.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;

use super::{
    Avx2, Avx512,
    vectors::{F32x8, F32x16},
};
use crate::simd::{
    Lanes,
    texels::{Texels, last},
};

/// Bytes of a word.
const WORD: i32 = 4;

macro_rules! texels {
    ($name:ident of $level:ident, $count:ident, $load:ident $set1:ident $min:ident $add:ident $and:ident $shift:ident $convert:ident $words:ident $floats:ident) => {
        impl Texels for $name {
            type Level = $level;

            #[inline(always)]
            fn of_bytes(texels: &[[u8; 4]], table: &[f32; 256], places: &[u32; 16]) -> [Self; 4] {
                const SECOND: $count = 8;
                const THIRD: $count = 16;
                const FOURTH: $count = 24;
                let last = call!($set1(last(texels).cast_signed()));
                // SAFETY: sixteen numbers are there, as many as any of these loads takes; the feature is in the level (head of `x86`).
                let places = call!($min(unsafe { $load(places.as_ptr().cast()) }, last));
                // SAFETY: no place is beyond the last texel, and a word is there at each.
                let words = unsafe { $words(texels.as_ptr().cast(), places) };
                let byte = call!($set1(0xff));
                let (green, blue) = (call!($shift::<SECOND>(words)), call!($shift::<THIRD>(words)));
                // SAFETY: no byte is beyond the table's 256 numbers.
                let [red, green, blue] = unsafe {
                    [
                        $floats(table.as_ptr(), call!($and(words, byte))),
                        $floats(table.as_ptr(), call!($and(green, byte))),
                        $floats(table.as_ptr(), call!($and(blue, byte))),
                    ]
                };
                let alpha = Self(call!($convert(call!($shift::<FOURTH>(words)))));
                [Self(red), Self(green), Self(blue), alpha * Self::splat(1.0 / 255.0)]
            }

            #[inline(always)]
            fn of_words(texels: &[[u16; 4]], places: &[u32; 16]) -> [Self; 4] {
                const UPPER: $count = 16;
                let last = call!($set1(last(texels).cast_signed()));
                // SAFETY: sixteen numbers are there, as many as any of these loads takes; the feature is in the level (head of `x86`).
                let places = call!($min(unsafe { $load(places.as_ptr().cast()) }, last));
                let twice = call!($add(places, places));
                // SAFETY: no place is beyond the last texel, and two words are there at each; twice the places are below 2^31.
                let [low, high] = unsafe {
                    let first: *const i32 = texels.as_ptr().cast();
                    [$words(first, twice), $words(first.add(1), twice)]
                };
                let half = call!($set1(0xffff));
                let share = Self::splat(1.0 / 65535.0);
                [
                    Self(call!($convert(call!($and(low, half))))) * share,
                    Self(call!($convert(call!($shift::<UPPER>(low))))) * share,
                    Self(call!($convert(call!($and(high, half))))) * share,
                    Self(call!($convert(call!($shift::<UPPER>(high))))) * share,
                ]
            }
        }
    };
}

texels!(F32x16 of Avx512, u32, _mm512_loadu_epi32 _mm512_set1_epi32 _mm512_min_epu32 _mm512_add_epi32 _mm512_and_si512 _mm512_srli_epi32
    _mm512_cvtepi32_ps words16 floats16);
texels!(F32x8 of Avx2, i32, _mm256_loadu_si256 _mm256_set1_epi32 _mm256_min_epu32 _mm256_add_epi32 _mm256_and_si256 _mm256_srli_epi32
    _mm256_cvtepi32_ps words8 floats8);

/// The words at places from `first`.
///
/// # Safety
/// There is a word at each place, below 2^31, and AVX-512 is in the level.
#[inline(always)]
unsafe fn words16(first: *const i32, places: __m512i) -> __m512i {
    // SAFETY: by this function's own terms.
    unsafe { _mm512_i32gather_epi32::<WORD>(places, first) }
}

/// The numbers at places from `first`; as [`words16`].
///
/// # Safety
/// As there.
#[inline(always)]
unsafe fn floats16(first: *const f32, places: __m512i) -> __m512 {
    // SAFETY: by this function's own terms.
    unsafe { _mm512_i32gather_ps::<WORD>(places, first) }
}

/// As [`words16`] in AVX2.
///
/// # Safety
/// There is a word at each place, below 2^31, and AVX2 is in the level.
#[inline(always)]
unsafe fn words8(first: *const i32, places: __m256i) -> __m256i {
    // SAFETY: by this function's own terms.
    unsafe { _mm256_i32gather_epi32::<WORD>(first, places) }
}

/// As [`floats16`] in AVX2.
///
/// # Safety
/// As [`words8`].
#[inline(always)]
unsafe fn floats8(first: *const f32, places: __m256i) -> __m256 {
    // SAFETY: by this function's own terms.
    unsafe { _mm256_i32gather_ps::<WORD>(first, places) }
}
