//! What a run did, as JSON and as a line.

use std::time::{Duration, Instant};

use kinora::dynamics::{LoopCounts, StageTimes};
use serde::Serialize;

use super::plan::Plan;
use crate::cli::settings::Settings;

/// Times of every frame by stage, in milliseconds.
#[derive(Debug, Default)]
pub(super) struct Stages {
    pose: Vec<f64>,
    deform: Vec<f64>,
    refit: Vec<f64>,
    trace: Vec<f64>,
    encode: Vec<f64>,
    frame: Vec<f64>,
    rays: u64,
}

impl Stages {
    /// Adds a traced frame; `whole` is all but encoding.
    pub(super) fn frame(&mut self, times: StageTimes, trace: Duration, whole: Duration, rays: u64) {
        self.pose.push(ms(times.pose));
        self.deform.push(ms(times.deform));
        self.refit.push(ms(times.refit));
        self.trace.push(ms(trace));
        self.frame.push(ms(whole));
        self.rays += rays;
    }

    /// Adds a written frame.
    pub(super) fn encode(&mut self, time: Duration) {
        self.encode.push(ms(time));
    }

    fn each(&mut self, of: impl Fn(&mut [f64]) -> f64) -> PerStage {
        PerStage {
            pose: of(&mut self.pose),
            deform: of(&mut self.deform),
            refit: of(&mut self.refit),
            trace: of(&mut self.trace),
            encode: of(&mut self.encode),
            frame: of(&mut self.frame),
        }
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// One number a stage, in milliseconds.
#[derive(Debug, Default, Serialize)]
struct PerStage {
    pose: f64,
    deform: f64,
    refit: f64,
    trace: f64,
    encode: f64,
    frame: f64,
}

/// The `--json` object.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    frames: usize,
    skipped: usize,
    size: [u32; 2],
    samples: u32,
    accel: String,
    rays: u64,
    mrays_per_s: f64,
    median_ms: PerStage,
    p99_ms: PerStage,
    swaps: u64,
    rebuilds_dropped: u64,
    quality_max: f64,
    #[serde(skip)]
    begun: Instant,
}

impl Summary {
    /// Of a run that renders `frames` of the plan's; the others are skipped.
    pub(super) fn new(plan: &Plan, frames: usize, settings: &Settings) -> Self {
        Self {
            frames,
            skipped: plan.frames.len() - frames,
            size: [plan.size.0, plan.size.1],
            samples: plan.samples,
            accel: settings.accel.clone(),
            rays: 0,
            mrays_per_s: 0.0,
            median_ms: PerStage::default(),
            p99_ms: PerStage::default(),
            swaps: 0,
            rebuilds_dropped: 0,
            quality_max: 0.0,
            begun: Instant::now(),
        }
    }

    /// Adds what was measured.
    pub(super) fn add(&mut self, mut stages: Stages, counts: LoopCounts) {
        let trace_s = stages.trace.iter().sum::<f64>() / 1e3;
        self.rays = stages.rays;
        self.mrays_per_s = if trace_s > 0.0 { stages.rays as f64 / trace_s / 1e6 } else { 0.0 };
        self.median_ms = stages.each(|times| quantile(times, 0.5));
        self.p99_ms = stages.each(|times| quantile(times, 0.99));
        self.swaps = counts.swaps;
        self.rebuilds_dropped = counts.rebuilds_dropped;
        self.quality_max = counts.quality_max;
    }

    /// The gist in one line.
    pub(super) fn line(&self) -> String {
        let Self { frames, skipped, rays, mrays_per_s, median_ms, .. } = self;
        let kept = if *skipped > 0 { format!(", {skipped} kept") } else { String::new() };
        if *frames == 0 {
            return format!("nothing to render{kept}");
        }
        format!(
            "{frames} frames{kept} in {:.1} s; median {:.1} ms a frame and {:.1} ms to encode; {:.1} M rays at {mrays_per_s:.1} M/s",
            self.begun.elapsed().as_secs_f64(),
            median_ms.frame,
            median_ms.encode,
            *rays as f64 / 1e6,
        )
    }
}

/// The least value that a share `q` of the values do not exceed; the mean of the middle two for an even number's
/// median; 0 without values.
fn quantile(values: &mut [f64], q: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    let n = values.len();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 < q <= 1, n is a length")]
    let rank = ((q * n as f64).ceil() as usize).clamp(1, n);
    let middle = n.is_multiple_of(2) && rank == n / 2;
    if middle { f64::midpoint(values[rank - 1], values[rank]) } else { values[rank - 1] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_ranks_and_the_median_is_central() {
        assert!((quantile(&mut [], 0.5)).abs() < 1e-12);
        assert!((quantile(&mut [3.0], 0.99) - 3.0).abs() < 1e-12);
        assert!((quantile(&mut [3.0, 1.0, 2.0], 0.5) - 2.0).abs() < 1e-12);
        assert!((quantile(&mut [4.0, 1.0, 2.0, 3.0], 0.5) - 2.5).abs() < 1e-12);
        let mut hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert!((quantile(&mut hundred, 0.99) - 99.0).abs() < 1e-12);
    }
}
