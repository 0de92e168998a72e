use std::cmp::Ordering;

use super::{
    int::{Int, cmp_scaled},
    volumes::Scaled,
};

/// `(to - from) / speed` of finite numbers, `speed` not 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// Where the way ends.
    pub to: f32,
    /// Where it begins.
    pub from: f32,
    /// How fast.
    pub speed: f32,
}

impl Ratio {
    /// The ratio in f64, within 2^-52 of its size.
    pub fn value(self) -> f64 {
        (f64::from(self.to) - f64::from(self.from)) / f64::from(self.speed)
    }

    /// Compares the exact values.
    pub fn compare(self, other: Self) -> Ordering {
        let (a, b) = (self.value(), other.value());
        // Both are off by at most 2^-52 of their size; the bound has twice that.
        let doubt = 2.0 * f64::EPSILON * (a.abs() + b.abs());
        if (a - b).abs() > doubt {
            return a.total_cmp(&b);
        }
        let ((a, a_exponent), (b, b_exponent)) = (self.way(), other.way());
        let (u, v) = (Scaled::new(self.speed), Scaled::new(other.speed));
        // a / u against b / v: a v against b u, turned round for each negative speed.
        let sign = u.mantissa.signum() * v.mantissa.signum();
        let left = a.mul(&Int::from_scaled(v.mantissa, 0)).times_sign(sign);
        let right = b.mul(&Int::from_scaled(u.mantissa, 0)).times_sign(sign);
        cmp_scaled(&left, a_exponent + v.exponent, &right, b_exponent + u.exponent)
    }

    /// `to - from` as an integer and its exponent.
    fn way(self) -> (Int, i32) {
        let (to, from) = (Scaled::new(self.to), Scaled::new(self.from));
        let exponent = to.exponent.min(from.exponent);
        // Both 0: the way is 0 at any exponent.
        let exponent = if exponent == i32::MAX { 0 } else { exponent };
        (to.to_int(exponent).sub(&from.to_int(exponent)), exponent)
    }
}
