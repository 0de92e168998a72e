/// Relative slack of a quotient's ends: more than the four roundings that make them.
const SLACK: f64 = 8.0 * f64::EPSILON;

/// A number that is known to lie between two f64, ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Interval {
    /// All numbers within `error` of `value`, and a little more.
    pub(super) fn around(value: f64, error: f64) -> Self {
        Self { low: value - error, high: value + error }.widened()
    }

    fn widened(self) -> Self {
        Self { low: self.low - SLACK * self.low.abs(), high: self.high + SLACK * self.high.abs() }
    }

    pub(super) fn is_positive(self) -> bool {
        self.low > 0.0
    }

    pub(super) fn is_negative(self) -> bool {
        self.high < 0.0
    }

    /// Every quotient of two numbers of these; `None` when the divisor may be 0.
    pub(super) fn over(self, divisor: Self) -> Option<Self> {
        if !divisor.is_positive() && !divisor.is_negative() {
            return None;
        }
        let ends = [self.low / divisor.low, self.low / divisor.high, self.high / divisor.low, self.high / divisor.high];
        let low = ends.into_iter().fold(f64::INFINITY, f64::min);
        let high = ends.into_iter().fold(f64::NEG_INFINITY, f64::max);
        Some(Self { low, high }.widened())
    }

    /// The middle.
    pub(super) fn middle(self) -> f64 {
        f64::midpoint(self.low, self.high)
    }

    /// The f32 that every number between the ends rounds to, if it is one; 0 is +0.
    #[expect(clippy::cast_possible_truncation, clippy::float_cmp, reason = "roundings are compared")]
    pub(super) fn rounded(self) -> Option<f32> {
        let (low, high) = (self.low as f32, self.high as f32);
        (low == high).then_some(low + 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_hold_all_corners_and_refuse_zero() {
        let (a, b) = (Interval { low: -1.0, high: 3.0 }, Interval { low: 2.0, high: 4.0 });
        let q = a.over(b).unwrap();
        assert!(q.low <= -0.5 && q.low > -0.501 && q.high >= 1.5 && q.high < 1.501);
        let negative = Interval { low: -4.0, high: -2.0 };
        let q = a.over(negative).unwrap();
        assert!(q.low <= -1.5 && q.low > -1.501 && q.high >= 0.5 && q.high < 0.501);
        assert_eq!(a.over(a), None);
        assert_eq!(a.over(Interval { low: 0.0, high: 1.0 }), None);
    }

    #[test]
    fn a_rounding_is_known_when_both_ends_share_it() {
        assert_eq!(Interval::around(1.0, 1e-9).rounded(), Some(1.0));
        assert_eq!(Interval::around(1.0 + f64::from(f32::EPSILON) / 2.0, 1e-12).rounded(), None);
        assert_eq!(Interval::around(0.0, 0.0).rounded().map(f32::to_bits), Some(0));
    }
}
