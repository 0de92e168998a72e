//! Speed against error: every structure and form of each step, with what it costs and how it errs.
//!
//! Rays are answered by all points in the same run and judged by [`reference`](super::reference). Conservative points must show no error at
//! all; lossy ones stay below stated bounds.

mod bounds;
mod contacts;
mod costs;
mod flip;
pub mod hard;
mod images;
mod needs;
mod offset;
mod pareto;
mod point;
mod points;
mod quest;
mod rays;
mod same;
mod skin;
mod source;
mod summary;
mod updates;

pub use source::Source;

use super::{Check, Kind, Monitor, Report, ReportError, Settings, Table, structures};
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
        if self.quick { 2 } else { 3 }
    }

    /// Rays of a class.
    fn rays(&self) -> usize {
        if self.quick { 16_384 } else { 131_072 }
    }

    /// Width and height of pictures.
    fn picture(&self) -> [u32; 2] {
        if self.quick { [160, 90] } else { [480, 270] }
    }

    /// Samples a pixel of a picture without noise to speak of.
    fn converged(&self) -> u32 {
        if self.quick { 64 } else { 256 }
    }

    /// Work (as `Counts::work` has it) that a point may spend on one repeat of one class.
    fn budget(&self) -> u64 {
        if self.quick { 400_000 } else { 4_000_000 }
    }
}

/// All rows so far.
#[derive(Default)]
struct Rows {
    rays: Vec<rays::RayRow>,
    updates: Vec<updates::UpdateRow>,
    skins: Vec<skin::SkinRow>,
    images: Vec<images::ImageRow>,
    same: Vec<same::SameRow>,
    needs: Vec<needs::NeedRow>,
    offsets: Vec<offset::OffsetRow>,
    contacts: Vec<contacts::ContactRow>,
}

impl Rows {
    fn measure(&mut self, source: &Source, options: &Options, monitor: &mut dyn Monitor) -> Result<(), ReportError> {
        monitor.begin(&format!("{}: right answers", source.name))?;
        let quests = quest::quests(source, options.rays());
        self.rays.extend(rays::measure(source, &quests, options, monitor)?);
        self.updates.extend(updates::measure(source, &quests, options, monitor)?);
        self.skins.extend(skin::measure(source, options, monitor)?);
        self.images.extend(images::measure(source, options, monitor)?);
        self.same.extend(same::measure(source, &quests, options, monitor)?);
        self.needs.extend(needs::measure(source, options, monitor)?);
        Ok(())
    }

    /// A sentence on everything but rays.
    fn in_short(&self) -> Vec<String> {
        let mut out: Vec<String> = costs::in_short(&self.rays).into_iter().collect();
        out.extend([hard::in_short(), updates::in_short(&self.updates)]);
        out.extend(skin::in_short(&self.skins));
        out.push(contacts::in_short(&self.contacts));
        out.extend(needs::in_short(&self.needs));
        out
    }

    fn checks(&self) -> Vec<Check> {
        let mut checks = bounds::checks(&self.rays);
        checks.extend(updates::checks(&self.updates));
        checks.extend(same::checks(&self.same));
        checks.extend(skin::checks(&self.skins));
        checks.extend(offset::checks(&self.offsets));
        checks.extend(images::checks(&self.images));
        checks.extend(contacts::checks(&self.contacts));
        checks
    }

    /// What has both a cost and an error.
    fn spots(&self) -> Vec<pareto::Spot> {
        pareto::spots(&self.rays, &self.images, &self.skins)
    }

    fn tables(&self) -> Vec<Table> {
        let mut tables = vec![
            bounds::table(),
            costs::table(&self.rays),
            hard::table(),
            points::table(&points::points(&self.rays)),
            updates::points(&self.updates),
            skin::table(&self.skins),
            images::table(&self.images),
            offset::table(&self.offsets),
            contacts::table(&self.contacts),
            same::points(&self.same),
            needs::table(&self.needs),
            rays::table(&self.rays),
            updates::table(&self.updates),
            same::table(&self.same),
            pareto::table(&self.spots()),
        ];
        tables.retain(|t| !t.rows.is_empty());
        tables
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
    let mut rows = Rows::default();
    for source in sources.iter().chain(&defaults) {
        rows.measure(source, options, monitor)?;
    }
    rows.offsets = offset::measure(options, monitor)?;
    rows.contacts = contacts::measure(options, monitor)?;
    report.summary = summary::summary(&rows.rays, &rows.in_short());
    report.checks = rows.checks();
    report.tables = rows.tables();
    report.plots = points::plots(&points::points(&rows.rays));
    report.plots.extend(pareto::plots(&rows.spots()));
    Ok(report)
}
