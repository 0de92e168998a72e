//! All structures over one mesh at growing sizes, one after the other.

use super::{
    Options,
    limits::Foresight,
    rows::{GrowthRow, Tables},
    scene::{Questions, affordable, part, questions},
};
use crate::{
    accel::{AccelSpec, AnyAccel, Refit},
    geom::Forms,
    report::{
        Monitor, RayClass, ReportError, Subject, machine,
        measure::{Caster, Samples},
        meshes,
    },
};

/// Triangles asked for.
const SIZES: [usize; 5] = [1_000, 10_000, 100_000, 1_000_000, 10_000_000];

/// The classes cast.
const CLASSES: [RayClass; 2] = [RayClass::Primary, RayClass::Diffuse];

/// Longest build that is begun, in seconds.
fn most_seconds(quick: bool) -> f64 {
    if quick { 3.0 } else { 180.0 }
}

/// Adds the rows of growth.
///
/// # Errors
/// When `monitor` ends it or `bvh2` cannot be built.
pub(super) fn measure(options: &Options, tables: &mut Tables, monitor: &mut dyn Monitor) -> Result<(), ReportError> {
    let sizes = if options.quick { &SIZES[..3] } else { &SIZES[..] };
    let mut foresight: Vec<Option<Foresight>> = vec![None; options.specs.len()];
    for &size in sizes {
        monitor.begin(&format!("growth: {size} triangles"))?;
        let subject = meshes::dented_sphere(size);
        let questions = questions(&subject.prims(), options.side(), &CLASSES, options.simd)?;
        for (spec, seen) in options.specs.iter().zip(&mut foresight) {
            monitor.begin(&format!("growth: {size} triangles: {spec}"))?;
            let triangles = subject.indices.len();
            let mut row = GrowthRow { structure: spec.to_string(), triangles, ..GrowthRow::default() };
            match seen.as_ref().and_then(|s| s.objection(triangles, most_seconds(options.quick))) {
                Some(objection) => row.note = Some(objection),
                None => fill(&mut row, &subject, spec, &questions, options),
            }
            if let (Some(build), Some(stats)) = (row.build.median(), row.stats) {
                *seen = Some(Foresight::new(triangles, build, stats.total_bytes));
            }
            row.peak = machine::peak_memory();
            tables.growth.push(row);
        }
    }
    Ok(())
}

fn fill(row: &mut GrowthRow, subject: &Subject, spec: &AccelSpec, questions: &[Questions], options: &Options) {
    let prims = subject.prims();
    let mut accel = match row.build.time(|| spec.build(&prims)) {
        Ok(accel) => accel,
        Err(error) => {
            row.note = Some(error.to_string());
            return;
        }
    };
    let repeats = options.repeats();
    for _ in 1..repeats {
        if row.build.median().is_none_or(|s| s > 0.5) {
            break;
        }
        drop(accel);
        match row.build.time(|| spec.build(&prims)) {
            Ok(again) => accel = again,
            Err(error) => {
                row.note = Some(error.to_string());
                return;
            }
        }
    }
    row.stats = Some(accel.stats());
    row.violations.extend(accel.validate(&prims).err().map(|v| format!("broken after the build: {}", v.0)));
    row.differences = Some(0);
    for questions in questions {
        cast(row, (spec, &accel), subject, questions, options);
    }
    if !refit(accel, subject, repeats, &mut row.refit) {
        row.note = Some("rebuilds instead of refitting".to_owned());
    }
}

fn cast(
    row: &mut GrowthRow,
    (spec, accel): (&AccelSpec, &AnyAccel),
    subject: &Subject,
    questions: &Questions,
    options: &Options,
) {
    let caster = Caster { accel, prims: subject.prims(), simd: options.simd, forms: Forms::EXACT };
    let is_primary = questions.class == RayClass::Primary;
    // Both classes take the same number of rays.
    let n = row.count.unwrap_or_else(|| affordable(spec, &caster, questions, options.budget()));
    let (rays, due) = part(questions, n.min(questions.rays.len()));
    let mut found = due.clone();
    if is_primary {
        row.counts = caster.count(&rays, questions.class.ask(), options.budget());
        row.count = Some(rays.len());
    }
    for repeat in 0..=options.repeats() {
        let seconds = caster.cast(&rays, questions.class.ask(), false, &mut found);
        let wrong = found.iter().zip(&due).filter(|(a, b)| a != b).count();
        row.differences = row.differences.map(|d| d.max(wrong));
        if repeat > 0 {
            // Scaled to the number of primary rays, by which the row divides.
            let scale = row.count.unwrap_or(rays.len()) as f64 / rays.len().max(1) as f64;
            if is_primary { &mut row.primary } else { &mut row.diffuse }.push(seconds * scale);
        }
    }
}

/// Refits to and fro within one copy beside the structure; false when it cannot.
fn refit(accel: AnyAccel, subject: &Subject, repeats: usize, samples: &mut Samples) -> bool {
    let (mut from, mut to) = (accel.clone(), accel);
    for i in 0..=repeats {
        let prims = if i % 2 == 0 { subject.moved_prims() } else { subject.prims() };
        let mut sample = Samples::default();
        if sample.time(|| from.refit_into(&mut to, &prims)) == Refit::NeedsRebuild {
            return false;
        }
        if i > 0 {
            sample.values().iter().for_each(|&s| samples.push(s));
        }
        std::mem::swap(&mut from, &mut to);
    }
    true
}
