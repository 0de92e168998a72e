//! Vectors of `f32` and `f64`.

#[allow(clippy::wildcard_imports, reason = "dozens of intrinsics")]
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::simd::{Halves, Lanes};

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
        pub(in crate::simd) struct $name(pub(super) $raw);

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
                // SAFETY: the array is as long as the unaligned load; the feature is in the level (head of `x86`).
                Self(unsafe { $load(from.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut [$elem]) {
                let to: &mut [$elem; $len] = (&mut to[..$len]).try_into().expect("the slice has that length");
                // SAFETY: the array is as long as the unaligned store; the feature is in the level (head of `x86`).
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

/// The upper half.
pub(super) const UPPER: i32 = 1;

#[inline(always)]
pub(super) fn widen(narrow: F32x4) -> F64x4 {
    // SAFETY: AVX is in the level (head of `x86`).
    F64x4(unsafe { _mm256_cvtps_pd(narrow.0) })
}

#[inline(always)]
pub(super) fn halves(numbers: F32x16) -> (F32x8, F32x8) {
    (F32x8(call!(_mm512_castps512_ps256(numbers.0))), F32x8(call!(_mm512_extractf32x8_ps::<UPPER>(numbers.0))))
}

#[inline(always)]
pub(super) fn quarters(numbers: F32x8) -> (F32x4, F32x4) {
    (F32x4(call!(_mm256_castps256_ps128(numbers.0))), F32x4(call!(_mm256_extractf128_ps::<UPPER>(numbers.0))))
}

/// The least of eight numbers.
#[inline(always)]
pub(super) fn least_of(numbers: F32x8) -> f32 {
    let (low, high) = (call!(_mm256_castps256_ps128(numbers.0)), call!(_mm256_extractf128_ps::<UPPER>(numbers.0)));
    let four = call!(_mm_min_ps(low, high));
    let two = call!(_mm_min_ps(four, call!(_mm_movehl_ps(four, four))));
    call!(_mm_cvtss_f32(call!(_mm_min_ss(two, call!(_mm_movehdup_ps(two))))))
}

/// Lane numbers for `vpermilps`.
#[derive(Clone, Copy, Debug)]
pub(in crate::simd) struct Order(__m128i);

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
