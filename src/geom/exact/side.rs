use glam::Vec3;

use super::{
    estimate::Estimate,
    volumes::{side_of_plane, slope_to_plane},
};

/// On which side of a triangle's plane a point lies, exactly: 1 where the corners run counterclockwise, -1 on the other
/// side, 0 in the plane, where the triangle has no area, and where a coordinate is not finite.
///
/// The sign of `(b - a) x (c - a) . (point - a)`.
pub fn side(corners: &[Vec3; 3], point: Vec3) -> i32 {
    let estimate = Estimate::new(point, Vec3::X, corners);
    certain(estimate.t, estimate.t_error).unwrap_or_else(|| side_of_plane(corners, point))
}

/// To which side of a triangle's plane a direction leads, exactly; numbers as for [`side`], 0 for a direction parallel to
/// the plane.
///
/// The sign of `(b - a) x (c - a) . dir`.
pub fn slope(corners: &[Vec3; 3], dir: Vec3) -> i32 {
    let estimate = Estimate::new(corners[0], dir, corners);
    certain(-estimate.det, estimate.det_error).unwrap_or_else(|| slope_to_plane(corners, dir))
}

fn certain(value: f64, error: f64) -> Option<i32> {
    if value > error {
        Some(1)
    } else if value < -error {
        Some(-1)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use num_rational::BigRational;
    use num_traits::{Signed, Zero};
    use proptest::prelude::*;

    use super::*;

    fn rational(x: f32) -> BigRational {
        BigRational::from_float(x).expect("finite")
    }

    /// The sign by rationals.
    fn sign(corners: &[Vec3; 3], v: &[BigRational; 3]) -> i32 {
        let edge =
            |i: usize| -> [BigRational; 3] { [0, 1, 2].map(|k| rational(corners[i][k]) - rational(corners[0][k])) };
        let (p, q) = (edge(1), edge(2));
        let minor = |i: usize, j: usize| &p[i] * &q[j] - &p[j] * &q[i];
        let volume = minor(1, 2) * &v[0] + minor(2, 0) * &v[1] + minor(0, 1) * &v[2];
        if volume.is_zero() {
            0
        } else if volume.is_negative() {
            -1
        } else {
            1
        }
    }

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => (-3_i8..=3).prop_map(f32::from),
            3 => -2.0_f32..2.0,
            1 => any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |f| f.is_finite()),
        ]
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn sides_and_slopes_are_those_of_rational_arithmetic(
            corners in [vector(), vector(), vector()],
            v in vector(),
        ) {
            let away = [0, 1, 2].map(|k| rational(v[k]) - rational(corners[0][k]));
            prop_assert_eq!(side(&corners, v), sign(&corners, &away));
            prop_assert_eq!(slope(&corners, v), sign(&corners, &v.to_array().map(rational)));
        }

        #[test]
        fn points_an_ulp_off_a_plane_are_told_from_those_in_it(
            corners in [vector(), vector(), vector()],
            u in 0.0_f32..1.0,
            v in 0.0_f32..1.0,
        ) {
            let [a, b, c] = corners;
            let near = a + (b - a) * u + (c - a) * v;
            prop_assume!(near.is_finite());
            for point in [near, Vec3::new(near.x, near.y, near.z.next_up()), Vec3::new(near.x.next_down(), near.y, near.z)] {
                let away = [0, 1, 2].map(|k| rational(point[k]) - rational(a[k]));
                prop_assert_eq!(side(&corners, point), sign(&corners, &away));
            }
        }
    }

    #[test]
    fn what_is_not_finite_has_no_side() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for bad in [f32::NAN, f32::INFINITY] {
            assert_eq!(side(&corners, Vec3::splat(bad)), 0);
            assert_eq!(slope(&corners, Vec3::splat(bad)), 0);
            assert_eq!(side(&[Vec3::splat(bad), Vec3::X, Vec3::Y], Vec3::Z), 0);
        }
    }
}
