//! Speed against error: every structure and form of each step, with what it costs and how it errs.
//!
//! Rays are answered by all points in the same run and judged by [`reference`](super::reference). Conservative points must show no error at
//! all; lossy ones stay below stated bounds.

mod bounds;
mod pareto;
mod point;
mod quest;
mod rays;
mod same;
mod source;
mod updates;

pub use source::Source;

use super::{Kind, Monitor, Report, ReportError, Settings, structures};
use crate::{accel::AccelSpec, simd::SimdLevel};

/// What to measure, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Fewer scenes, rays and repeats: under a minute on two cores.
    pub quick: bool,
    /// Level of the kernels.
    pub simd: SimdLevel,
    /// Structures with their settings.
    pub specs: Vec<AccelSpec>,
}

impl Options {
    /// All structures at the best level.
    pub fn new(quick: bool) -> Self {
        Self { quick, simd: SimdLevel::best(), specs: structures::specs(quick) }
    }

    /// Repeats of a time.
    fn repeats(&self) -> usize {
        if self.quick { 2 } else { 5 }
    }

    /// Rays of a class.
    fn rays(&self) -> usize {
        if self.quick { 16_384 } else { 262_144 }
    }

    /// Work (as `Counts::work` has it) that a point may spend on one repeat of one class.
    fn budget(&self) -> u64 {
        if self.quick { 400_000 } else { 8_000_000 }
    }
}

/// Measures `sources`, or a default set when there are none, in the current rayon pool.
///
/// # Errors
/// When `monitor` ends it or a built-in scene does not load.
pub fn report(sources: &[Source], options: &Options, monitor: &mut dyn Monitor) -> Result<Report, ReportError> {
    let settings = Settings {
        quick: options.quick,
        threads: rayon::current_num_threads(),
        simd: options.simd.name(),
        precision: "exact and fast",
        scenes: sources.iter().map(|s| s.name.clone()).collect(),
        structures: options.specs.iter().map(AccelSpec::to_string).collect(),
    };
    let mut report = Report::new(Kind::Accuracy, settings);
    let defaults = if sources.is_empty() { source::defaults(options.quick)? } else { Vec::new() };
    let (mut rows, mut updated, mut same) = (Vec::new(), Vec::new(), Vec::new());
    for source in sources.iter().chain(&defaults) {
        monitor.begin(&format!("{}: right answers", source.name))?;
        let quests = quest::quests(source, options.rays());
        rows.extend(rays::measure(source, &quests, options, monitor)?);
        updated.extend(updates::measure(source, &quests, options, monitor)?);
        same.extend(same::measure(source, &quests, options, monitor)?);
    }
    report.checks = bounds::checks(&rows);
    report.checks.extend(updates::checks(&updated));
    report.checks.extend(same::checks(&same));
    report.tables =
        vec![bounds::table(), rays::table(&rows), updates::table(&updated), same::table(&same), pareto::table(&rows)];
    report.tables.retain(|t| !t.rows.is_empty());
    report.plots = pareto::plots(&rows);
    Ok(report)
}
