//! Every policy of the frame loop, frame by frame: what each stage takes, how good trees are, how old, and what rays cost by it.
//!
//! Policies play one after the other: a background builder has as much time as the frames of its own policy give it. Rays are cast by one
//! thread and timed by its processor time, so that the builder's thread, and other programs, do not count; the answers of all policies are
//! compared by a digest of every bit.

mod checks;
mod made;
mod play;
mod plots;
mod refits;
mod run;
mod shots;
mod sorts;
mod tables;

use std::sync::Arc;

pub use play::Play;

use super::{Kind, Monitor, Report, ReportError, Settings};
use crate::{
    dynamics::{FrameConfig, RebuildPolicy},
    geom::Forms,
    simd::SimdLevel,
};
use refits::Bandwidth;
use shots::Shots;
use tables::Played;

/// Frames of a quick run over scenes that were asked for.
const QUICK_FRAMES: u32 = 40;

/// What to measure, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Fewer scenes, frames and rays: under a minute on two cores.
    pub quick: bool,
    /// Level of the kernels.
    pub simd: SimdLevel,
    /// Structure over triangles, as [`FrameConfig::accel`].
    pub accel: String,
    /// Structure over groups.
    pub top: String,
    /// Policies, in order.
    pub policies: Vec<RebuildPolicy>,
    /// Pool of the frame loops.
    pub pool: Arc<rayon::ThreadPool>,
}

impl Options {
    /// The policies compared when none are named.
    pub const POLICIES: [RebuildPolicy; 4] =
        [RebuildPolicy::Rebuild, RebuildPolicy::Refit, RebuildPolicy::Async, RebuildPolicy::Auto];

    fn config(&self, policy: RebuildPolicy) -> FrameConfig {
        FrameConfig {
            accel: self.accel.clone(),
            top: self.top.clone(),
            policy,
            forms: Forms::EXACT,
            pool: self.pool.clone(),
        }
    }

    /// Pixels of the picture.
    fn size(&self) -> [usize; 2] {
        if self.quick { [96, 64] } else { [256, 160] }
    }
}

/// Measures `plays`, or [`Play::defaults`] and the sorting of event lists when there are none, from a thread of the current rayon pool.
///
/// # Errors
/// When `monitor` ends it, a scene does not load or a frame cannot be made.
pub fn report(plays: &[Play], options: &Options, monitor: &mut dyn Monitor) -> Result<Report, ReportError> {
    let settings = Settings {
        quick: options.quick,
        threads: options.pool.current_num_threads(),
        simd: options.simd.name(),
        precision: "exact",
        scenes: plays.iter().map(|p| p.name.clone()).collect(),
        structures: vec![options.accel.clone(), options.top.clone()],
    };
    let mut report = Report::new(Kind::Frames, settings);
    let asked = !plays.is_empty();
    let plays = match plays {
        [] => Play::defaults(options.quick)?,
        given if options.quick => given.iter().map(|play| play.clone().shortened(QUICK_FRAMES)).collect(),
        given => given.to_vec(),
    };
    let bandwidth = Bandwidth::measure(options.quick);
    let (mut played, mut refits) = (Vec::new(), Vec::new());
    for play in &plays {
        let Some(mut shots) =
            Shots::new(play.reach(&options.config(RebuildPolicy::Refit))?, options.size(), options.simd)
        else {
            continue;
        };
        let mut runs = Vec::new();
        for &policy in &options.policies {
            runs.push(run::run(play, policy, &mut shots, options, monitor)?);
        }
        let done = Played { scene: play.name.clone(), triangles: play.triangles(), runs };
        report.plots.extend(plots::plots(&done));
        played.push(done);
        refits.extend(refits::measure(play, bandwidth, options, monitor)?);
    }
    let sorts = if asked { Vec::new() } else { sorts::measure(options.quick, monitor)? };
    report.checks = checks::checks(&played, &refits);
    report.tables = vec![tables::summary(&played), tables::refits(&refits, bandwidth), sorts::table(&sorts)];
    report.tables.push(tables::frames(&played));
    if !sorts.is_empty() {
        report.checks.extend(sorts::checks(&sorts));
        report.plots.push(sorts::plot(&sorts));
    }
    report.tables.retain(|table| !table.rows.is_empty());
    Ok(report)
}
