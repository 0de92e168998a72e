//! The papers' tables beside ours.
//!
//! Three structures are measured as their authors did: the single slab hierarchy against boxes over the same topology, sorted event lists against
//! uniform grids on the Standard Procedural Databases, and the grouped uniform grid against a kd-tree by memory and reads. Models that are not at
//! hand are replaced, and the rows say so. Timed work runs on one thread.

mod boxes;
mod cases;
mod databases;
mod groups;
mod lists;
pub mod objects;
pub mod published;
mod slabs;
pub mod spd;

use rayon::ThreadPoolBuilder;

use super::{Kind, Monitor, Report, ReportError, Settings, Subject};
use crate::simd::SimdLevel;

/// What to measure, and how.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Fewer and smaller scenes, fewer rays and repeats: under a minute on two cores.
    pub quick: bool,
    /// Level of the kernels.
    pub simd: SimdLevel,
}

impl Options {
    /// Repeats of a time.
    fn repeats(self) -> usize {
        if self.quick { 1 } else { 3 }
    }
}

/// Measures all tables; `models` take the places of the papers' models that they are or resemble. Counting runs in the current rayon
/// pool.
///
/// # Errors
/// When `monitor` ends it, or a scene or structure cannot be made.
pub fn report(models: &[Subject], options: Options, monitor: &mut (dyn Monitor + Send)) -> Result<Report, ReportError> {
    let settings = Settings {
        quick: options.quick,
        threads: rayon::current_num_threads(),
        simd: options.simd.name(),
        precision: "exact",
        scenes: models.iter().map(|m| m.name.clone()).collect(),
        structures: ["bvh2", "ssh", "events", "grid", "kdtree", "grug"].map(str::to_owned).to_vec(),
    };
    let mut report = Report::new(Kind::Papers, settings);
    let single = ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| ReportError::Threads(e.to_string()))?;
    let (table, checks) = single.install(|| slabs::measure(models, options, monitor))?;
    report.tables.push(table);
    report.checks.extend(checks);
    let (table, checks) = lists::table(options, monitor)?;
    report.tables.push(table);
    report.checks.extend(checks);
    let (table, plots, checks) = lists::growth(options, monitor)?;
    report.tables.push(table);
    report.plots.extend(plots);
    report.checks.extend(checks);
    let (tables, plots, checks) = groups::measure(models, options, monitor)?;
    report.tables.extend(tables);
    report.plots.extend(plots);
    report.checks.extend(checks);
    let (table, checks) = databases::measure(options, monitor)?;
    report.tables.push(table);
    report.checks.extend(checks);
    Ok(report)
}
