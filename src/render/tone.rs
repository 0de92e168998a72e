//! From scene-referred linear light to 8-bit sRGB: a filmic curve, then the exact transfer function.

use std::sync::OnceLock;

use glam::{Mat3, Vec3};

use super::wide::{Floats, One, V3};

/// Scale before the curve: a diffuse white under the key light lands just below display white.
const EXPOSURE: f32 = 1.6;

/// Rec. 709 to the curve's own primaries.
const CURVE_FROM_RGB: Mat3 = Mat3::from_cols(
    Vec3::new(0.59719, 0.07600, 0.02840),
    Vec3::new(0.35458, 0.90834, 0.13383),
    Vec3::new(0.04823, 0.01566, 0.83777),
);

/// The curve's primaries back to Rec. 709.
const RGB_FROM_CURVE: Mat3 = Mat3::from_cols(
    Vec3::new(1.60475, -0.10208, -0.00327),
    Vec3::new(-0.53108, 1.10813, -0.07276),
    Vec3::new(-0.07367, -0.00605, 1.07602),
);

/// Display-linear colour in [0, 1] of scene-referred linear Rec. 709.
///
/// # Source
/// Stephen Hill's fit of the ACES reference rendering and output transforms, 2016 (three rational terms between two
/// matrices).
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn filmic<F: Floats>(color: V3<F>) -> V3<F> {
    // Light is bounded so that infinite and NaN inputs stay displayable.
    let bounded = color.max(V3::all(F::splat(-16.0))).min(V3::all(F::splat(6e4)));
    let v = turned(&CURVE_FROM_RGB, bounded * F::splat(EXPOSURE));
    let above = v.times(v + V3::all(F::splat(0.024_578_6))) - V3::all(F::splat(0.000_090_537));
    let below = v.times(v * F::splat(0.983_729) + V3::all(F::splat(0.432_951))) + V3::all(F::splat(0.238_081));
    let curve = V3 { x: above.x / below.x, y: above.y / below.y, z: above.z / below.z };
    turned(&RGB_FROM_CURVE, curve).max(V3::zero()).min(V3::all(F::splat(1.0)))
}

#[cfg_attr(not(debug_assertions), inline(always))]
fn turned<F: Floats>(matrix: &Mat3, v: V3<F>) -> V3<F> {
    V3::splat(matrix.x_axis) * v.x + V3::splat(matrix.y_axis) * v.y + V3::splat(matrix.z_axis) * v.z
}

/// [`filmic`] of one colour.
pub(crate) fn filmic_of(color: Vec3) -> Vec3 {
    filmic(V3::<One>::splat(color)).only()
}

/// The scene-referred colour that [`filmic`] shows as `display` (display-linear, up to 0.97): what an unlit
/// surface emits so that it is shown as authored.
pub(crate) fn filmic_inverse(display: Vec3) -> Vec3 {
    let y = RGB_FROM_CURVE.inverse() * display.clamp(Vec3::ZERO, Vec3::splat(0.97));
    // y (0.983729 v^2 + 0.432951 v + 0.238081) = v^2 + 0.0245786 v - 0.000090537
    let a = Vec3::ONE - y * 0.983_729;
    let b = Vec3::splat(0.024_578_6) - y * 0.432_951;
    let c = -(y * 0.238_081 + 0.000_090_537);
    let root = (b * b - a * c * 4.0).max(Vec3::ZERO);
    let v = (Vec3::new(root.x.sqrt(), root.y.sqrt(), root.z.sqrt()) - b) / (a * 2.0);
    CURVE_FROM_RGB.inverse() * v / EXPOSURE
}

/// Linear value of an 8-bit sRGB code, correctly rounded: the table of 256 values.
pub(crate) fn linear_from_srgb8() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    #[expect(clippy::cast_possible_truncation, reason = "the one rounding")]
    TABLE.get_or_init(|| std::array::from_fn(|code| decode(code as f64 / 255.0) as f32))
}

/// The sRGB transfer function of IEC 61966-2-1, encoded to linear.
fn decode(s: f64) -> f64 {
    if s <= 0.04045 { s / 12.92 } else { libm::pow((s + 0.055) / 1.055, 2.4) }
}

/// [`decode`] of any value in [0, 1], by the line between its two neighbours of the 256 values.
#[inline(always)]
pub(crate) fn linear_of(encoded: f32) -> f32 {
    let table = linear_from_srgb8();
    let x = encoded.clamp(0.0, 1.0) * 255.0;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 254")]
    let low = (x as usize).min(254);
    table[low] + (table[low + 1] - table[low]) * (x - low as f32)
}

/// Exponent and mantissa bits above which buckets of [`Srgb8`] begin: 2^-13, below the first threshold.
const FIRST_BUCKET: u32 = (127 - 13) << 7;
/// Buckets up to 1.0, 128 an octave.
const BUCKETS: usize = 13 * 128;

/// Encodes linear values to 8-bit sRGB exactly, by thresholds: no transfer function is evaluated per pixel.
#[derive(Debug)]
pub(crate) struct Srgb8 {
    /// Code at the lower end of each bucket (the float's upper 16 bits).
    bucket: [u8; BUCKETS],
    /// Least linear value that rounds to the code; infinite past 255.
    threshold: [f32; 257],
}

impl Srgb8 {
    /// The tables, made once.
    pub(crate) fn get() -> &'static Self {
        static TABLE: OnceLock<Srgb8> = OnceLock::new();
        TABLE.get_or_init(Self::make)
    }

    fn make() -> Self {
        let threshold = std::array::from_fn(|code| match code {
            0 => 0.0,
            256 => f32::INFINITY,
            _ => least_f32_at_or_above(decode((code as f64 - 0.5) / 255.0)),
        });
        let bucket = std::array::from_fn(|i| {
            #[expect(clippy::cast_possible_truncation, reason = "below 2^16")]
            let lower = f32::from_bits((FIRST_BUCKET + i as u32) << 16);
            #[expect(clippy::cast_possible_truncation, reason = "at most 255")]
            let code = threshold[1..256].iter().filter(|&&t| t <= lower).count() as u8;
            code
        });
        Self { bucket, threshold }
    }

    /// The code nearest to the encoded `linear`; 0 below zero and for NaN, 255 from 1.0 on.
    #[inline(always)]
    pub(crate) fn encode(&self, linear: f32) -> u8 {
        if linear >= 1.0 {
            return 255;
        }
        // NaN fails this too.
        let positive = linear > 0.0;
        if !positive {
            return 0;
        }
        let upper = linear.to_bits() >> 16;
        let Some(index) = upper.checked_sub(FIRST_BUCKET) else { return 0 };
        let code = self.bucket[(index as usize).min(BUCKETS - 1)];
        // A bucket holds at most one threshold.
        code + u8::from(linear >= self.threshold[usize::from(code) + 1])
    }
}

/// The least `f32` that is not below `x` (positive).
fn least_f32_at_or_above(x: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "corrected below")]
    let near = x as f32;
    if f64::from(near) < x { f32::from_bits(near.to_bits() + 1) } else { near }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode_slowly(linear: f32) -> u8 {
        let l = f64::from(linear).clamp(0.0, 1.0);
        let s = if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * libm::pow(l, 1.0 / 2.4) - 0.055 };
        (s * 255.0).round() as u8
    }

    #[test]
    fn srgb_codes_survive_a_round_trip() {
        for (code, &linear) in linear_from_srgb8().iter().enumerate() {
            assert_eq!(usize::from(Srgb8::get().encode(linear)), code);
        }
    }

    #[test]
    fn encoding_rounds_to_the_nearest_code() {
        let table = Srgb8::get();
        for bits in (0..0x3f80_0100u32).step_by(997) {
            let x = f32::from_bits(bits);
            let slow = encode_slowly(x);
            let fast = table.encode(x);
            let near_tie = table.threshold.iter().any(|&t| (t - x).abs() <= 1e-6 * x);
            assert!(fast == slow || near_tie, "{x}: {fast} {slow}");
        }
        for code in 1..256 {
            let t = table.threshold[code];
            assert_eq!(usize::from(table.encode(t)), code);
            assert_eq!(usize::from(table.encode(f32::from_bits(t.to_bits() - 1))), code - 1);
        }
    }

    #[test]
    fn encoding_takes_any_float() {
        let table = Srgb8::get();
        for (x, code) in [(f32::NAN, 0), (f32::INFINITY, 255), (-1.0, 0), (-0.0, 0), (1e-40, 0), (2.0, 255)] {
            assert_eq!(table.encode(x), code, "{x}");
        }
    }

    #[test]
    fn the_curve_rises_and_stays_in_range() {
        let mut last = -1.0;
        for i in 0..2000 {
            let y = filmic_of(Vec3::splat(i as f32 * 0.01)).y;
            assert!((0.0..=1.0).contains(&y) && y >= last);
            last = y;
        }
        assert!(filmic_of(Vec3::ZERO).max_element() < 1e-3);
        assert!(filmic_of(Vec3::INFINITY).min_element() > 0.99);
        assert!(!filmic_of(Vec3::NAN).is_nan());
    }

    #[test]
    fn the_inverse_shows_colours_as_authored() {
        for i in 0..1000u32 {
            let c = Vec3::new((i % 10) as f32 / 10.0, (i / 10 % 10) as f32 / 10.0, (i / 100) as f32 / 10.0);
            let back = filmic_of(filmic_inverse(c));
            assert!((back - c).abs().max_element() < 2e-3, "{c} {back}");
        }
    }
}
