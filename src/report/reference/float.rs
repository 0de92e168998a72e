//! One ray against one triangle in f64, with a bound on every error.

use super::interval::Interval;
use crate::{
    geom::Ray,
    glam::{DVec3, Vec3},
};

/// Bound on the error of a triple product, in units of the sum of its terms' sizes.
///
/// With ε = 2^-53, a difference of two f32 has a relative error of at most ε. A term of `x . (y x z)` is a product of three such
/// differences (3 ε), rounded at each product (2 ε) and at the difference and the two sums that it enters (3 ε): 8 ε. A component of the normal
/// takes one rounding more. Its double covers the roundings of the sum of sizes as well.
const BOUND: f64 = 16.0 * (f64::EPSILON / 2.0);

/// What f64 says about a ray and a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Found {
    /// The ray's line surely passes by.
    Miss,
    /// The ray's line surely meets the inside, at this t, u and v.
    Hit([Interval; 3]),
    /// Unknown.
    Doubt,
}

/// Where the line of `ray` passes a triangle of finite corners. The range of t is not looked at.
///
/// Corners are taken relative to the origin. The weight of a corner is the volume of the direction and the opposite edge, which
/// unlike the customary formulas treats all corners alike.
pub(super) fn test(ray: &Ray, corners: &[Vec3; 3]) -> Found {
    let d = ray.dir.as_dvec3();
    let [a, b, c] = corners.map(|p| p.as_dvec3() - ray.origin.as_dvec3());
    let [p, q, r] = corners.map(Vec3::as_dvec3);
    let (ab, bc, ca) = (q - p, r - q, p - r);
    let weights = [volume(d, b, bc), volume(d, c, ca), volume(d, a, ab)];
    if weights.iter().any(|w| w.is_positive()) && weights.iter().any(|w| w.is_negative()) {
        return Found::Miss;
    }
    if !weights.iter().all(|w| w.is_positive() || w.is_negative()) {
        return Found::Doubt;
    }
    let (ac, slope) = (-ca, volume(d, ab, -ca));
    let height = volume(a, ab, ac);
    let [_, u, v] = weights;
    match (height.over(slope), u.over(slope), v.over(slope)) {
        (Some(t), Some(u), Some(v)) => Found::Hit([t, u, v]),
        _ => Found::Doubt,
    }
}

/// `x . (y x z)`.
fn volume(x: DVec3, y: DVec3, z: DVec3) -> Interval {
    let [yz, zx, xy] = [(y.y, z.z, y.z, z.y), (y.z, z.x, y.x, z.z), (y.x, z.y, y.y, z.x)];
    let minor = |(a, b, c, d): (f64, f64, f64, f64)| (a * b - c * d, (a * b).abs() + (c * d).abs());
    let ((i, si), (j, sj), (k, sk)) = (minor(yz), minor(zx), minor(xy));
    let size = x.x.abs() * si + x.y.abs() * sj + x.z.abs() * sk;
    Interval::around(x.x * i + x.y * j + x.z * k, BOUND * size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_have_their_sign_and_hold_their_value() {
        let v = volume(DVec3::X, DVec3::Y, DVec3::Z);
        assert!(v.low <= 1.0 && 1.0 <= v.high && v.high - v.low < 1e-13);
        assert!(volume(DVec3::Y, DVec3::X, DVec3::Z).is_negative());
        let flat = volume(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.2, 0.4, 0.6), DVec3::Z);
        assert!(flat.low <= 0.0 && flat.high >= 0.0);
    }

    #[test]
    fn insides_are_met_outsides_are_not_and_edges_are_in_doubt() {
        let corners = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(4.0, 0.0, 2.0), Vec3::new(0.0, 4.0, 2.0)];
        let at = |x: f32, y: f32, d: Vec3| test(&Ray::new(Vec3::new(x, y, 0.0), d), &corners);
        for d in [Vec3::Z, -Vec3::Z] {
            let Found::Hit([t, u, v]) = at(1.0, 2.0, d) else { panic!("inside") };
            let due = 2.0 * f64::from(d.z);
            assert!(t.low <= due && due <= t.high && t.high - t.low < 1e-12);
            assert!(u.low <= 0.25 && 0.25 <= u.high && v.low <= 0.5 && 0.5 <= v.high);
            assert_eq!(at(3.0, 3.0, d), Found::Miss);
            assert_eq!(at(2.0, 2.0, d), Found::Doubt);
            assert_eq!(at(1.0, 1.0, Vec3::X), Found::Miss);
        }
    }
}
