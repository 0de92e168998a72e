use std::ops::AddAssign;

use super::Truth;
use crate::geom::Hit;

/// Unit of relative errors: 2^-24, half the spacing of f32 at 1.
const U: f64 = 1.0 / 16_777_216.0;

/// An answer beside the right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Nothing is met, and nothing was found.
    Miss,
    /// One of the right triangles, so far off.
    Right(Offset),
    /// Something is met, but nothing was found.
    FalseMiss,
    /// Nothing is met, but something was found.
    FalseHit,
    /// Both, but the triangle is not among those met first; the error of t in u.
    WrongPrimitive(f64),
}

/// How far a hit of the right triangle is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// `|t - t*| / t*` in u = 2^-24; where t* is 0, infinite unless t is 0.
    pub t: f64,
    /// The larger of `|u - u*|` and `|v - v*|`, in u.
    pub uv: f64,
    /// t, u and v are the right values correctly rounded, and no right triangle has a lower number.
    pub is_exact: bool,
    /// u or v is not 0 where the right one is, or is 0 where the right one would round to something else.
    pub loses_zero: bool,
}

/// Compares what was found with what is right.
#[expect(clippy::float_cmp, reason = "roundings are compared")]
pub fn judge(truth: Option<&Truth>, found: Option<&Hit>) -> Verdict {
    let (truth, hit) = match (truth, found) {
        (None, None) => return Verdict::Miss,
        (Some(_), None) => return Verdict::FalseMiss,
        (None, Some(_)) => return Verdict::FalseHit,
        (Some(truth), Some(hit)) => (truth, hit),
    };
    let t = relative(hit.t.into(), truth);
    let Some(right) = truth.find(hit.prim) else { return Verdict::WrongPrimitive(t) };
    let error = |found: f32, due: f64| (f64::from(found) - due).abs() / U;
    Verdict::Right(Offset {
        t,
        uv: error(hit.u, right.u).max(error(hit.v, right.v)),
        is_exact: hit.t == truth.t_rounded && [hit.u, hit.v] == right.rounded && hit.prim == truth.accepted[0].prim,
        loses_zero: (hit.u == 0.0) != (right.rounded[0] == 0.0) || (hit.v == 0.0) != (right.rounded[1] == 0.0),
    })
}

#[expect(clippy::float_cmp, reason = "0 is told apart")]
fn relative(t: f64, truth: &Truth) -> f64 {
    if t == f64::from(truth.t_rounded) && truth.t == 0.0 { 0.0 } else { (t - truth.t).abs() / truth.t / U }
}

/// Answers judged, counted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Rays judged.
    pub rays: u64,
    /// Rays that meet something.
    pub hits: u64,
    /// Rays that meet several triangles at once: any of them is right.
    pub ties: u64,
    /// Hits not found.
    pub false_misses: u64,
    /// Hits found where there is none.
    pub false_hits: u64,
    /// Hits of a triangle that is not among those met first.
    pub wrong: u64,
    /// Right triangles whose t, u or v is not correctly rounded, or whose number is not the lowest.
    pub inexact: u64,
    /// Right triangles with u or v 0 where it should not be, or the reverse.
    pub lost_zeros: u64,
    /// Largest error of u or v at right triangles, in u.
    pub uv_max: f64,
    /// Errors of t at right triangles, in u, in no order.
    pub t_errors: Vec<f64>,
}

impl Tally {
    /// Counts one more answer.
    pub fn add(&mut self, truth: Option<&Truth>, found: Option<&Hit>) {
        self.rays += 1;
        self.hits += u64::from(truth.is_some());
        self.ties += u64::from(truth.is_some_and(|t| t.accepted.len() > 1));
        match judge(truth, found) {
            Verdict::Miss => {}
            Verdict::FalseMiss => self.false_misses += 1,
            Verdict::FalseHit => self.false_hits += 1,
            Verdict::WrongPrimitive(_) => self.wrong += 1,
            Verdict::Right(offset) => {
                self.inexact += u64::from(!offset.is_exact);
                self.lost_zeros += u64::from(offset.loses_zero);
                self.uv_max = self.uv_max.max(offset.uv);
                self.t_errors.push(offset.t);
            }
        }
    }

    /// Counts one more answer to whether a ray is blocked.
    pub fn add_blocked(&mut self, due: bool, found: bool) {
        self.rays += 1;
        self.hits += u64::from(due);
        self.false_misses += u64::from(due && !found);
        self.false_hits += u64::from(!due && found);
    }

    /// Answers that differ in kind: missed, false or another triangle.
    pub fn mistakes(&self) -> u64 {
        self.false_misses + self.false_hits + self.wrong
    }

    /// The errors of t that these shares of right answers stay below or at; 1 gives the largest. `None` without right answers.
    pub fn t_quantiles<const N: usize>(&self, shares: [f64; N]) -> [Option<f64>; N] {
        let mut errors = self.t_errors.clone();
        errors.sort_by(f64::total_cmp);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
        let place = |share: f64| (share * errors.len() as f64).ceil() as usize;
        shares.map(|share| errors.get(place(share).clamp(1, errors.len().max(1)) - 1).copied())
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.hits += other.hits;
        self.ties += other.ties;
        self.false_misses += other.false_misses;
        self.false_hits += other.false_hits;
        self.wrong += other.wrong;
        self.inexact += other.inexact;
        self.lost_zeros += other.lost_zeros;
        self.uv_max = self.uv_max.max(other.uv_max);
        self.t_errors.extend(other.t_errors);
    }
}

/// The range that holds the true rate of an event with 95 % confidence after `events` in `trials`; 0 to 1 without trials.
///
/// # Source
/// Wilson, "Probable inference, the law of succession, and statistical inference", 1927: the score interval, z = 1.96.
pub fn wilson(events: u64, trials: u64) -> (f64, f64) {
    const Z2: f64 = 1.96 * 1.96;
    if trials == 0 {
        return (0.0, 1.0);
    }
    let (n, k) = (trials as f64, events as f64);
    let middle = (k + Z2 / 2.0) / (n + Z2);
    let half = (Z2 * (k * (n - k) / n + Z2 / 4.0)).sqrt() / (n + Z2);
    let low = if events == 0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if events == trials { 1.0 } else { (middle + half).min(1.0) };
    (low, high)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "answers are compared bit for bit")]
mod tests {
    use super::{super::Accepted, *};
    use crate::geom::{InstanceId, PrimId};

    fn truth() -> Truth {
        let accepted = [4, 7].map(|i| Accepted { prim: PrimId(i), u: 0.5, v: 0.0, rounded: [0.5, 0.0] });
        Truth { t: 2.0, t_rounded: 2.0, accepted: accepted.to_vec() }
    }

    fn hit(prim: u32, t: f32, v: f32) -> Hit {
        Hit { t, u: 0.5, v, prim: PrimId(prim), instance: InstanceId(0) }
    }

    #[test]
    fn each_kind_of_answer_is_told_apart() {
        let truth = truth();
        assert_eq!(judge(None, None), Verdict::Miss);
        assert_eq!(judge(Some(&truth), None), Verdict::FalseMiss);
        assert_eq!(judge(None, Some(&hit(4, 2.0, 0.0))), Verdict::FalseHit);
        assert_eq!(judge(Some(&truth), Some(&hit(5, 2.0, 0.0))), Verdict::WrongPrimitive(0.0));
        let right = |prim, t, v| match judge(Some(&truth), Some(&hit(prim, t, v))) {
            Verdict::Right(offset) => offset,
            other => panic!("{other:?}"),
        };
        assert_eq!(right(4, 2.0, 0.0), Offset { t: 0.0, uv: 0.0, is_exact: true, loses_zero: false });
        assert!(!right(7, 2.0, 0.0).is_exact);
        assert_eq!(right(4, 2.0_f32.next_up(), 0.0).t, 2.0);
        let off = right(4, 2.0, 1e-9);
        assert!(off.loses_zero && !off.is_exact && off.uv > 0.01);
    }

    #[test]
    fn tallies_count_and_add_up() {
        let truth = truth();
        let mut tally = Tally::default();
        tally.add(Some(&truth), Some(&hit(4, 2.0, 0.0)));
        tally.add(Some(&truth), Some(&hit(7, 2.0_f32.next_up(), 0.0)));
        tally.add(Some(&truth), None);
        let mut other = Tally::default();
        other.add(None, Some(&hit(4, 2.0, 0.0)));
        other.add(Some(&truth), Some(&hit(9, 2.0, 0.0)));
        tally += other;
        let mut blocked = Tally::default();
        for (due, found) in [(true, true), (true, false), (false, true), (false, false)] {
            blocked.add_blocked(due, found);
        }
        assert_eq!([blocked.rays, blocked.hits, blocked.false_misses, blocked.false_hits], [4, 2, 1, 1]);
        assert_eq!([tally.rays, tally.hits, tally.ties, tally.mistakes(), tally.inexact], [5, 4, 4, 3, 1]);
        assert_eq!(tally.t_quantiles([0.0, 0.5, 0.51, 1.0]), [Some(0.0), Some(0.0), Some(2.0), Some(2.0)]);
        assert_eq!(Tally::default().t_quantiles([0.5]), [None]);
    }

    #[test]
    fn no_event_in_ten_million_bounds_the_rate_at_384_in_a_billion() {
        let (low, high) = wilson(0, 10_000_000);
        assert!(low == 0.0 && (high * 1e9 - 384.0).abs() < 1.0, "{high}");
        let (low, high) = wilson(50, 100);
        assert!((low - 0.4038).abs() < 1e-3 && (high - 0.5962).abs() < 1e-3);
        assert_eq!(wilson(0, 0), (0.0, 1.0));
        assert_eq!(wilson(7, 7).1, 1.0);
    }
}
