//! Which way to collect pairs: by what each cost when it was last tried in such motion.

use std::time::Duration;

use super::BroadMethod;

/// What a way cost, and in what motion.
#[derive(Clone, Copy, Debug)]
struct Cost {
    seconds: f64,
    motion: f32,
}

/// Costs so far.
#[derive(Debug, Default)]
pub(super) struct Choice {
    rebuild: Option<Cost>,
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

impl Choice {
    /// Forgets all but that a tree was just built.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The way expected to be cheapest; ways that were never tried in such motion come first.
    pub(super) fn next(&self, motion: f32) -> BroadMethod {
        let calmer = |cost: &Cost| motion * ALIKE < cost.motion;
        let known = |cost: &Option<Cost>| cost.filter(|c| !calmer(c)).map(|c| c.seconds);
        let refit = if self.refits == 0 { known(&self.first_refit) } else { known(&self.last_refit) };
        let Some(refit) = refit else { return BroadMethod::Refit };
        let Some(rebuild) = self.rebuild.map(|c| c.seconds) else { return BroadMethod::Rebuild };
        // Lists share the tree's shape, so they are tried while that is good.
        let Some(resort) = known(&self.resort) else { return BroadMethod::Resort };
        let base = self.first_refit.map_or(refit, |c| c.seconds);
        if rebuild < refit.min(resort) || self.excess > rebuild - base.min(rebuild) {
            BroadMethod::Rebuild
        } else if resort < refit {
            BroadMethod::Resort
        } else {
            BroadMethod::Refit
        }
    }

    /// What a way cost.
    pub(super) fn note(&mut self, method: BroadMethod, motion: f32, spent: Duration) {
        let cost = Cost { seconds: spent.as_secs_f64(), motion };
        match method {
            BroadMethod::Keep => {}
            BroadMethod::Rebuild => {
                self.rebuild = Some(cost);
                self.refits = 0;
                self.excess = 0.0;
            }
            BroadMethod::Refit => {
                if self.refits == 0 {
                    self.first_refit = Some(cost);
                }
                self.last_refit = Some(cost);
                self.refits += 1;
                self.excess += (cost.seconds - self.first_refit.map_or(cost.seconds, |c| c.seconds)).max(0.0);
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
    fn play(frames: u32, motion: f32, cost: impl Fn(BroadMethod, u32) -> f64) -> [u32; 4] {
        let mut choice = Choice::default();
        let mut taken = [0; 4];
        for frame in 0..frames {
            let method = choice.next(motion);
            choice.note(method, motion, millis(cost(method, choice.refits)));
            taken[method as usize] += u32::from(frame * 2 >= frames);
        }
        taken
    }

    #[test]
    fn wild_motion_ends_in_builds_and_calm_motion_in_refits() {
        let wild = |method, _| match method {
            BroadMethod::Rebuild => 3.0,
            BroadMethod::Refit => 12.0,
            _ => 9.0,
        };
        assert_eq!(play(100, 1.0, wild), [0, 0, 0, 50]);
        let calm = |method, refits| match method {
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
            choice.note(method, 1.0, millis(ms));
        }
        choice.note(BroadMethod::Resort, 1.0, millis(9.0));
        assert_eq!(choice.next(1.0), BroadMethod::Rebuild);
        assert_eq!(choice.next(0.1), BroadMethod::Refit);
    }
}
