//! How finely a moving picture is traced so that the frame rate holds.

/// Divisors of the window's width and height that a moving picture may be traced at, finest first.
pub(super) const DIVISORS: [u32; 4] = [1, 2, 3, 4];

/// Frames in a row that must miss the budget before the picture gets coarser.
const SLOW_FRAMES: u32 = 3;
/// Frames in a row that must promise to fit with room to spare before it gets finer.
const FAST_FRAMES: u32 = 20;
/// Part of the budget that a finer picture must be predicted to keep to.
const ROOM: f64 = 0.8;
/// Weight of the newest frame in the running means.
const BLEND: f64 = 0.25;

/// Chooses a divisor from measured frame times, with hysteresis so that the picture does not flicker between two.
///
/// A frame is taken to cost a fixed part (pose, deform, refit) and a part proportional to the pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Adapt {
    level: usize,
    fixed_s: f64,
    full_trace_s: f64,
    measured: bool,
    slow: u32,
    fast: u32,
}

impl Default for Adapt {
    fn default() -> Self {
        // Coarse until the first measurement, which then says what fits.
        Self { level: DIVISORS.len() - 1, fixed_s: 0.0, full_trace_s: 0.0, measured: false, slow: 0, fast: 0 }
    }
}

impl Adapt {
    /// The divisor of width and height in force.
    pub(super) fn divisor(&self) -> u32 {
        DIVISORS[self.level]
    }

    fn predicted_s(&self, level: usize) -> f64 {
        let divisor = f64::from(DIVISORS[level]);
        self.fixed_s + self.full_trace_s / (divisor * divisor)
    }

    /// Takes in a frame traced at `divisor`: seconds before tracing, seconds of tracing, and the seconds that a frame
    /// may take.
    pub(super) fn record(&mut self, divisor: u32, fixed_s: f64, trace_s: f64, budget_s: f64) {
        let full_s = trace_s * f64::from(divisor) * f64::from(divisor);
        if self.measured {
            self.fixed_s += BLEND * (fixed_s - self.fixed_s);
            self.full_trace_s += BLEND * (full_s - self.full_trace_s);
        } else {
            (self.fixed_s, self.full_trace_s, self.measured) = (fixed_s, full_s, true);
            let fits = |&level: &usize| self.predicted_s(level) < ROOM * budget_s;
            self.change((0..DIVISORS.len()).find(fits).unwrap_or(DIVISORS.len() - 1));
            return;
        }
        let over = fixed_s + trace_s > budget_s && self.predicted_s(self.level) > budget_s;
        self.slow = if over { self.slow + 1 } else { 0 };
        let finer_fits = self.level > 0 && self.predicted_s(self.level - 1) < ROOM * budget_s;
        self.fast = if finer_fits { self.fast + 1 } else { 0 };
        if self.slow >= SLOW_FRAMES && self.level + 1 < DIVISORS.len() {
            self.change(self.level + 1);
        } else if self.fast >= FAST_FRAMES {
            self.change(self.level - 1);
        }
    }

    fn change(&mut self, level: usize) {
        (self.level, self.slow, self.fast) = (level, 0, 0);
    }

    /// Forgets what was measured: another scene, structure or kind of picture. The next frame is coarse.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

/// Size of the picture traced for a window of `width` x `height` at `divisor`; at least one pixel.
pub(super) fn traced_size(width: u32, height: u32, divisor: u32) -> (u32, u32) {
    (width.div_ceil(divisor).max(1), height.div_ceil(divisor).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUDGET: f64 = 1.0 / 30.0;

    /// Plays `frames` frames of a scene that takes `full_s` to trace at full size.
    fn play(adapt: &mut Adapt, frames: usize, fixed_s: f64, full_s: f64) -> Vec<u32> {
        (0..frames)
            .map(|_| {
                let divisor = adapt.divisor();
                adapt.record(divisor, fixed_s, full_s / f64::from(divisor * divisor), BUDGET);
                adapt.divisor()
            })
            .collect()
    }

    #[test]
    fn fast_scene_reaches_full_resolution_and_stays() {
        let mut adapt = Adapt::default();
        assert_eq!(*play(&mut adapt, 100, 0.001, 0.015).last().unwrap(), 1);
    }

    #[test]
    fn slow_scene_ends_at_the_coarsest_and_stays() {
        let mut adapt = Adapt::default();
        assert_eq!(*play(&mut adapt, 100, 0.001, 5.0).last().unwrap(), 4);
    }

    #[test]
    fn steady_load_settles_on_one_divisor_that_fits() {
        for full_ms in 1..400 {
            let mut adapt = Adapt::default();
            let full_s = f64::from(full_ms) * 1e-3;
            let seen = play(&mut adapt, 300, 0.002, full_s);
            assert!(seen[200..].windows(2).all(|w| w[0] == w[1]), "flickers at {full_ms} ms");
            let divisor = f64::from(seen[299]);
            assert!(divisor > 3.5 || 0.002 + full_s / (divisor * divisor) <= BUDGET, "misses at {full_ms} ms");
        }
    }

    #[test]
    fn first_frame_is_coarse_and_its_time_chooses_the_next() {
        let mut adapt = Adapt::default();
        assert_eq!(adapt.divisor(), 4);
        assert_eq!(play(&mut adapt, 1, 0.001, 0.015), [1]);
        adapt.forget();
        assert_eq!(adapt.divisor(), 4);
        assert_eq!(play(&mut adapt, 1, 0.001, 0.080), [2]);
    }

    #[test]
    fn one_slow_frame_changes_nothing() {
        let mut adapt = Adapt::default();
        play(&mut adapt, 100, 0.001, 0.015);
        adapt.record(1, 0.001, 0.2, BUDGET);
        assert_eq!(*play(&mut adapt, 5, 0.001, 0.015).last().unwrap(), 1);
    }

    #[test]
    fn traced_size_is_never_empty() {
        assert_eq!(traced_size(1280, 720, 3), (427, 240));
        assert_eq!(traced_size(1, 1, 4), (1, 1));
    }
}
