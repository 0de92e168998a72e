//! Quaternion arithmetic that gives the same bits on every machine.

use glam::DQuat;

/// Below this angle (radians) sin x = x to the last bit, so a straight line is the arc.
const STRAIGHT: f64 = 1e-8;

/// `q` at unit length; the identity for a zero quaternion. NaN and infinite components give NaN.
pub(super) fn normalized(q: DQuat) -> DQuat {
    let length = q.dot(q).sqrt();
    if length == 0.0 {
        DQuat::IDENTITY
    } else {
        DQuat::from_xyzw(q.x / length, q.y / length, q.z / length, q.w / length)
    }
}

/// The rotation at `alpha` in [0, 1] on the shorter arc from `a` to `b`.
///
/// Neither need be of unit length; the result is, to rounding. Equal ends give `a` as it stands. The angle is
/// taken as `2 atan2(|a - b|, |a + b|)`, which keeps its accuracy near 0 where `acos` of the dot product
/// loses half the digits.
pub(super) fn slerp(a: DQuat, b: DQuat, alpha: f64) -> DQuat {
    if a == b {
        return a;
    }
    let a = normalized(a);
    let b = normalized(b);
    let b = if a.dot(b) < 0.0 { -b } else { b };
    let angle = 2.0 * libm::atan2((a - b).length(), (a + b).length());
    if angle < STRAIGHT {
        return normalized(a + (b - a) * alpha);
    }
    let whole = libm::sin(angle);
    let from = libm::sin((1.0 - alpha) * angle) / whole;
    let to = libm::sin(alpha * angle) / whole;
    a * from + b * to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_quaternion_becomes_the_identity() {
        assert_eq!(normalized(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)), DQuat::IDENTITY);
    }

    #[test]
    fn slerp_takes_the_shorter_arc_at_constant_speed() {
        let turn = |angle: f64| DQuat::from_xyzw(0.0, libm::sin(angle / 2.0), 0.0, libm::cos(angle / 2.0));
        for (from, to) in [(0.0, 1.0), (0.3, -1.2), (2.0, 2.0 + 1e-9), (0.0, 3.1), (-1.0, -1.0 + 1e-5)] {
            for alpha in [0.0, 0.25, 0.5, 0.9, 1.0] {
                let expected = turn(from + (to - from) * alpha);
                for sign in [1.0, -1.0] {
                    let got = slerp(turn(from), turn(to) * sign, alpha);
                    assert!((got.dot(expected).abs() - 1.0).abs() < 1e-15);
                    let off = (got - expected).length().min((got + expected).length());
                    assert!(off < 1e-15, "{from} -> {to} at {alpha}: {off:e}");
                }
            }
        }
    }

    #[test]
    fn slerp_normalises_its_ends() {
        let a = DQuat::from_xyzw(0.0, 0.707, 0.0, 0.707);
        let b = DQuat::from_xyzw(0.0, 2.0, 0.0, 0.0);
        let got = slerp(a, b, 0.5);
        let eighth = std::f64::consts::PI * 3.0 / 8.0;
        assert!((got.y - libm::sin(eighth)).abs() < 1e-15 && (got.w - libm::cos(eighth)).abs() < 1e-15);
    }

    #[test]
    fn slerp_between_opposite_signs_of_one_rotation_stays() {
        let a = DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8);
        let got = slerp(a, -a, 0.3);
        assert!((got - a).length() < 1e-15);
    }
}
