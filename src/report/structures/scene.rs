//! All structures over one scene.

use super::{
    Options,
    limits::Foresight,
    rows::{BuildRow, RayRow, Tables},
};
use crate::{
    accel::{AccelKind, AccelSpec, AnyAccel, Refit},
    geom::{Forms, Ray, Triangles},
    report::{
        Monitor, RayClass, ReportError, Subject,
        measure::{Answer, Caster, Samples},
        rays::{self, Sphere, View},
    },
    simd::SimdLevel,
};

/// Builds that take longer are not repeated, in seconds.
fn repeat_below(quick: bool) -> f64 {
    if quick { 0.1 } else { 2.0 }
}

/// Triangles above which memory is watched before each build.
const LARGE: usize = 500_000;

/// Rays of one class with the answers that all structures must give.
#[derive(Clone, Debug)]
pub(super) struct Questions {
    pub(super) class: RayClass,
    pub(super) rays: Vec<Ray>,
    pub(super) answers: Vec<Answer>,
}

/// The rays of all classes, answered by `bvh2`.
///
/// # Errors
/// When `bvh2` cannot be built.
pub(super) fn questions(
    prims: &Triangles<'_>,
    side: usize,
    classes: &[RayClass],
    simd: SimdLevel,
) -> Result<Vec<Questions>, ReportError> {
    let accel = AccelSpec::new(AccelKind::Bvh2).build(prims)?;
    let caster = Caster { accel: &accel, prims: *prims, simd, forms: Forms::EXACT };
    let Some(sphere) = Sphere::around(accel.bounds()) else { return Ok(Vec::new()) };
    let primary = rays::primary(View::whole(sphere), [side; 2]);
    let hits = caster.answers(&primary, RayClass::Primary.ask());
    let ask = |&class: &RayClass| {
        let rays = match class {
            RayClass::Primary => primary.clone(),
            _ => rays::secondary(class, sphere, prims, &primary, &hits),
        };
        let answers = caster.answers(&rays, class.ask());
        Questions { class, rays, answers }
    };
    Ok(classes.iter().map(ask).filter(|q| !q.rays.is_empty()).collect())
}

/// A structure that was built, and its row.
struct Built<'a> {
    spec: &'a AccelSpec,
    accel: AnyAccel,
}

/// Adds a scene's rows.
///
/// # Errors
/// When `monitor` ends it or `bvh2` cannot be built.
pub(super) fn measure(
    subject: &Subject,
    options: &Options,
    tables: &mut Tables,
    monitor: &mut dyn Monitor,
) -> Result<(), ReportError> {
    let prims = subject.prims();
    monitor.begin(&format!("{}: rays", subject.name))?;
    let questions = questions(&prims, options.side(), &RayClass::ALL, options.simd)?;
    let moved = questions_after(subject, options)?;
    let mut built = Vec::new();
    for spec in &options.specs {
        monitor.begin(&format!("{}: {spec}: build, refit", subject.name))?;
        let (row, accel) = build_row(subject, spec, options, moved.as_ref());
        tables.builds.push(row);
        built.extend(accel.map(|accel| Built { spec, accel }));
    }
    for questions in &questions {
        monitor.begin(&format!("{}: {} rays", subject.name, questions.class.name()))?;
        ray_rows(subject, questions, &built, options, tables, monitor)?;
    }
    Ok(())
}

/// Primary rays after the motion, which tell whether a refit is right.
fn questions_after(subject: &Subject, options: &Options) -> Result<Option<Questions>, ReportError> {
    let side = options.side().min(128);
    let found = questions(&subject.moved_prims(), side, &[RayClass::Primary], options.simd)?;
    Ok(found.into_iter().next())
}

fn build_row(
    subject: &Subject,
    spec: &AccelSpec,
    options: &Options,
    moved: Option<&Questions>,
) -> (BuildRow, Option<AnyAccel>) {
    let prims = subject.prims();
    let mut row = BuildRow {
        scene: subject.name.clone(),
        structure: spec.to_string(),
        triangles: prims.len(),
        motion: subject.motion,
        ..BuildRow::default()
    };
    let accel = match build(&prims, spec, options, &mut row.build) {
        Ok(accel) => accel,
        Err(reason) => {
            row.note = Some(reason);
            return (row, None);
        }
    };
    row.stats = Some(accel.stats());
    row.violations.extend(accel.validate(&prims).err().map(|v| format!("broken after the build: {}", v.0)));
    match refit(&accel, subject, options.repeats(), &mut row.refit) {
        None => row.note = Some("rebuilds instead of refitting".to_owned()),
        Some(refitted) => {
            let prims = subject.moved_prims();
            row.decay = Some(refitted.decay());
            row.violations.extend(refitted.validate(&prims).err().map(|v| format!("broken after the refit: {}", v.0)));
            let caster = Caster { accel: &refitted, prims, simd: options.simd, forms: Forms::EXACT };
            row.refit_differences = moved.map(|q| differences(spec, &caster, q, options.budget()));
        }
    }
    (row, Some(accel))
}

/// Builds as often as is quick; the reason in words when the structure refuses.
fn build(
    prims: &Triangles<'_>,
    spec: &AccelSpec,
    options: &Options,
    samples: &mut Samples,
) -> Result<AnyAccel, String> {
    if prims.len() > LARGE {
        // A part of the mesh tells what the whole will take.
        let part = Triangles { indices: &prims.indices[..LARGE / 8], ..*prims };
        let mut first = Samples::default();
        let accel = first.time(|| spec.build(&part)).map_err(|e| e.to_string())?;
        let seen = Foresight::new(part.len(), first.median().unwrap_or(0.0), accel.stats().total_bytes);
        drop(accel);
        if let Some(objection) = seen.objection(prims.len(), f64::INFINITY) {
            return Err(objection);
        }
    }
    let mut accel = samples.time(|| spec.build(prims)).map_err(|e| e.to_string())?;
    for _ in 1..options.repeats() {
        if samples.median().is_some_and(|s| s > repeat_below(options.quick)) {
            break;
        }
        drop(accel);
        accel = samples.time(|| spec.build(prims)).map_err(|e| e.to_string())?;
    }
    Ok(accel)
}

/// Refits to the moved vertices and back in turn, as a frame loop does; the one that fits the moved vertices, `None` when the
/// structure cannot.
fn refit(accel: &AnyAccel, subject: &Subject, repeats: usize, samples: &mut Samples) -> Option<AnyAccel> {
    let mut one = accel.clone();
    if accel.refit_into(&mut one, &subject.moved_prims()) == Refit::NeedsRebuild {
        return None;
    }
    let mut other = one.clone();
    for _ in 0..repeats {
        let _ = one.refit_into(&mut other, &subject.prims());
        let outcome = samples.time(|| other.refit_into(&mut one, &subject.moved_prims()));
        if outcome == Refit::NeedsRebuild {
            return None;
        }
    }
    Some(one)
}

/// How many of the rays that the structure can answer within `budget` it answers otherwise.
fn differences(spec: &AccelSpec, caster: &Caster<'_>, questions: &Questions, budget: u64) -> usize {
    let n = affordable(spec, caster, questions, budget);
    let (rays, due) = part(questions, n);
    let found = caster.answers(&rays, questions.class.ask());
    found.iter().zip(&due).filter(|(a, b)| a != b).count()
}

/// How many rays cost at most `budget`, by a sample of them. The flat form of `events` looks at every box when a ray begins, which no
/// counter sees.
pub(super) fn affordable(spec: &AccelSpec, caster: &Caster<'_>, questions: &Questions, budget: u64) -> usize {
    let sample = rays::spread(&questions.rays, 256);
    let start = if spec.to_string().contains("form=flat") { caster.prims.len() as u64 } else { 0 };
    let counts = caster.count(&sample, questions.class.ask(), budget / 4);
    let work = counts.work() + start * counts.rays;
    let rays = u128::from(budget) * u128::from(counts.rays) / u128::from(work.max(1));
    usize::try_from(rays).unwrap_or(usize::MAX).clamp(16, questions.rays.len().max(16))
}

/// About `n` of the rays, spread over all, and their answers.
pub(super) fn part(questions: &Questions, n: usize) -> (Vec<Ray>, Vec<Answer>) {
    if n >= questions.rays.len() {
        return (questions.rays.clone(), questions.answers.clone());
    }
    (rays::spread(&questions.rays, n), rays::spread(&questions.answers, n))
}

/// What one structure is asked, and its row.
struct Turn<'a> {
    caster: Caster<'a>,
    rays: Vec<Ray>,
    due: Vec<Answer>,
    found: Vec<Answer>,
    row: RayRow,
}

fn ray_rows(
    subject: &Subject,
    questions: &Questions,
    built: &[Built<'_>],
    options: &Options,
    tables: &mut Tables,
    monitor: &mut dyn Monitor,
) -> Result<(), ReportError> {
    let class = questions.class;
    let turn = |b: &Built<'_>, caster: &Caster<'_>| {
        let (rays, due) = part(questions, affordable(b.spec, caster, questions, options.budget()));
        let counts = caster.count(&rays, class.ask(), options.budget());
        let row = RayRow {
            scene: subject.name.clone(),
            structure: b.spec.to_string(),
            class,
            count: rays.len(),
            single: Samples::default(),
            packet: Samples::default(),
            counts,
            differences: 0,
        };
        (rays, due, row)
    };
    let mut turns = Vec::with_capacity(built.len());
    for b in built {
        let caster = Caster { accel: &b.accel, prims: subject.prims(), simd: options.simd, forms: Forms::EXACT };
        let (rays, due, row) = turn(b, &caster);
        let found = vec![Answer::MISS; rays.len()];
        turns.push(Turn { caster, rays, due, found, row });
    }
    for repeat in 0..=options.repeats() {
        monitor.begin(&format!("{}: {} rays", subject.name, class.name()))?;
        for turn in &mut turns {
            turn.take(repeat > 0);
        }
    }
    tables.rays.extend(turns.into_iter().map(|t| t.row));
    Ok(())
}

impl Turn<'_> {
    /// Casts all rays singly and in packets; the first time only warms up.
    fn take(&mut self, counts: bool) {
        for packet in [false, true] {
            let seconds = self.caster.cast(&self.rays, self.row.class.ask(), packet, &mut self.found);
            let wrong = self.found.iter().zip(&self.due).filter(|(a, b)| a != b).count();
            self.row.differences = self.row.differences.max(wrong);
            if counts {
                if packet { &mut self.row.packet } else { &mut self.row.single }.push(seconds);
            }
        }
    }
}
