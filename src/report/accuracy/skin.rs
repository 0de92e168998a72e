//! Errors of vertices against a plain f64 path, and what is left of a pose after many rounds.

use std::sync::Arc;

use super::{Options, Source, source::first_clip};
use crate::{
    anim::{ActiveClip, Pose, loop_time},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::{Forms, InstanceId, Precision},
    glam::{DAffine3, DMat4, DVec3, Vec3},
    report::{Bound, Cell, Check, Column, Monitor, ReportError, Role, Table, measure::Samples},
    scene::{ClipId, PartInstance, Scene},
    world::World,
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("precision", "skinning", Role::Id, 0),
    Column::new("vertices", "vertices", Role::Note, 0),
    Column::new("frames", "frames", Role::Note, 0),
    Column::new("deform_ms", "deform [ms a frame]", Role::Sooner, 3),
    Column::new("max_error", "largest error over size", Role::Less, 9),
    Column::new("rms_error", "RMS error over size", Role::Less, 9),
    Column::new("rounding", "half a step of f32 over size", Role::Note, 9),
    Column::new("drift", "drift after 10,000 rounds over size", Role::Less, 9),
    Column::new("not_returned", "vertices unlike before, after a return", Role::Less, 0),
];

/// Rounds of a clip after which drift is looked for.
const ROUNDS: f64 = 10_000.0;

/// A scene's vertices in one precision.
#[derive(Clone, Debug, Default)]
pub(super) struct SkinRow {
    pub(super) scene: String,
    pub(super) forms: Forms,
    vertices: usize,
    frames: usize,
    pub(super) deform: Samples,
    pub(super) max: f64,
    pub(super) rms: f64,
    rounding: f64,
    drift: f64,
    not_returned: u64,
}

/// The rows as they are written.
pub(super) fn table(rows: &[SkinRow]) -> Table {
    let mut table = Table::new("skinning", "Skinning, morphing and drift", COLUMNS).with_note(
        "Vertices of all parts at moments spread over the first clip, against sums of f64 matrices that are never rounded to f32, over the diagonal of the \
         scene. The exact form works in f64 and rounds once, so that half a step of f32 at the largest coordinate, on three axes, bounds its error. Drift: the \
         same moment of the clip reached directly and after 10,000 rounds. A return: the clip's middle before and after other frames, bit for bit.",
    );
    for r in rows {
        table.push(vec![
            r.scene.clone().into(),
            r.forms.deform.name().into(),
            r.vertices.into(),
            r.frames.into(),
            r.deform.median().map(|s| s * 1e3).into(),
            r.max.into(),
            r.rms.into(),
            r.rounding.into(),
            r.drift.into(),
            Cell::Count(r.not_returned),
        ]);
    }
    table
}

/// Bound on the error of fast vertices, over the size of the scene.
const FAST_ERROR: f64 = 1e-5;

/// In a sentence; empty without a clip.
pub(super) fn in_short(rows: &[SkinRow]) -> Option<String> {
    let worst = |form: Precision| rows.iter().filter(|r| r.forms.deform == form).map(|r| r.max).reduce(f64::max);
    let (exact, fast) = (worst(Precision::Exact)?, worst(Precision::Fast)?);
    let drift = rows.iter().map(|r| r.drift).fold(0.0, f64::max);
    Some(format!(
        "**Vertices:** off by at most {:.1} in 10^9 of the scene's size in exact, {:.1} in fast; {:.1} after 10,000 rounds of the clip.",
        exact * 1e9,
        fast * 1e9,
        drift * 1e9
    ))
}

/// What vertices must show.
pub(super) fn checks(rows: &[SkinRow]) -> Vec<Check> {
    let of = |fast: bool| rows.iter().filter(move |r| (r.forms.deform == Precision::Fast) == fast);
    let over = of(false).map(|r| r.max / r.rounding).reduce(f64::max);
    vec![
        Check::new("exact vertices: error over half a step of f32", Bound::AtMost(1.0), over),
        Check::new("exact vertices: drift over size", Bound::AtMost(1e-6), of(false).map(|r| r.drift).reduce(f64::max)),
        Check::new(
            "vertices unlike before after a return",
            Bound::Exactly(0.0),
            rows.iter().map(|r| r.not_returned as f64).reduce(f64::max),
        ),
        Check::new(
            "fast vertices: error over size",
            Bound::AtMost(FAST_ERROR),
            of(true).map(|r| r.max).reduce(f64::max),
        ),
    ]
}

/// Rows of a scene with a clip; none for others.
///
/// # Errors
/// When `monitor` ends it, or a frame cannot be made.
pub(super) fn measure(
    source: &Source,
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<SkinRow>, ReportError> {
    let Some(scene) = &source.scene else { return Ok(Vec::new()) };
    let Some(clip) = first_clip(scene) else { return Ok(Vec::new()) };
    monitor.begin(&format!("{}: skinning", source.name))?;
    let mut rows = Vec::new();
    for deform in Precision::ALL {
        let forms = Forms { deform, ..Forms::EXACT };
        let row = Stage::new(scene, clip, forms)?.row(options)?;
        rows.push(SkinRow { scene: source.name.clone(), forms, ..row });
    }
    Ok(rows)
}

/// A frame loop of one scene.
struct Stage<'a> {
    scene: &'a Arc<Scene>,
    clip: usize,
    frames: FrameLoop,
}

impl<'a> Stage<'a> {
    fn new(scene: &'a Arc<Scene>, clip: usize, forms: Forms) -> Result<Self, ReportError> {
        // One thread, so that times of deforming are those of the kernel.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = Arc::new(pool.map_err(|e| ReportError::Threads(e.to_string()))?);
        let (accel, top) = ("bvh2".to_owned(), "bvh2".to_owned());
        let mut frames = FrameLoop::new(FrameConfig { accel, top, policy: RebuildPolicy::Refit, forms, pool })?;
        frames.add(scene.clone(), DAffine3::IDENTITY);
        Ok(Self { scene, clip, frames })
    }

    fn at(&mut self, time_s: f64, samples: &mut Samples) -> Result<Arc<World>, ReportError> {
        let clip = ClipId(u32::try_from(self.clip).unwrap_or(u32::MAX));
        let (world, times) = self.frames.advance(&[&[ActiveClip { clip, time_s }]])?;
        samples.push(times.deform.as_secs_f64());
        Ok(world)
    }

    fn row(mut self, options: &Options) -> Result<SkinRow, ReportError> {
        let duration = self.scene.clips[self.clip].duration_s;
        let frames = if options.quick { 6 } else { 24 };
        let mut row = SkinRow { frames, ..SkinRow::default() };
        let before = self.at(duration / 2.0, &mut Samples::default())?;
        let size = f64::from(before.bounds().diagonal()).max(f64::MIN_POSITIVE);
        let mut sum = Sum::default();
        for frame in 0..frames {
            let time_s = duration * (frame as f64 + 0.37) / frames as f64;
            let world = self.at(time_s, &mut row.deform)?;
            sum.add(&world, self.scene);
            let later = loop_time(time_s, ROUNDS * duration, 1.0, duration);
            let world_later = self.at(later, &mut Samples::default())?;
            row.drift = row.drift.max(distance(&world, &world_later) / size);
        }
        let after = self.at(duration / 2.0, &mut Samples::default())?;
        row.not_returned = unlike(&before, &after);
        row.vertices = sum.count / frames.max(1);
        row.max = sum.max / size;
        row.rms = (sum.squares / sum.count.max(1) as f64).sqrt() / size;
        row.rounding = sum.largest * f64::from(f32::EPSILON) / 2.0 * 3.0_f64.sqrt() / size;
        Ok(row)
    }
}

/// Errors so far.
#[derive(Default)]
struct Sum {
    count: usize,
    max: f64,
    squares: f64,
    /// The largest coordinate.
    largest: f64,
}

impl Sum {
    fn add(&mut self, world: &World, scene: &Scene) {
        for (number, &instance) in scene.instances.iter().enumerate() {
            let found = world.positions(InstanceId(u32::try_from(number).unwrap_or(u32::MAX)));
            for (vertex, found) in found.iter().enumerate() {
                let due = plain(scene, world.actor_pose(0), instance, vertex);
                let error = found.as_dvec3().distance(due);
                self.count += 1;
                self.max = self.max.max(error);
                self.squares += error * error;
                self.largest = self.largest.max(due.abs().max_element());
            }
        }
    }
}

/// A vertex in the world: morphed, then placed by the weighted mean of its joints' matrices or by its node.
fn plain(scene: &Scene, pose: &Pose, instance: PartInstance, vertex: usize) -> DVec3 {
    let (part, node) = (scene.part(instance), &scene.nodes[instance.node.index()]);
    let mut at = part.positions[vertex].as_dvec3();
    for (target, &weight) in part.targets.iter().zip(pose.weights(instance.node)) {
        at += target.positions.get(vertex).map_or(DVec3::ZERO, |p| p.as_dvec3()) * weight;
    }
    if let (Some(skin), Some(influences)) = (node.skin, &part.influences) {
        let matrices = pose.joint_matrices(skin);
        let of_vertex = vertex * influences.per_vertex..(vertex + 1) * influences.per_vertex;
        let pairs = influences.joints[of_vertex.clone()].iter().zip(&influences.weights[of_vertex]);
        let (mut sum, mut total) = (DMat4::ZERO, 0.0);
        for (&joint, &weight) in pairs.filter(|(_, w)| **w != 0.0) {
            sum += DMat4::from(matrices[usize::from(joint)]) * f64::from(weight);
            total += f64::from(weight);
        }
        if total > 0.0 {
            return (sum * at.extend(1.0)).truncate() / total;
        }
        // Without weights a vertex follows its first joint.
        let first = usize::from(influences.joints[vertex * influences.per_vertex]);
        return matrices.get(first).or(matrices.first()).map_or(at, |m| m.transform_point3(at));
    }
    let copy = instance.copy.zip(node.copies.as_ref()).map(|(i, copies)| copies[i as usize]);
    let placed = copy.map_or(at, |c| c.rotation.normalize() * (c.scale * at) + c.translation);
    pose.world_from_node(instance.node).transform_point3(placed)
}

/// The largest distance of a vertex from itself in another world.
fn distance(a: &World, b: &World) -> f64 {
    pairs(a, b).map(|(a, b)| a.as_dvec3().distance(b.as_dvec3())).fold(0.0, f64::max)
}

/// Vertices whose bits differ.
fn unlike(a: &World, b: &World) -> u64 {
    pairs(a, b).filter(|(a, b)| a.to_array().map(f32::to_bits) != b.to_array().map(f32::to_bits)).count() as u64
}

fn pairs<'a>(a: &'a World, b: &'a World) -> impl Iterator<Item = (&'a Vec3, &'a Vec3)> {
    let numbers = (0..a.instances().len()).map(|i| InstanceId(u32::try_from(i).unwrap_or(u32::MAX)));
    numbers.flat_map(move |i| a.positions(i).iter().zip(b.positions(i)))
}
