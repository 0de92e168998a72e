//! Small functions whose results are the same on every machine: only `+ - * /`, `sqrt` and integer steps.

use glam::Vec3;

/// Base-2 logarithm of a positive finite number, within 2e-5; -126 for anything smaller than a normal number.
///
/// The mantissa goes through a rational fit of `log2` on `[1, 2)` in `z = (m - 1) / (m + 1)`.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    let bits = x.max(f32::MIN_POSITIVE).to_bits();
    let exponent = (bits >> 23) as f32 - 127.0;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    let z = (mantissa - 1.0) / (mantissa + 1.0);
    let z2 = z * z;
    // 2 / ln 2 * (z + z^3 / 3 + z^5 / 5 + z^7 / 7)
    exponent + z * (2.885_39 + z2 * (0.961_796_7 + z2 * (0.577_078_04 + z2 * 0.412_198_6)))
}

/// `(sin x, cos x)` for `x` in `[-pi/4, pi/4]`, within 4e-7 (Taylor polynomials).
#[inline(always)]
pub(crate) fn sin_cos_quarter(x: f32) -> (f32, f32) {
    let x2 = x * x;
    let sin = x * (1.0 - x2 * (1.0 / 6.0 - x2 * (1.0 / 120.0 - x2 * (1.0 / 5040.0))));
    let cos = 1.0 - x2 * (0.5 - x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0 - x2 * (1.0 / 40_320.0))));
    (sin, cos)
}

/// The point of the unit disc that belongs to a point of the unit square, area for area.
///
/// # Source
/// Shirley and Chiu, "A Low Distortion Map Between Disk and Square", 1997.
#[inline(always)]
pub(crate) fn disc(u: f32, v: f32) -> (f32, f32) {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let quarter = std::f32::consts::FRAC_PI_4;
    if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() > b.abs() {
        let (sin, cos) = sin_cos_quarter(quarter * (b / a));
        (a * cos, a * sin)
    } else {
        let (sin, cos) = sin_cos_quarter(quarter * (a / b));
        (b * sin, b * cos)
    }
}

/// Two unit vectors that make a right-handed frame with the unit vector `n`.
///
/// # Source
/// Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
#[inline(always)]
pub(crate) fn frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// `v` at unit length; `or` when its length is zero, infinite or NaN.
#[inline(always)]
pub(crate) fn unit_or(v: Vec3, or: Vec3) -> Vec3 {
    // Scaled by the largest component first, so that tiny and huge vectors neither vanish nor overflow.
    let largest = v.x.abs().max(v.y.abs()).max(v.z.abs());
    let scaled = v / largest;
    let length = scaled.dot(scaled).sqrt();
    if length >= 1.0 && length.is_finite() { scaled / length } else { or }
}

/// Blend of `a` and `b`.
#[inline(always)]
pub(crate) fn mix(a: Vec3, b: Vec3, s: f32) -> Vec3 {
    a + (b - a) * s
}

/// Smooth step from 0 at `a` to 1 at `b`.
#[inline(always)]
pub(crate) fn smooth(a: f32, b: f32, x: f32) -> f32 {
    let s = ((x - a) / (b - a)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Rec. 709 luminance.
#[inline(always)]
pub(crate) fn luminance(c: Vec3) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log2_is_within_its_bound() {
        for i in 1..200_000u32 {
            let x = i as f32 * 0.037;
            let exact = libm::log2(f64::from(x));
            assert!((f64::from(log2(x)) - exact).abs() < 5e-5, "{x}: {} {exact}", log2(x));
        }
    }

    #[test]
    fn disc_points_lie_in_the_disc_and_cover_it_evenly() {
        let n = 200;
        let mut inside = 0;
        for i in 0..n * n {
            let (x, y) = disc(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
            let r2 = x * x + y * y;
            assert!(r2 <= 1.000_01);
            inside += i32::from(r2 <= 0.25);
        }
        assert!((inside as f32 / (n * n) as f32 - 0.25).abs() < 0.01);
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for i in 0..1000 {
            let v = Vec3::new((i % 11) as f32 - 5.0, (i % 7) as f32 - 3.0, (i % 13) as f32 - 6.0);
            let n = unit_or(v, Vec3::Y);
            let (t, b) = frame(n);
            assert!(t.dot(n).abs() < 1e-6 && b.dot(n).abs() < 1e-6 && t.dot(b).abs() < 1e-6);
            assert!(t.cross(b).dot(n) > 0.999);
        }
    }

    #[test]
    fn unit_or_handles_tiny_huge_and_invalid_vectors() {
        assert!((unit_or(Vec3::new(0.0, 1e-40, 0.0), Vec3::X) - Vec3::Y).length() < 1e-3);
        assert!((unit_or(Vec3::splat(1e38), Vec3::X).length() - 1.0).abs() < 1e-6);
        assert_eq!(unit_or(Vec3::ZERO, Vec3::X), Vec3::X);
        assert_eq!(unit_or(Vec3::NAN, Vec3::X), Vec3::X);
        assert_eq!(unit_or(Vec3::INFINITY, Vec3::X), Vec3::X);
    }
}
