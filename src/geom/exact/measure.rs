use glam::Vec3;

use super::volumes::{Int3, cross, dot, least_exponent, sub, to_ints};

/// `(a - d) . ((b - d) x (c - d))` for `[a, b, c]` and `d`, finite: six times the signed volume of a tetrahedron.
///
/// Within 2^-52 of its size, by integers; 0 exactly where the points lie in a plane.
pub fn volume(corners: [Vec3; 3], d: Vec3) -> f64 {
    let [a, b, c] = corners;
    let points = [a, b, c, d];
    let exponent = least_exponent(&points);
    let [a, b, c, d] = points.map(|p| to_ints(p, exponent));
    dot(&sub(&a, &d), &cross(&sub(&b, &d), &sub(&c, &d))).to_f64(3 * exponent)
}

/// Twice the signed area of a triangle in the plane, finite; positive when its corners turn from x towards y.
///
/// Within 2^-52 of its size, by integers; 0 exactly where the corners lie on a line.
pub fn area(corners: [[f32; 2]; 3]) -> f64 {
    let points = corners.map(|[x, y]| Vec3::new(x, y, 0.0));
    let exponent = least_exponent(&points);
    let [a, b, c]: [Int3; 3] = points.map(|p| to_ints(p, exponent));
    let (ab, ac) = (sub(&b, &a), sub(&c, &a));
    ab[0].mul(&ac[1]).sub(&ab[1].mul(&ac[0])).to_f64(2 * exponent)
}
