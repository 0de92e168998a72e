//! What a scene did not need, and what leaving it out saved.

use super::{Options, Source, source::FRAME_S, source::first_clip};
use crate::{
    accel::{AccelSpec, AnyAccel},
    anim::{ActiveClip, MotionClass, Pose, classify, deform_range_at, left_out, vertex_normal},
    geom::Triangles,
    glam::{DAffine3, Vec3},
    report::{Cell, Column, Monitor, ReportError, Role, Table, measure::Samples, subject::middle},
    scene::{PartInstance, Scene},
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("feature", "left out", Role::Id, 0),
    Column::new("why", "why", Role::Note, 0),
    Column::new("saved_ms", "saved [ms a frame]", Role::Note, 4),
    Column::new("saved_bytes", "saved [bytes]", Role::Note, 0),
    Column::new("measured", "measured how", Role::Note, 0),
];

/// What [`left_out`] calls it as well.
const STATIC_REFIT: &str = "refit of static parts";

/// Something that was left out.
#[derive(Clone, Debug, Default)]
pub(super) struct NeedRow {
    scene: String,
    feature: String,
    why: String,
    saved_ms: Option<f64>,
    saved_bytes: Option<usize>,
    measured: Option<&'static str>,
}

/// The rows as they are written.
pub(super) fn table(rows: &[NeedRow]) -> Table {
    let mut table = Table::new("left_out", "What the scene did not need, and what leaving it out saved", COLUMNS).with_note(
        "Only what a scene asks for is computed and stored. Where the work left out can be done on its own, it was done here once to measure it, on one \
         thread; a feature without a number has no part in the program for this scene that could be timed by itself.",
    );
    for r in rows {
        table.push(vec![
            r.scene.clone().into(),
            r.feature.clone().into(),
            r.why.clone().into(),
            r.saved_ms.into(),
            r.saved_bytes.into(),
            r.measured.map_or(Cell::Absent, Cell::from),
        ]);
    }
    table
}

/// In a sentence; empty without a scene.
pub(super) fn in_short(rows: &[NeedRow]) -> Option<String> {
    let first = rows.first()?;
    let mine = || rows.iter().filter(|r| r.scene == first.scene);
    let ms: f64 = mine().filter(|r| r.saved_bytes.is_none()).filter_map(|r| r.saved_ms).sum();
    let features: Vec<&str> = mine().map(|r| r.feature.as_str()).collect();
    Some(format!(
        "**Left out:** `{}` did not need {}; what could be measured of it saves {ms:.2} ms a frame.",
        first.scene,
        features.join(", ")
    ))
}

/// Rows of a scene; none for a mesh.
///
/// # Errors
/// When `monitor` ends it.
pub(super) fn measure(
    source: &Source,
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<NeedRow>, ReportError> {
    let Some(scene) = &source.scene else { return Ok(Vec::new()) };
    monitor.begin(&format!("{}: what was left out", source.name))?;
    let bench = Bench::new(scene, options);
    let classes = classify(scene);
    let row = |feature: &str, why: String| NeedRow {
        scene: source.name.clone(),
        feature: feature.to_owned(),
        why,
        ..NeedRow::default()
    };
    let still: Vec<PartInstance> = of_class(scene, &classes, MotionClass::Static);
    // What is measured below is not listed twice.
    let noted = left_out(scene, &classes).into_iter().filter(|l| still.is_empty() || l.feature != STATIC_REFIT);
    let mut rows: Vec<NeedRow> = noted.map(|l| row(l.feature, l.why)).collect();
    if !still.is_empty() {
        let why = format!("{} of {} parts are static", still.len(), classes.len());
        rows.push(NeedRow {
            saved_ms: bench.deform(&still),
            measured: Some("all their vertices computed for a frame"),
            ..row("deform of static parts", why.clone())
        });
        rows.push(NeedRow {
            saved_ms: bench.refit(&still),
            measured: Some("a bvh2 over them refitted"),
            ..row(STATIC_REFIT, why)
        });
    }
    rows.push(NeedRow {
        saved_ms: bench.normals(),
        measured: Some("the normals of all vertices computed; what hits compute instead is not deducted"),
        ..row("normals of all vertices", "they are computed at hits".to_owned())
    });
    let lists = bench.lists(&source.prims());
    rows.push(NeedRow {
        saved_ms: lists.map(|l| l.0),
        saved_bytes: lists.map(|l| l.1),
        measured: Some("sorted lists over all triangles built; time once, not a frame"),
        ..row("event lists", "nothing asks for overlaps".to_owned())
    });
    Ok(rows)
}

fn of_class(scene: &Scene, classes: &[MotionClass], class: MotionClass) -> Vec<PartInstance> {
    scene.instances.iter().zip(classes).filter(|(_, c)| **c == class).map(|(&i, _)| i).collect()
}

/// A scene at a moment of its first clip.
struct Bench<'a> {
    scene: &'a Scene,
    pose: Pose,
    options: &'a Options,
}

impl<'a> Bench<'a> {
    fn new(scene: &'a Scene, options: &'a Options) -> Self {
        let mut pose = Pose::rest(scene);
        let active: Option<ActiveClip> = first_clip(scene).map(|clip| middle(scene, clip, FRAME_S));
        pose.evaluate(scene, active.as_slice(), &DAffine3::IDENTITY);
        Self { scene, pose, options }
    }

    /// Milliseconds of `work`, the median of some repeats.
    fn time(&self, mut work: impl FnMut()) -> Option<f64> {
        let mut samples = Samples::default();
        let watch = |work: &mut dyn FnMut()| {
            let watch = crate::report::measure::Stopwatch::thread();
            work();
            watch.seconds()
        };
        (0..self.options.repeats()).for_each(|_| samples.push(watch(&mut work)));
        samples.median().map(|s| s * 1e3)
    }

    fn vertices(&self, instance: PartInstance) -> Vec<Vec3> {
        let mut out = vec![Vec3::ZERO; self.scene.part(instance).positions.len()];
        deform_range_at(self.options.simd, self.scene, &self.pose, instance, 0, &mut out);
        out
    }

    fn deform(&self, instances: &[PartInstance]) -> Option<f64> {
        let mut out: Vec<Vec<Vec3>> = instances.iter().map(|&i| self.vertices(i)).collect();
        self.time(|| {
            for (&instance, out) in instances.iter().zip(&mut out) {
                deform_range_at(self.options.simd, self.scene, &self.pose, instance, 0, out);
            }
        })
    }

    fn refit(&self, instances: &[PartInstance]) -> Option<f64> {
        let (mut positions, mut indices) = (Vec::new(), Vec::new());
        for &instance in instances {
            let first = u32::try_from(positions.len()).ok()?;
            positions.extend(self.vertices(instance));
            indices.extend(self.scene.part(instance).triangles.iter().map(|t| t.map(|i| i + first)));
        }
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 1 };
        let accel: AnyAccel = "bvh2".parse::<AccelSpec>().ok()?.build(&prims).ok()?;
        let mut other = accel.clone();
        let _ = accel.refit_into(&mut other, &prims);
        self.time(|| {
            let _ = accel.refit_into(&mut other, &prims);
        })
    }

    fn normals(&self) -> Option<f64> {
        let all = || {
            let vertices = |&i: &PartInstance| (0..self.scene.part(i).positions.len()).map(move |v| (i, v));
            self.scene.instances.iter().flat_map(vertices)
        };
        self.time(|| {
            for (instance, vertex) in all() {
                let vertex = u32::try_from(vertex).unwrap_or(u32::MAX);
                std::hint::black_box(vertex_normal(self.scene, &self.pose, instance, vertex));
            }
        })
    }

    /// Milliseconds of a build, and bytes.
    fn lists(&self, prims: &Triangles<'_>) -> Option<(f64, usize)> {
        let spec = "events:form=flat".parse::<AccelSpec>().ok()?;
        let bytes = spec.build(prims).ok()?.stats().total_bytes;
        let ms = self.time(|| drop(std::hint::black_box(spec.build(prims))))?;
        Some((ms, bytes))
    }
}
