//! What time the clip shows: play, pause, step, scrub and speed on a looping clock.

use crate::anim::loop_time;

/// Frames a second of the grid that stepping follows: the default rate of `kinora render`, so that a step
/// lands on one of its frames.
pub(super) const STEP_RATE: f64 = 30.0;

/// Speeds that the keys walk through; any other can be given at the start.
const SPEEDS: [f64; 16] = [-4.0, -2.0, -1.5, -1.0, -0.75, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0];

/// Maps the wall clock to a time within the clip, without drift however long it runs.
///
/// Wall times (`now_s`) are seconds on any steady clock; they only need to be the same one in every call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlayClock {
    start_s: f64,
    anchor_s: f64,
    speed: f64,
    duration_s: f64,
    paused: bool,
}

impl PlayClock {
    /// A clock at time 0, running at `speed` clip seconds a second over a clip of `duration_s` seconds.
    pub(super) fn new(now_s: f64, duration_s: f64, speed: f64) -> Self {
        Self { start_s: 0.0, anchor_s: now_s, speed, duration_s, paused: false }
    }

    /// Clip time in seconds. While it runs it is in `[0, duration)`; while paused it is the time held, which
    /// may be any.
    pub(super) fn time_s(&self, now_s: f64) -> f64 {
        if self.paused {
            self.start_s
        } else {
            loop_time(self.start_s, now_s - self.anchor_s, self.speed, self.duration_s)
        }
    }

    /// True when time stands still.
    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// True when the picture changes with the wall clock.
    pub(super) fn is_running(&self) -> bool {
        !self.paused && self.duration_s > 0.0 && self.speed != 0.0
    }

    /// Clip seconds a second; negative plays backwards.
    pub(super) fn speed(&self) -> f64 {
        self.speed
    }

    /// Length of the loop in seconds.
    pub(super) fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn rebase(&mut self, now_s: f64) {
        self.start_s = self.time_s(now_s);
        self.anchor_s = now_s;
    }

    /// Pauses or goes on from the time held.
    pub(super) fn set_paused(&mut self, now_s: f64, paused: bool) {
        self.rebase(now_s);
        self.paused = paused;
    }

    /// Stops at `time_s`, unclamped: past the clip's end the last pose holds.
    pub(super) fn hold(&mut self, now_s: f64, time_s: f64) {
        *self = Self { start_s: time_s, anchor_s: now_s, paused: true, ..*self };
    }

    /// Goes to `time_s` without pausing or resuming.
    pub(super) fn seek(&mut self, now_s: f64, time_s: f64) {
        *self = Self { start_s: time_s, anchor_s: now_s, ..*self };
    }

    /// Pauses and goes `frames` steps of `1 / STEP_RATE` along the grid of steps, round the loop's ends.
    pub(super) fn step(&mut self, now_s: f64, frames: i32) {
        let at = self.time_s(now_s) * STEP_RATE;
        // A time within a millionth of a frame of the grid counts as on it.
        let from = if frames > 0 { libm::floor(at + 1e-6) } else { libm::ceil(at - 1e-6) };
        let last = libm::floor(self.duration_s * STEP_RATE + 1e-6);
        let mut frame = from + f64::from(frames);
        if frame < 0.0 {
            frame = last;
        } else if frame > last {
            frame = 0.0;
        }
        self.hold(now_s, frame / STEP_RATE);
    }

    /// Sets the speed, keeping the time.
    pub(super) fn set_speed(&mut self, now_s: f64, speed: f64) {
        self.rebase(now_s);
        self.speed = speed;
    }

    /// The next speed up (`direction > 0`) or down of a fixed ladder from -4 to 4 that leaves out 0.
    pub(super) fn change_speed(&mut self, now_s: f64, direction: i32) {
        let next = if direction > 0 {
            SPEEDS.into_iter().find(|&s| s > self.speed)
        } else {
            SPEEDS.into_iter().rev().find(|&s| s < self.speed)
        };
        if let Some(speed) = next {
            self.set_speed(now_s, speed);
        }
    }

    /// Lets the time so far count from `now_s` on, as if nothing had run before.
    pub(super) fn restart_wall(&mut self, now_s: f64) {
        self.anchor_s = now_s;
    }

    /// Starts another clip at its beginning (its end when playing backwards), paused or not as before.
    pub(super) fn restart(&mut self, now_s: f64, duration_s: f64) {
        let start_s = if self.speed < 0.0 { duration_s } else { 0.0 };
        *self = Self { start_s, anchor_s: now_s, duration_s, ..*self };
    }
}

/// Number of the frame of `kinora render` (at its default rate) nearest to a time: what its noise is seeded
/// with.
pub(super) fn frame_number(time_s: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, and NaN becomes 0")]
    let frame = libm::round(time_s * STEP_RATE) as u64;
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_loops_and_keeps_time_across_speed_changes() {
        let mut clock = PlayClock::new(100.0, 2.0, 1.0);
        assert!((clock.time_s(101.5) - 1.5).abs() < 1e-12);
        assert!((clock.time_s(102.5) - 0.5).abs() < 1e-12);
        clock.set_speed(102.5, -0.5);
        assert!((clock.time_s(102.5) - 0.5).abs() < 1e-12);
        assert!((clock.time_s(104.5) - 1.5).abs() < 1e-12, "half a second back, then round");
    }

    #[test]
    fn clock_does_not_drift_in_a_million_seconds() {
        let clock = PlayClock::new(0.0, 0.7, 1.0);
        let loops = 1_428_571.0;
        assert!((clock.time_s(loops * 0.7 + 0.25) - 0.25).abs() < 1e-6);
    }

    #[test]
    fn pause_holds_the_time_and_resume_goes_on_from_it() {
        let mut clock = PlayClock::new(0.0, 2.0, 1.0);
        clock.set_paused(1.25, true);
        assert!((clock.time_s(50.0) - 1.25).abs() < 1e-12);
        assert!(!clock.is_running());
        clock.set_paused(60.0, false);
        assert!((clock.time_s(60.5) - 1.75).abs() < 1e-12);
    }

    #[test]
    fn held_time_may_lie_past_the_end() {
        let mut clock = PlayClock::new(0.0, 2.0, 1.0);
        clock.hold(0.0, 2.0);
        assert_eq!(clock.time_s(9.0).to_bits(), 2.0f64.to_bits());
    }

    #[test]
    fn steps_follow_the_render_frames_and_go_round() {
        let mut clock = PlayClock::new(0.0, 1.0, 1.0);
        clock.set_paused(0.51, true);
        clock.step(0.51, 1);
        assert_eq!(frame_number(clock.time_s(1.0)), 16);
        clock.step(1.0, -1);
        clock.step(1.0, -1);
        assert_eq!(clock.time_s(1.0).to_bits(), (14.0f64 / 30.0).to_bits());
        clock.hold(2.0, 1.0);
        clock.step(2.0, 1);
        assert_eq!(frame_number(clock.time_s(2.0)), 0);
        clock.step(2.0, -1);
        assert_eq!(frame_number(clock.time_s(2.0)), 30);
    }

    #[test]
    fn speed_ladder_passes_through_negative_speeds_without_zero() {
        let mut clock = PlayClock::new(0.0, 1.0, 1.0);
        let mut seen = vec![];
        for _ in 0..30 {
            clock.change_speed(0.0, -1);
            seen.push(clock.speed());
        }
        assert!(seen.contains(&-1.0) && !seen.contains(&0.0));
        assert!((clock.speed() + 4.0).abs() < 1e-12);
    }

    #[test]
    fn clip_without_length_stands_at_its_start() {
        let clock = PlayClock::new(0.0, 0.0, 1.0);
        assert_eq!(clock.time_s(10.0).to_bits(), 0.0f64.to_bits());
        assert!(!clock.is_running());
    }

    #[test]
    fn backward_restart_begins_at_the_end() {
        let mut clock = PlayClock::new(0.0, 1.0, -1.0);
        clock.restart(5.0, 2.0);
        assert!((clock.time_s(5.5) - 1.5).abs() < 1e-12);
    }
}
