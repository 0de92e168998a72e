//! One policy over one play.

use std::time::{Duration, Instant};

use super::{Options, play::Play, shots::Shots};
use crate::{
    anim::ActiveClip,
    dynamics::{FrameState, LoopCounts, RebuildPolicy, StageTimes},
    report::{Monitor, ReportError, measure::Samples},
};

/// Times that the rays of a frame are cast; the median counts. It is by all of them that a background builder has time for a frame: on large scenes about as long
/// as a picture of 1280x720 takes two threads, which leave it no core of its own as this one does.
const RUNS: usize = 5;

/// No more than three times are begun after so long: trees that decayed would take minutes.
const ENOUGH: Duration = Duration::from_millis(200);

/// A frame under a policy; times in seconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) times: StageTimes,
    pub(super) state: FrameState,
    /// Wall time of making the frame: all but tracing.
    pub(super) made_s: f64,
    /// Processor time of casting the rays once by one thread: the median of several times.
    pub(super) trace_s: f64,
    /// Tells answers apart.
    pub(super) digest: u64,
}

/// All frames of a policy.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) policy: RebuildPolicy,
    pub(super) frames: Vec<Frame>,
    pub(super) counts: LoopCounts,
    /// Rays cast over all frames, once each.
    pub(super) rays: usize,
    /// Trees learnt of clips beforehand, and the seconds it took.
    pub(super) trees: usize,
    pub(super) learning_s: f64,
}

/// Plays all frames under `policy`.
///
/// # Errors
/// When `monitor` ends it or a frame cannot be made.
pub(super) fn run(
    play: &Play,
    policy: RebuildPolicy,
    shots: &mut Shots,
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Run, ReportError> {
    let mut frames = play.begin(options.config(policy))?;
    let mut out = Run { policy, frames: Vec::new(), counts: frames.counts(), rays: 0, trees: 0, learning_s: 0.0 };
    if policy == RebuildPolicy::Auto {
        monitor.begin(&format!("{}: {policy}: learning the clips", play.name))?;
        let began = Instant::now();
        for (actor, clip) in (0..).zip(play.clips(0)) {
            out.trees += frames.learn(actor, clip.map(|c| c.clip).as_slice())?;
        }
        out.learning_s = began.elapsed().as_secs_f64();
    }
    for frame in 0..play.frames {
        if frame % 16 == 0 {
            monitor.begin(&format!("{}: {policy}: frame {frame} of {}", play.name, play.frames))?;
        }
        let clips = play.clips(frame);
        let clips: Vec<&[ActiveClip]> = clips.iter().map(Option::as_slice).collect();
        let began = Instant::now();
        let (world, times) = frames.advance(&clips)?;
        let made_s = began.elapsed().as_secs_f64();
        let mut trace = Samples::default();
        let began = Instant::now();
        for repeat in 0..options.runs() {
            if repeat < 3 || began.elapsed() < ENOUGH {
                trace.push(shots.cast(&world).map_err(crate::dynamics::FrameError::from)?);
            }
        }
        let trace_s = trace.median().unwrap_or(0.0);
        out.rays += shots.count();
        out.frames.push(Frame { times, state: frames.last_frame(), made_s, trace_s, digest: shots.digest() });
    }
    out.counts = frames.counts();
    Ok(out)
}

impl Options {
    fn runs(&self) -> usize {
        if self.quick { 3 } else { RUNS }
    }
}

impl Run {
    /// One number of every frame.
    pub(super) fn each<'a>(&'a self, of: impl Fn(&Frame) -> f64 + 'a) -> Series {
        Series(self.frames.iter().map(of).collect())
    }

    /// Each frame's trace time over that of the same frame under `fresh`.
    pub(super) fn against(&self, fresh: &Self) -> Series {
        Series(self.frames.iter().zip(&fresh.frames).map(|(a, b)| a.trace_s / b.trace_s).collect())
    }

    /// Frames whose answers differ from those of another run.
    pub(super) fn differences(&self, other: &Self) -> usize {
        self.frames.iter().zip(&other.frames).filter(|(a, b)| a.digest != b.digest).count()
    }
}

/// One number a frame.
#[derive(Clone, Debug)]
pub(super) struct Series(pub(super) Vec<f64>);

impl Series {
    /// The least value that a share `q` of the frames do not exceed; `None` without frames.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a list")]
    pub(super) fn quantile(&self, q: f64) -> Option<f64> {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let rank = libm::ceil(q * sorted.len() as f64) as usize;
        sorted.get(rank.max(1) - 1).copied()
    }

    /// The middle value.
    pub(super) fn median(&self) -> Option<f64> {
        self.quantile(0.5)
    }

    /// The greatest value.
    pub(super) fn most(&self) -> Option<f64> {
        self.quantile(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occur() {
        let series = Series((1..=200).rev().map(f64::from).collect());
        assert_eq!([0.5, 0.99, 1.0].map(|q| series.quantile(q)), [Some(100.0), Some(198.0), Some(200.0)]);
        assert_eq!(Series(vec![]).median(), None);
        assert_eq!(Series(vec![7.0]).quantile(0.01), Some(7.0));
    }
}
