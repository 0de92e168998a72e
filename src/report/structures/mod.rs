//! Every acceleration structure on scenes and on meshes of growing size: build, memory, refit, the speed of four classes of rays, and
//! what a ray costs in nodes, triangles, cells and events.
//!
//! All structures answer the same rays in the same run and their answers are compared bit for bit. Times are medians of repeats taken in
//! turn, one structure after the other, so that a slow moment of the machine meets all of them. Structures that are slow get
//! fewer rays, spread evenly; how many is counted work, not time, so that counts are the same in every run.

mod checks;
mod growth;
mod limits;
mod plots;
mod rows;
mod scene;

use super::{Kind, Monitor, Report, ReportError, Settings, Subject, meshes};
use crate::{
    accel::{AccelKind, AccelSpec},
    scene::builtin,
    simd::SimdLevel,
};

/// What to measure, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Fewer rays, repeats and sizes: under a minute on two cores.
    pub quick: bool,
    /// Level of the kernels.
    pub simd: SimdLevel,
    /// Structures with their settings.
    pub specs: Vec<AccelSpec>,
}

impl Options {
    /// All structures of [`specs`] at the best level.
    pub fn new(quick: bool) -> Self {
        Self { quick, simd: SimdLevel::best(), specs: specs(quick) }
    }

    /// Repeats of a time.
    fn repeats(&self) -> usize {
        if self.quick { 3 } else { 7 }
    }

    /// Pixels of the picture, a side.
    fn side(&self) -> usize {
        if self.quick { 128 } else { 512 }
    }

    /// Work (as `Counts::work` has it) that a structure may spend on one repeat of one class.
    fn budget(&self) -> u64 {
        if self.quick { 400_000 } else { 8_000_000 }
    }
}

/// Settings worth a row of their own, besides the defaults of every kind.
const VARIANTS: [&str; 7] = [
    "bvh8:layout=compact",
    "ssh:leaf=1",
    "ssh:refit=rechoose",
    "ssh:planes=3",
    "ssh:planes=4",
    "events:form=flat",
    "grug:mode=dda",
];

/// Every structure with its default settings and, unless `quick`, variants that show a trade.
pub fn specs(quick: bool) -> Vec<AccelSpec> {
    let variants = VARIANTS.iter().filter(|_| !quick).filter_map(|text| text.parse().ok());
    let mut specs: Vec<_> = AccelKind::ALL.iter().copied().map(AccelSpec::new).chain(variants).collect();
    specs.sort_by_key(|spec| AccelKind::ALL.iter().position(|&k| k == spec.kind()));
    specs
}

/// The scenes measured when none is given: the built-in ones and generated meshes.
///
/// # Errors
/// When a built-in scene does not load.
pub fn default_subjects(quick: bool) -> Result<Vec<Subject>, ReportError> {
    let mut subjects = Vec::new();
    let scenes = if quick { &builtin::names()[..2] } else { builtin::names() };
    for name in scenes {
        subjects.push(Subject::from_scene(format!("builtin:{name}"), &builtin::load(name)?));
    }
    let triangles = if quick { 20_000 } else { 200_000 };
    subjects.push(meshes::dented_sphere(triangles));
    subjects.push(meshes::soup(triangles));
    Ok(subjects)
}

/// Measures `subjects`, or [`default_subjects`] and growth when there are none, in the current rayon pool.
///
/// # Errors
/// When `monitor` ends it, a built-in scene does not load, or a subject's triangles name vertices that do not exist.
pub fn report(subjects: &[Subject], options: &Options, monitor: &mut dyn Monitor) -> Result<Report, ReportError> {
    let settings = Settings {
        quick: options.quick,
        threads: rayon::current_num_threads(),
        simd: options.simd.name(),
        precision: "exact",
        scenes: subjects.iter().map(|s| s.name.clone()).collect(),
        structures: options.specs.iter().map(AccelSpec::to_string).collect(),
    };
    let mut report = Report::new(Kind::Structures, settings);
    let mut tables = rows::Tables::new();
    let defaults = if subjects.is_empty() { default_subjects(options.quick)? } else { Vec::new() };
    for subject in subjects.iter().chain(&defaults) {
        scene::measure(subject, options, &mut tables, monitor)?;
        report.plots.extend(plots::rates(&subject.name, &tables));
    }
    if subjects.is_empty() {
        growth::measure(options, &mut tables, monitor)?;
        report.plots.extend(plots::growth(&tables));
    }
    report.checks = checks::checks(&tables);
    report.tables = tables.finish();
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_and_every_variant_is_measured_once() {
        let specs = specs(false);
        assert_eq!(specs.len(), AccelKind::ALL.len() + VARIANTS.len());
        for (i, spec) in specs.iter().enumerate() {
            assert!(!specs[..i].contains(spec), "{spec}");
        }
    }
}
