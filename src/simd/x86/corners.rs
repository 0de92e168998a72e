//! Corners of triangles by the numbers of vertices.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;

use super::vectors::{F32x16, UPPER};

/// Words of the records that stand for four, by how many there are less one.
static ORDERS: [[u32; 16]; 4] = [
    [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3],
    [0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7],
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 8, 9, 10, 11],
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
];

/// The words that are vertices.
const VERTICES: __mmask16 = 0x7777;

/// As [`Simd::corners`](crate::simd::Simd::corners): all numbers are compared at once.
#[inline(always)]
pub(super) fn corners(from: &[[f32; 3]], records: &[[u32; 4]], count: usize) -> Option<[F32x16; 3]> {
    let four = match records.first_chunk::<4>() {
        Some(four) => four,
        None => &padded(records),
    };
    // Three times the numbers of vertices are places below, in 32 bits.
    if from.len() > u32::MAX as usize / 3 {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, reason = "checked above")]
    let end = from.len().saturating_sub(1) as u32;
    let order = &ORDERS[(count - 1) & 3];
    // SAFETY: both arrays are as long as the unaligned loads; AVX-512 is in the level (head of `x86`).
    let (words, order) =
        unsafe { (_mm512_loadu_si512(four.as_ptr().cast()), _mm512_loadu_si512(order.as_ptr().cast())) };
    let words = call!(_mm512_permutexvar_epi32(order, words));
    let limit = call!(_mm512_set1_epi32(end.cast_signed()));
    if call!(_mm512_mask_cmpge_epu32_mask(VERTICES, words, limit)) != 0 {
        return None;
    }
    let mut places = [0_u32; 16];
    let thrice = call!(_mm512_add_epi32(words, call!(_mm512_add_epi32(words, words))));
    // SAFETY: the array is as long as the unaligned store; AVX-512 is in the level (head of `x86`).
    unsafe { _mm512_storeu_si512(places.as_mut_ptr().cast(), thrice) };
    let numbers: *const f32 = from.as_ptr().cast();
    let mut out = [F32x16(call!(_mm512_setzero_ps())); 3];
    for (corner, out) in out.iter_mut().enumerate() {
        // SAFETY: these words were found to be numbers of vertices that others follow, so that four numbers are there.
        let [a, b, c, d] = unsafe {
            [
                _mm_loadu_ps(numbers.add(places[corner] as usize)),
                _mm_loadu_ps(numbers.add(places[corner + 4] as usize)),
                _mm_loadu_ps(numbers.add(places[corner + 8] as usize)),
                _mm_loadu_ps(numbers.add(places[corner + 12] as usize)),
            ]
        };
        let low = call!(_mm256_insertf128_ps::<UPPER>(call!(_mm256_castps128_ps256(a)), b));
        let high = call!(_mm256_insertf128_ps::<UPPER>(call!(_mm256_castps128_ps256(c)), d));
        out.0 = call!(_mm512_insertf32x8::<UPPER>(call!(_mm512_castps256_ps512(low)), high));
    }
    Some(out)
}

/// The last records of all, and any words.
#[cold]
fn padded(records: &[[u32; 4]]) -> [[u32; 4]; 4] {
    let mut out = [[0; 4]; 4];
    out[..records.len()].copy_from_slice(records);
    out
}
