//! Which way to collect pairs: by what each cost when it was last tried in such motion.

use std::time::Duration;

use super::BroadMethod;

/// What a way cost, and in what motion.
#[derive(Clone, Copy, Debug)]
struct Cost {
    seconds: f64,
    motion: f32,
    /// What all ways cost since.
    since: f64,
}

/// Costs so far.
#[derive(Debug, Default)]
pub(super) struct Choice {
    /// Of a build for boxes that stay for a while, and of one for a single frame.
    rebuild: [Option<Cost>; 2],
    /// Of the first refit after a build.
    first_refit: Option<Cost>,
    last_refit: Option<Cost>,
    resort: Option<Cost>,
    /// Refits since the last build.
    refits: u32,
    /// What refits since the build cost beyond the first.
    excess: f64,
}

/// A cost measured in motion this many times as wide, or as narrow, says little.
const ALIKE: f32 = 2.0;

/// Share of the time that may be lost with ways that were dearer when last tried: measured times are off now and then.
const TRIALS: f64 = 0.02;

impl Choice {
    /// Forgets everything but what the build that was just made cost.
    pub(super) fn begin(&mut self, wild: bool, spent: Duration) {
        *self = Self::default();
        self.note(BroadMethod::Rebuild, wild, 0.0, spent);
    }

    /// The way expected to be cheapest; ways that were never tried in such motion come first. Where motion is `wild`, a tree serves one frame.
    pub(super) fn next(&self, motion: f32, wild: bool) -> BroadMethod {
        let calmer = |cost: &Cost| motion * ALIKE < cost.motion;
        let known = |cost: &Option<Cost>| cost.filter(|c| !calmer(c));
        let refit = if self.refits == 0 { known(&self.first_refit) } else { known(&self.last_refit) };
        let Some(refit) = refit else { return BroadMethod::Refit };
        let Some(rebuild) = self.rebuild[usize::from(wild)].map(|c| c.seconds) else { return BroadMethod::Rebuild };
        // Lists share the tree's shape, so they are tried while that is good.
        let Some(resort) = known(&self.resort) else { return BroadMethod::Resort };
        let base = self.first_refit.map_or(refit.seconds, |c| c.seconds);
        let best = rebuild.min(refit.seconds).min(resort.seconds);
        let forgiven = |cost: &Cost| cost.seconds > best && cost.seconds - best < cost.since * TRIALS;
        if forgiven(&resort) {
            BroadMethod::Resort
        } else if forgiven(&refit) {
            BroadMethod::Refit
        } else if best >= rebuild || self.excess > rebuild - base.min(rebuild) {
            BroadMethod::Rebuild
        } else if resort.seconds < refit.seconds {
            BroadMethod::Resort
        } else {
            BroadMethod::Refit
        }
    }

    /// What a way cost.
    pub(super) fn note(&mut self, method: BroadMethod, wild: bool, motion: f32, spent: Duration) {
        let seconds = spent.as_secs_f64();
        for cost in [&mut self.first_refit, &mut self.last_refit, &mut self.resort].into_iter().flatten() {
            cost.since += seconds;
        }
        let cost = Cost { seconds, motion, since: 0.0 };
        match method {
            BroadMethod::Keep => {}
            BroadMethod::Rebuild => {
                self.rebuild[usize::from(wild)] = Some(cost);
                self.refits = 0;
                self.excess = 0.0;
            }
            BroadMethod::Refit => {
                if self.refits == 0 {
                    self.first_refit = Some(cost);
                }
                self.last_refit = Some(cost);
                self.refits += 1;
                self.excess += (seconds - self.first_refit.map_or(seconds, |c| c.seconds)).max(0.0);
            }
            BroadMethod::Resort => {
                self.resort = Some(cost);
                self.refits += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn millis(ms: f64) -> Duration {
        Duration::from_secs_f64(ms * 1e-3)
    }

    /// Plays frames whose ways cost what `cost` says; how often each was taken in the last half.
    fn play(frames: u32, motion: f32, cost: impl Fn(BroadMethod, u32, u32) -> f64) -> [u32; 4] {
        let mut choice = Choice::default();
        let mut taken = [0; 4];
        for frame in 0..frames {
            let method = choice.next(motion, false);
            choice.note(method, false, motion, millis(cost(method, frame, choice.refits)));
            taken[method as usize] += u32::from(frame * 2 >= frames);
        }
        taken
    }

    #[test]
    fn wild_motion_ends_in_builds_and_calm_motion_in_refits() {
        let wild = |method, _, _| match method {
            BroadMethod::Rebuild => 3.0,
            BroadMethod::Refit => 12.0,
            _ => 9.0,
        };
        assert_eq!(play(100, 1.0, wild), [0, 0, 0, 50]);
        let calm = |method, _, refits| match method {
            BroadMethod::Rebuild => 3.0,
            BroadMethod::Refit => 1.0 + 0.01 * f64::from(refits),
            _ => 2.0,
        };
        let taken = play(100, 0.01, calm);
        assert!(taken[BroadMethod::Refit as usize] >= 45 && taken[BroadMethod::Rebuild as usize] >= 1, "{taken:?}");
    }

    #[test]
    fn motion_that_calms_down_is_tried_anew() {
        let mut choice = Choice::default();
        for (method, ms) in [(BroadMethod::Refit, 12.0), (BroadMethod::Rebuild, 3.0), (BroadMethod::Refit, 11.0)] {
            choice.note(method, true, 1.0, millis(ms));
        }
        choice.note(BroadMethod::Resort, true, 1.0, millis(9.0));
        assert_eq!(choice.next(1.0, true), BroadMethod::Rebuild);
        assert_eq!(choice.next(0.1, true), BroadMethod::Refit);
    }

    #[test]
    fn the_cheaper_of_lists_and_tree_is_taken_after_a_few_frames() {
        for cheap in [BroadMethod::Resort, BroadMethod::Refit] {
            let cost = |method, _, _| match method {
                BroadMethod::Rebuild => 9.0,
                method if method == cheap => 1.0,
                _ => 1.3,
            };
            assert!(play(20, 0.01, cost)[cheap as usize] >= 8, "{cheap:?}");
            // Dear once by accident.
            let unlucky = |method, frame, _| match method {
                method if method == cheap && frame < 4 => 3.0,
                method => cost(method, frame, 0),
            };
            assert!(play(400, 0.01, unlucky)[cheap as usize] >= 180, "{cheap:?}");
        }
    }
}
