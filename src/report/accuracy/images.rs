//! Errors as they are seen: pictures of exact and fast frames on the same samples, and of few samples against many.

use std::sync::Arc;

use super::{Options, Source, flip, point::label, source::first_clip};
use crate::{
    accel::{AccelKind, AccelSpec},
    anim::{ActiveClip, animation_bounds},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy, StageTimes},
    geom::{Forms, Precision},
    glam::DAffine3,
    render::{CameraView, Film, RenderSettings, Renderer},
    report::{Bound, Cell, Check, Column, Monitor, ReportError, Role, Table, measure::Samples, subject::middle},
    scene::{ClipId, Scene},
    world::World,
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("against", "against", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("samples", "samples a pixel", Role::Id, 0),
    Column::new("size", "pixels", Role::Note, 0),
    Column::new("frame_ms", "frame [ms]", Role::Sooner, 2),
    Column::new("update_ms", "of it before tracing [ms]", Role::Sooner, 3),
    Column::new("ns_per_ray", "ns a ray", Role::Sooner, 0),
    Column::new("rmse", "RMSE, linear", Role::Less, 6),
    Column::new("flip", "mean FLIP", Role::Less, 6),
    Column::new("largest", "largest difference", Role::Less, 4),
    Column::new("differing", "differing pixels", Role::Less, 0),
];

/// The picture that others are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Against {
    Exact,
    Converged,
}

/// A picture beside another.
#[derive(Clone, Debug)]
pub(super) struct ImageRow {
    pub(super) scene: String,
    against: Against,
    pub(super) structure: String,
    pub(super) forms: Forms,
    pub(super) samples: u32,
    size: [u32; 2],
    pub(super) frame: Samples,
    update: Samples,
    rays: u64,
    pub(super) difference: Difference,
}

/// What is told of two pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Difference {
    pub(super) rmse: f64,
    pub(super) flip: f64,
    largest: f64,
    pub(super) pixels: u64,
}

impl ImageRow {
    /// True for a picture of few samples beside one of many.
    pub(super) fn is_sampling(&self) -> bool {
        self.against == Against::Converged
    }

    fn cells(&self) -> Vec<Cell> {
        let d = &self.difference;
        let trace = self.frame.median().zip(self.update.median()).map(|(frame, update)| frame - update);
        vec![
            self.scene.clone().into(),
            match self.against {
                Against::Exact => "exact, the same samples",
                Against::Converged => "many other samples",
            }
            .into(),
            self.structure.clone().into(),
            label(self.forms).into(),
            u64::from(self.samples).into(),
            format!("{}x{}", self.size[0], self.size[1]).into(),
            self.frame.median().map(|s| s * 1e3).into(),
            self.update.median().map(|s| s * 1e3).into(),
            trace.filter(|_| self.rays > 0).map(|s| s * 1e9 / self.rays as f64).into(),
            d.rmse.into(),
            d.flip.into(),
            d.largest.into(),
            d.pixels.into(),
        ]
    }
}

/// The rows as they are written.
pub(super) fn table(rows: &[ImageRow]) -> Table {
    let mut table = Table::new("images", "Pictures", COLUMNS).with_note(
        "A frame in the middle of the scene's first clip, with shadows. Against exact: the same pixels, samples and lights, so every difference comes from the \
         forms. Against many other samples: what sampling errs, which no precision mends. RMSE and the largest difference are of linear colour; FLIP is \
         that of Andersson et al. 2020 for displays at 67 pixels a degree, 0 to 1. Differing pixels: any bit of the linear colour. Times are wall-clock \
         times on all threads of the report.",
    );
    for row in rows {
        table.push(row.cells());
    }
    table
}

/// What pictures must show.
pub(super) fn checks(rows: &[ImageRow]) -> Vec<Check> {
    let exact = rows.iter().filter(|r| r.against == Against::Exact && r.forms == Forms::EXACT);
    let pixels = exact.map(|r| r.difference.pixels).sum::<u64>() as f64;
    let fast = rows.iter().filter(|r| r.against == Against::Exact && r.forms != Forms::EXACT);
    let flip = fast.map(|r| r.difference.flip).reduce(f64::max);
    vec![
        Check::new("exact pictures: pixels that depend on the structure", Bound::Exactly(0.0), pixels),
        Check::new("fast pictures: mean FLIP against exact", Bound::AtMost(0.01), flip),
    ]
}

/// What makes pictures of one scene.
struct Studio<'a> {
    scene: &'a Arc<Scene>,
    active: Option<ActiveClip>,
    camera: CameraView,
    size: [u32; 2],
    options: &'a Options,
    pool: Arc<rayon::ThreadPool>,
}

/// A picture, and what it took.
struct Taken {
    film: Film,
    rays: u64,
    frame: Samples,
    update: Samples,
}

/// Pictures of a scene; none for a mesh.
///
/// # Errors
/// When `monitor` ends it, or a frame cannot be made.
pub(super) fn measure(
    source: &Source,
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<ImageRow>, ReportError> {
    let Some(scene) = &source.scene else { return Ok(Vec::new()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
    let pool = Arc::new(pool.build().map_err(|e| ReportError::Threads(e.to_string()))?);
    let studio = Studio::new(scene, options, pool);
    let row = |against, structure: &str, forms, samples, taken: &Taken, other: &Film| ImageRow {
        scene: source.name.clone(),
        against,
        structure: structure.to_owned(),
        forms,
        samples,
        size: studio.size,
        frame: taken.frame.clone(),
        update: taken.update.clone(),
        rays: taken.rays,
        difference: difference(&taken.film, other),
    };
    let mut rows = Vec::new();
    monitor.begin(&format!("{}: pictures", source.name))?;
    let exact = studio.take("bvh2", Forms::EXACT, 1, 0)?;
    // What handles one triangle after the other takes hours for a picture.
    let is_slow = |s: &AccelSpec| s.kind() == AccelKind::List || s.to_string().contains("form=flat");
    for spec in options.specs.iter().filter(|s| !is_slow(s)) {
        monitor.begin(&format!("{}: {spec}: pictures", source.name))?;
        let taken = studio.take(&spec.to_string(), Forms::EXACT, 1, 0)?;
        rows.push(row(Against::Exact, &spec.to_string(), Forms::EXACT, 1, &taken, &exact.film));
    }
    for forms in fast_forms() {
        monitor.begin(&format!("{}: {}: pictures", source.name, label(forms)))?;
        let taken = studio.take("bvh2", forms, 1, 0)?;
        rows.push(row(Against::Exact, "bvh2", forms, 1, &taken, &exact.film));
    }
    monitor.begin(&format!("{}: a converged picture", source.name))?;
    let many = studio.take("bvh2", Forms::EXACT, options.converged(), 1)?;
    for samples in [1, 2, 4, 8, 16] {
        monitor.begin(&format!("{}: {samples} samples", source.name))?;
        let taken = studio.take("bvh2", Forms::EXACT, samples, 0)?;
        rows.push(row(Against::Converged, "bvh2", Forms::EXACT, samples, &taken, &many.film));
    }
    Ok(rows)
}

/// Each step fast by itself, and all together.
fn fast_forms() -> [Forms; 5] {
    let (exact, fast) = (Forms::EXACT, Precision::Fast);
    [
        Forms { nodes: fast, ..exact },
        Forms { leaves: fast, ..exact },
        Forms { deform: fast, ..exact },
        Forms { offset: fast, ..exact },
        Forms::all(fast),
    ]
}

impl<'a> Studio<'a> {
    fn new(scene: &'a Arc<Scene>, options: &'a Options, pool: Arc<rayon::ThreadPool>) -> Self {
        let clip = first_clip(scene);
        let active = clip.map(|clip| middle(scene, clip, 0.0));
        let size = options.picture();
        let clips: Vec<ClipId> = active.iter().map(|a| a.clip).collect();
        let framing = || CameraView::framing(animation_bounds(scene, &clips), size[0] as f32 / size[1] as f32);
        let mut pose = crate::anim::Pose::rest(scene);
        pose.evaluate(scene, active.as_slice(), &DAffine3::IDENTITY);
        let own = CameraView::nodes(scene).first().and_then(|&node| CameraView::at_node(scene, &pose, node));
        Self { scene, active, camera: own.unwrap_or_else(framing), size, options, pool }
    }

    fn world(&self, accel: &str, forms: Forms) -> Result<(Arc<World>, StageTimes), ReportError> {
        let config = FrameConfig {
            accel: accel.to_owned(),
            top: "bvh2".to_owned(),
            policy: RebuildPolicy::Refit,
            forms,
            pool: self.pool.clone(),
        };
        let mut frames = FrameLoop::new(config)?;
        frames.add(self.scene.clone(), DAffine3::IDENTITY);
        // The frame before is made first, so that the times are those of a frame among others.
        let before = self.active.map(|a| ActiveClip { time_s: a.time_s - super::source::FRAME_S, ..a });
        drop(frames.advance(&[before.as_slice()])?);
        Ok(frames.advance(&[self.active.as_slice()])?)
    }

    fn take(&self, accel: &str, forms: Forms, samples: u32, seed: u64) -> Result<Taken, ReportError> {
        let settings = RenderSettings { samples, seed, simd: self.options.simd, ..RenderSettings::default() };
        let mut renderer = Renderer::new(std::slice::from_ref(self.scene));
        let mut taken = Taken {
            film: Film::new(self.size[0], self.size[1]),
            rays: 0,
            frame: Samples::default(),
            update: Samples::default(),
        };
        for _ in 0..self.options.repeats().min(3) {
            let (world, stages) = self.world(accel, forms)?;
            let start = std::time::Instant::now();
            let film = &mut taken.film;
            taken.rays = self.pool.install(|| renderer.render(&world, &self.camera, &settings, film))?;
            let update = stages.total().as_secs_f64();
            taken.update.push(update);
            taken.frame.push(update + start.elapsed().as_secs_f64());
        }
        Ok(taken)
    }
}

fn difference(a: &Film, b: &Film) -> Difference {
    let (mut sum, mut largest, mut pixels) = (0.0, 0.0_f64, 0);
    for (a, b) in a.color.iter().zip(&b.color) {
        pixels += u64::from(a.map(f32::to_bits) != b.map(f32::to_bits));
        for i in 0..3 {
            let d = f64::from(a[i]) - f64::from(b[i]);
            sum += d * d;
            largest = largest.max(d.abs());
        }
    }
    let [mut shown_a, mut shown_b] = [Vec::new(), Vec::new()];
    a.to_srgb8(&mut shown_a);
    b.to_srgb8(&mut shown_b);
    Difference {
        rmse: (sum / (3 * a.color.len()).max(1) as f64).sqrt(),
        flip: flip::mean(&shown_a, &shown_b, a.width as usize, a.height as usize),
        largest,
        pixels,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_films_differ_by_nothing_and_one_pixel_is_told() {
        let a = Film { color: vec![[0.5, 0.25, 0.0, 1.0]; 64], ..Film::new(8, 8) };
        assert_eq!(difference(&a, &a), Difference::default());
        let mut b = a.clone();
        b.color[9] = [0.5, 0.75, 0.0, 1.0];
        let d = difference(&a, &b);
        assert_eq!((d.pixels, d.largest), (1, 0.5));
        assert!((d.rmse - (0.25_f64 / 192.0).sqrt()).abs() < 1e-12 && d.flip > 0.0);
    }
}
