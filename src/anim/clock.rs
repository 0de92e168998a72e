//! Wall time to a clip's time.

/// The clip time after `elapsed_s` seconds of play at `speed` from `start_s`, looping over `[0, duration_s)`.
///
/// Computed from the whole elapsed time at once, so nothing accumulates: after 10^6 s the phase is within a
/// nanosecond times the speed. Negative speeds play backwards. A duration that is not positive and finite, or
/// a time that is not finite, gives 0.
pub fn loop_time(start_s: f64, elapsed_s: f64, speed: f64, duration_s: f64) -> f64 {
    let time = start_s + elapsed_s * speed;
    if !(duration_s > 0.0 && duration_s.is_finite() && time.is_finite()) {
        return 0.0;
    }
    let rest = libm::fmod(time, duration_s);
    let phase = if rest < 0.0 { rest + duration_s } else { rest };
    // A tiny negative rest rounds up to the duration itself, which is the start of the next round.
    if phase >= duration_s { 0.0 } else { phase + 0.0 }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these are exact")]
mod tests {
    use super::*;

    #[test]
    fn phase_is_exact_after_a_million_seconds() {
        let duration = 1.25;
        for speed in [1.0, -1.0, 0.5, 2.0] {
            let elapsed = 1_000_000.3;
            let direct = loop_time(0.5, elapsed, speed, duration);
            let short = loop_time(0.5, elapsed - 800_000.0 * duration, speed, duration);
            assert!((direct - short).abs() < 1e-6, "{direct} {short}");
        }
    }

    #[test]
    fn backwards_play_wraps_below_zero() {
        assert_eq!(loop_time(0.0, 0.25, -1.0, 1.0), 0.75);
        assert_eq!(loop_time(0.0, 1e-30, -1.0, 1.0), 0.0);
    }

    #[test]
    fn end_is_the_start_of_the_next_round() {
        assert_eq!(loop_time(0.0, 2.0, 1.0, 2.0), 0.0);
        assert_eq!(loop_time(2.0, 0.0, 1.0, 2.0), 0.0);
    }

    #[test]
    fn clips_without_length_and_times_without_value_stay_at_the_start() {
        for (elapsed, duration) in [(1.0, 0.0), (1.0, -1.0), (1.0, f64::NAN), (1.0, f64::INFINITY), (f64::NAN, 1.0)] {
            assert_eq!(loop_time(0.0, elapsed, 1.0, duration), 0.0);
        }
    }
}
