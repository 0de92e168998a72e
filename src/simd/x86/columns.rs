//! Records of eight numbers turned into columns.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;

use super::vectors::{F32x4, F32x8, F32x16, UPPER};
use crate::simd::Lanes;

/// The first two of each four numbers' first pairs of unpacked rows, and the last two.
pub(super) const LOWS: i32 = 0b01_00_01_00;
pub(super) const HIGHS: i32 = 0b11_10_11_10;
/// The even quarters of two vectors, and the odd ones.
pub(super) const EVEN: i32 = 0b10_00_10_00;
pub(super) const ODD: i32 = 0b11_01_11_01;

/// Four numbers from `at` on of record i below those of record i + 4.
#[inline(always)]
pub(super) fn far_pair(records: &[[f32; 8]; 8], i: usize, at: usize) -> __m256 {
    let (low, high) = (F32x4::load(&records[i][at..]), F32x4::load(&records[i + 4][at..]));
    call!(_mm256_insertf128_ps::<UPPER>(call!(_mm256_castps128_ps256(low.0)), high.0))
}

/// Rows `4 * half` to `4 * half + 3` of the columns of eight records.
#[inline(always)]
pub(super) fn four_columns(records: &[[f32; 8]; 8], half: usize) -> [F32x8; 4] {
    // Four numbers of records 0 to 3 below those of records 4 to 7.
    let (a, b) = (far_pair(records, 0, 4 * half), far_pair(records, 1, 4 * half));
    let (c, d) = (far_pair(records, 2, 4 * half), far_pair(records, 3, 4 * half));
    let (ab, cd) = (call!(_mm256_unpacklo_ps(a, b)), call!(_mm256_unpacklo_ps(c, d)));
    let (ef, gh) = (call!(_mm256_unpackhi_ps(a, b)), call!(_mm256_unpackhi_ps(c, d)));
    [
        F32x8(call!(_mm256_shuffle_ps::<LOWS>(ab, cd))),
        F32x8(call!(_mm256_shuffle_ps::<HIGHS>(ab, cd))),
        F32x8(call!(_mm256_shuffle_ps::<LOWS>(ef, gh))),
        F32x8(call!(_mm256_shuffle_ps::<HIGHS>(ef, gh))),
    ]
}

#[inline(always)]
pub(super) fn eight_columns(records: &[[f32; 8]; 8], to: &mut [[f32; 8]; 8]) {
    for half in 0..2 {
        let [a, b, c, d] = four_columns(records, half);
        a.store(&mut to[4 * half]);
        b.store(&mut to[4 * half + 1]);
        c.store(&mut to[4 * half + 2]);
        d.store(&mut to[4 * half + 3]);
    }
}

/// Record i below record i + 4.
#[inline(always)]
pub(super) fn near_pair(records: &[[f32; 8]; 16], i: usize) -> __m512 {
    let (low, high) = (F32x8::load(&records[i]), F32x8::load(&records[i + 4]));
    call!(_mm512_insertf32x8::<UPPER>(call!(_mm512_castps256_ps512(low.0)), high.0))
}

/// Rows `column` and `column + 4`: the even and the odd quarters of both.
#[inline(always)]
pub(super) fn write_columns((a, b): (__m512, __m512), to: &mut [[f32; 16]; 8], column: usize) {
    F32x16(call!(_mm512_shuffle_f32x4::<EVEN>(a, b))).store(&mut to[column]);
    F32x16(call!(_mm512_shuffle_f32x4::<ODD>(a, b))).store(&mut to[column + 4]);
}

/// Numbers of a vertex in another order of axes, in each four.
pub(super) const ROTATED: i32 = 0b11_00_10_01;

/// A vertex and a number of the next.
#[inline(always)]
fn vertex(from: &[[f32; 3]], at: u32) -> Option<__m128> {
    let at = at as usize;
    if at + 1 >= from.len() {
        return None;
    }
    // SAFETY: the next vertex exists, so that many numbers follow; an unaligned load of the baseline.
    Some(unsafe { _mm_loadu_ps(from.as_ptr().add(at).cast()) })
}

/// Two vertices, each with a number of the next.
#[inline(always)]
pub(super) fn two_vertices(from: &[[f32; 3]], first: u32, second: u32) -> Option<F32x8> {
    let (low, high) = (vertex(from, first)?, vertex(from, second)?);
    Some(F32x8(call!(_mm256_insertf128_ps::<UPPER>(call!(_mm256_castps128_ps256(low)), high))))
}
