//! AVX2 and AVX-512. Every `unsafe` here is the call of an intrinsic whose feature is a part of the level: the level's
//! types are named only by `dispatch`, which has checked the machine.
#![allow(unused_unsafe, reason = "intrinsics of x86-64's baseline are safe to call, those beside them are not")]

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{
    Halves, Lanes, Simd, SimdLevel, Task,
    dispatch::{call_avx2, call_avx512},
    ordered::{BASE, LANE},
};

/// Calls one intrinsic.
macro_rules! call {
    ($intrinsic:ident $(::<$constant:ident>)? ($($arg:expr),*)) => {
        // SAFETY: the intrinsic's feature is in the level (module head).
        unsafe { $intrinsic $(::<$constant>)? ($($arg),*) }
    };
}

/// AVX2 with FMA.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2;

/// AVX-512 besides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512;

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
    fn descending(numbers: F32x8, chosen: u32, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
        let lanes = call!(_mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128));
        let bits = call!(_mm256_and_si256(call!(_mm256_set1_epi32(chosen.cast_signed())), lanes));
        let keys = call!(_mm256_and_si256(keys(numbers), call!(_mm256_cmpeq_epi32(bits, lanes))));
        sort(keys, words, to_keys, to_words);
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        // SAFETY: the type is private to this module, so code names it only below a dispatch that found its features.
        unsafe { call_avx2(task) }
    }
}

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
        // SAFETY: the array is as long as the unaligned store; AVX-512 is in the level (module head).
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
    #[expect(clippy::cast_possible_truncation, reason = "a bit a lane")]
    fn descending(numbers: F32x8, chosen: u32, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
        sort(call!(_mm256_maskz_mov_epi32(chosen as u8, keys(numbers))), words, to_keys, to_words);
    }

    #[inline(always)]
    fn call<T: Task>(task: T) -> T::Output {
        // SAFETY: the type is private to this module, so code names it only below a dispatch that found its features.
        unsafe { call_avx512(task) }
    }
}

#[inline(always)]
fn widen(narrow: F32x4) -> F64x4 {
    // SAFETY: AVX is in the level (module head).
    F64x4(unsafe { _mm256_cvtps_pd(narrow.0) })
}

/// The first two of each four numbers' first pairs of unpacked rows, and the last two.
const LOWS: i32 = 0b01_00_01_00;
const HIGHS: i32 = 0b11_10_11_10;
/// The even quarters of two vectors, and the odd ones.
const EVEN: i32 = 0b10_00_10_00;
const ODD: i32 = 0b11_01_11_01;
/// The upper half.
const UPPER: i32 = 1;

/// Four numbers from `at` on of record i below those of record i + 4.
#[inline(always)]
fn far_pair(records: &[[f32; 8]; 8], i: usize, at: usize) -> __m256 {
    let (low, high) = (F32x4::load(&records[i][at..]), F32x4::load(&records[i + 4][at..]));
    call!(_mm256_insertf128_ps::<UPPER>(call!(_mm256_castps128_ps256(low.0)), high.0))
}

/// Rows `4 * half` to `4 * half + 3` of the columns of eight records.
#[inline(always)]
fn four_columns(records: &[[f32; 8]; 8], half: usize) -> [F32x8; 4] {
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
fn eight_columns(records: &[[f32; 8]; 8], to: &mut [[f32; 8]; 8]) {
    for half in 0..2 {
        let [a, b, c, d] = four_columns(records, half);
        a.store(&mut to[4 * half]);
        b.store(&mut to[4 * half + 1]);
        c.store(&mut to[4 * half + 2]);
        d.store(&mut to[4 * half + 3]);
    }
}

#[inline(always)]
fn of_bytes(bytes: &[u8; 8]) -> F32x8 {
    let bytes = call!(_mm_cvtsi64_si128(i64::from_le_bytes(*bytes)));
    F32x8(call!(_mm256_cvtepi32_ps(call!(_mm256_cvtepu8_epi32(bytes)))))
}

/// Record i below record i + 4.
#[inline(always)]
fn near_pair(records: &[[f32; 8]; 16], i: usize) -> __m512 {
    let (low, high) = (F32x8::load(&records[i]), F32x8::load(&records[i + 4]));
    call!(_mm512_insertf32x8::<UPPER>(call!(_mm512_castps256_ps512(low.0)), high.0))
}

/// Rows `column` and `column + 4`: the even and the odd quarters of both.
#[inline(always)]
fn write_columns((a, b): (__m512, __m512), to: &mut [[f32; 16]; 8], column: usize) {
    F32x16(call!(_mm512_shuffle_f32x4::<EVEN>(a, b))).store(&mut to[column]);
    F32x16(call!(_mm512_shuffle_f32x4::<ODD>(a, b))).store(&mut to[column + 4]);
}

#[inline(always)]
fn halves(numbers: F32x16) -> (F32x8, F32x8) {
    (F32x8(call!(_mm512_castps512_ps256(numbers.0))), F32x8(call!(_mm512_extractf32x8_ps::<UPPER>(numbers.0))))
}

/// The least of eight numbers.
#[inline(always)]
fn least_of(numbers: F32x8) -> f32 {
    let (low, high) = (call!(_mm256_castps256_ps128(numbers.0)), call!(_mm256_extractf128_ps::<UPPER>(numbers.0)));
    let four = call!(_mm_min_ps(low, high));
    let two = call!(_mm_min_ps(four, call!(_mm_movehl_ps(four, four))));
    call!(_mm_cvtss_f32(call!(_mm_min_ss(two, call!(_mm_movehdup_ps(two))))))
}

#[inline(always)]
fn load_words(from: &[u32; 8]) -> __m256i {
    // SAFETY: the array is as long as the unaligned load; AVX is in the level (module head).
    unsafe { _mm256_loadu_si256(from.as_ptr().cast()) }
}

#[inline(always)]
fn store_words(words: __m256i, to: &mut [u32; 8]) {
    // SAFETY: the array is as long as the unaligned store; AVX is in the level (module head).
    unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), words) };
}

/// The keys of [`Simd::descending`], all lanes.
#[inline(always)]
fn keys(numbers: F32x8) -> __m256i {
    let lane = call!(_mm256_set1_epi32(LANE.cast_signed()));
    let high = call!(_mm256_andnot_si256(lane, call!(_mm256_castps_si256(numbers.0))));
    let base = BASE.cast_signed();
    let low = call!(_mm256_setr_epi32(base, base + 1, base + 2, base + 3, base + 4, base + 5, base + 6, base + 7));
    call!(_mm256_add_epi32(high, low))
}

/// One step of a sorting network: of each pair of lanes, one here and one in `other`, the lesser goes to those whose bit is set in `LESSER`.
#[inline(always)]
fn exchanged<const LESSER: i32>(keys: __m256i, other: __m256i) -> __m256i {
    let (greater, lesser) = (call!(_mm256_max_epu32(keys, other)), call!(_mm256_min_epu32(keys, other)));
    call!(_mm256_blend_epi32::<LESSER>(greater, lesser))
}

/// Writes keys in descending order, and the words of their lanes.
#[inline(always)]
fn sort(keys: __m256i, words: &[u32; 8], to_keys: &mut [u32; 8], to_words: &mut [u32; 8]) {
    const PAIRS: i32 = 0b10_11_00_01;
    const MIRROR: i32 = 0b00_01_10_11;
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

/// For every choice among eight lanes, the chosen ones in order.
static COMPRESS: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut chosen = 0;
    while chosen < 256 {
        let (mut lane, mut len) = (0_u32, 0);
        while lane < 8 {
            if chosen >> lane & 1 == 1 {
                table[chosen][len] = lane;
                len += 1;
            }
            lane += 1;
        }
        chosen += 1;
    }
    table
};

/// Comparison into a bit mask, by vector compare and move or by mask register.
macro_rules! compare {
    (vector $cmp:ident $movemask:ident, $predicate:ident, $a:expr, $b:expr) => {
        call!($movemask(call!($cmp::<$predicate>($a, $b)))).cast_unsigned()
    };
    (register $cmp:ident, $predicate:ident, $a:expr, $b:expr) => {
        u32::from(call!($cmp::<$predicate>($a, $b)))
    };
}

#[inline(always)]
fn floor_f32x4(x: __m128) -> __m128 {
    call!(_mm_floor_ps(x))
}

#[inline(always)]
fn floor_f32x8(x: __m256) -> __m256 {
    call!(_mm256_floor_ps(x))
}

#[inline(always)]
fn floor_f64x4(x: __m256d) -> __m256d {
    call!(_mm256_floor_pd(x))
}

#[inline(always)]
fn floor_f32x16(x: __m512) -> __m512 {
    const DOWN: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
    call!(_mm512_roundscale_ps::<DOWN>(x))
}

#[inline(always)]
fn floor_f64x8(x: __m512d) -> __m512d {
    const DOWN: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
    call!(_mm512_roundscale_pd::<DOWN>(x))
}

#[inline(always)]
fn choose_f32x4(mask: u32, a: __m128, b: __m128) -> __m128 {
    let lanes = call!(_mm_setr_epi32(1, 2, 4, 8));
    let chosen = call!(_mm_cmpeq_epi32(call!(_mm_and_si128(call!(_mm_set1_epi32(mask.cast_signed())), lanes)), lanes));
    call!(_mm_blendv_ps(b, a, call!(_mm_castsi128_ps(chosen))))
}

#[inline(always)]
fn choose_f32x8(mask: u32, a: __m256, b: __m256) -> __m256 {
    let lanes = call!(_mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128));
    let bits = call!(_mm256_and_si256(call!(_mm256_set1_epi32(mask.cast_signed())), lanes));
    call!(_mm256_blendv_ps(b, a, call!(_mm256_castsi256_ps(call!(_mm256_cmpeq_epi32(bits, lanes))))))
}

#[inline(always)]
fn choose_f64x4(mask: u32, a: __m256d, b: __m256d) -> __m256d {
    let lanes = call!(_mm256_setr_epi64x(1, 2, 4, 8));
    let bits = call!(_mm256_and_si256(call!(_mm256_set1_epi64x(i64::from(mask))), lanes));
    call!(_mm256_blendv_pd(b, a, call!(_mm256_castsi256_pd(call!(_mm256_cmpeq_epi64(bits, lanes))))))
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a bit a lane")]
fn choose_f32x16(mask: u32, a: __m512, b: __m512) -> __m512 {
    call!(_mm512_mask_blend_ps(mask as u16, b, a))
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a bit a lane")]
fn choose_f64x8(mask: u32, a: __m512d, b: __m512d) -> __m512d {
    call!(_mm512_mask_blend_pd(mask as u8, b, a))
}

macro_rules! vector {
    ($name:ident($raw:ident), $elem:ident x $len:literal, compare $($compare:ident)+,
     $set1:ident $load:ident $store:ident $add:ident $sub:ident $mul:ident $div:ident $min:ident $max:ident
     $fmadd:ident $fmsub:ident $xor:ident $andnot:ident $sqrt:ident $floor:ident $choose:ident) => {
        #[derive(Clone, Copy, Debug)]
        pub(super) struct $name($raw);

        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self(call!($add(self.0, other.0)))
            }
        }

        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self(call!($sub(self.0, other.0)))
            }
        }

        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self(call!($mul(self.0, other.0)))
            }
        }

        impl Div for $name {
            type Output = Self;
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                Self(call!($div(self.0, other.0)))
            }
        }

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(call!($xor(self.0, call!($set1(-0.0)))))
            }
        }

        impl Lanes for $name {
            type Elem = $elem;
            const LEN: usize = $len;

            #[inline(always)]
            fn splat(value: $elem) -> Self {
                Self(call!($set1(value)))
            }
            #[inline(always)]
            fn load(from: &[$elem]) -> Self {
                let from: &[$elem; $len] = from[..$len].try_into().expect("the slice has that length");
                // SAFETY: the array is as long as the unaligned load; the feature is in the level (module head).
                Self(unsafe { $load(from.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut [$elem]) {
                let to: &mut [$elem; $len] = (&mut to[..$len]).try_into().expect("the slice has that length");
                // SAFETY: the array is as long as the unaligned store; the feature is in the level (module head).
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(call!($min(self.0, other.0)))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(call!($max(self.0, other.0)))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(call!($andnot(call!($set1(-0.0)), self.0)))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(call!($sqrt(self.0)))
            }
            #[inline(always)]
            fn floor(self) -> Self {
                Self($floor(self.0))
            }
            #[inline(always)]
            fn select(mask: u32, a: Self, b: Self) -> Self {
                Self($choose(mask, a.0, b.0))
            }
            #[inline(always)]
            fn mul_add_loose(self, b: Self, c: Self) -> Self {
                Self(call!($fmadd(self.0, b.0, c.0)))
            }
            #[inline(always)]
            fn mul_sub_loose(self, b: Self, c: Self) -> Self {
                Self(call!($fmsub(self.0, b.0, c.0)))
            }
            #[inline(always)]
            fn lt(self, other: Self) -> u32 {
                compare!($($compare)+, _CMP_LT_OQ, self.0, other.0)
            }
            #[inline(always)]
            fn le(self, other: Self) -> u32 {
                compare!($($compare)+, _CMP_LE_OQ, self.0, other.0)
            }
        }
    };
}

vector!(F32x4(__m128), f32 x 4, compare vector _mm_cmp_ps _mm_movemask_ps,
    _mm_set1_ps _mm_loadu_ps _mm_storeu_ps _mm_add_ps _mm_sub_ps _mm_mul_ps _mm_div_ps _mm_min_ps _mm_max_ps
    _mm_fmadd_ps _mm_fmsub_ps _mm_xor_ps _mm_andnot_ps
    _mm_sqrt_ps floor_f32x4 choose_f32x4);
vector!(F32x8(__m256), f32 x 8, compare vector _mm256_cmp_ps _mm256_movemask_ps,
    _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps _mm256_min_ps
    _mm256_max_ps _mm256_fmadd_ps _mm256_fmsub_ps _mm256_xor_ps _mm256_andnot_ps
    _mm256_sqrt_ps floor_f32x8 choose_f32x8);
vector!(F64x4(__m256d), f64 x 4, compare vector _mm256_cmp_pd _mm256_movemask_pd,
    _mm256_set1_pd _mm256_loadu_pd _mm256_storeu_pd _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd _mm256_min_pd
    _mm256_max_pd _mm256_fmadd_pd _mm256_fmsub_pd _mm256_xor_pd _mm256_andnot_pd
    _mm256_sqrt_pd floor_f64x4 choose_f64x4);
vector!(F32x16(__m512), f32 x 16, compare register _mm512_cmp_ps_mask,
    _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps _mm512_min_ps
    _mm512_max_ps _mm512_fmadd_ps _mm512_fmsub_ps _mm512_xor_ps _mm512_andnot_ps
    _mm512_sqrt_ps floor_f32x16 choose_f32x16);
vector!(F64x8(__m512d), f64 x 8, compare register _mm512_cmp_pd_mask,
    _mm512_set1_pd _mm512_loadu_pd _mm512_storeu_pd _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd _mm512_min_pd
    _mm512_max_pd _mm512_fmadd_pd _mm512_fmsub_pd _mm512_xor_pd _mm512_andnot_pd
    _mm512_sqrt_pd floor_f64x8 choose_f64x8);

/// Lane numbers for `vpermilps`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order(__m128i);

impl Halves for F32x4 {
    type Swap = Order;

    #[inline(always)]
    fn swap(on: bool) -> Order {
        Order(if on { call!(_mm_setr_epi32(2, 3, 0, 1)) } else { call!(_mm_setr_epi32(0, 1, 2, 3)) })
    }
    #[inline(always)]
    fn swapped(self, swap: Order) -> Self {
        Self(call!(_mm_permutevar_ps(self.0, swap.0)))
    }
    #[inline(always)]
    fn high_half(self) -> Self {
        Self(call!(_mm_movehl_ps(self.0, self.0)))
    }
    #[inline(always)]
    fn rotated(self) -> Self {
        const ROTATED: i32 = 0b11_00_10_01;
        Self(call!(_mm_shuffle_ps::<ROTATED>(self.0, self.0)))
    }
    #[inline(always)]
    fn first(self) -> f32 {
        call!(_mm_cvtss_f32(self.0))
    }
    #[inline(always)]
    fn second(self) -> f32 {
        call!(_mm_cvtss_f32(call!(_mm_movehdup_ps(self.0))))
    }
}
