//! Structures over the boxes of a database's objects, cast, counted and timed.

use rayon::ThreadPoolBuilder;

use super::{
    Options,
    objects::Solids,
    spd::{BoxTree, LeastTests, Naive, RayCounts, RaySet, Rules, Tracer, WalkCounts, Walker},
};
use crate::{
    accel::{
        events::{EventBoxes, EventsConfig, Form},
        grid::{BoxGrid, GridConfig, Resolution},
    },
    report::{
        ReportError,
        measure::{Samples, Stopwatch},
    },
    scene::spd::{SpdKind, SpdScene},
};

/// A way to find the objects that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Structure {
    /// Every object for every ray.
    Naive,
    /// Three sorted lists.
    Flat,
    /// The hierarchy of sorted lists.
    Tree,
    /// A uniform grid of 30 x 30 x 30 cells.
    Grid30,
    /// A uniform grid by Woo's rule, ten cells an object.
    GridWoo,
}

impl Structure {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Naive => "naive",
            Self::Flat => "lists, flat",
            Self::Tree => "lists, hierarchy",
            Self::Grid30 => "grid 30x30x30",
            Self::GridWoo => "grid, density 10",
        }
    }

    pub(super) fn is_list(self) -> bool {
        matches!(self, Self::Flat | Self::Tree)
    }

    /// True when a ray's time grows with all objects.
    fn is_linear(self) -> bool {
        matches!(self, Self::Naive | Self::Flat)
    }
}

/// A database's objects with what they are measured by.
pub(super) struct OverBoxes {
    scene: SpdScene,
    solids: Solids,
}

/// What a structure did for a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) rays: RayCounts,
    pub(super) counts: WalkCounts,
    /// Fewest tests a ray that the boxes allow.
    pub(super) fewest: f64,
    /// Processor time a ray, of one thread.
    pub(super) seconds: f64,
}

impl Run {
    /// A count over all rays.
    pub(super) fn per_ray(&self, count: u64) -> f64 {
        count as f64 / self.rays.all().rays.max(1) as f64
    }

    /// Objects tested a ray.
    pub(super) fn tests(&self) -> f64 {
        self.per_ray(self.counts.tests)
    }
}

impl OverBoxes {
    /// # Errors
    /// When there is no such size.
    pub(super) fn new(kind: SpdKind, size: u32) -> Result<Self, ReportError> {
        let failed = |e: &dyn ToString| ReportError::Scene {
            scene: format!("spd-{}:{size}", kind.name()),
            reason: e.to_string(),
        };
        let scene = kind.generate(size).map_err(|e| failed(&e))?;
        Ok(Self { solids: Solids::new(&scene), scene })
    }

    pub(super) fn name(&self) -> String {
        format!("spd-{}:{}", self.scene.kind.name(), self.scene.size)
    }

    pub(super) fn kind(&self) -> SpdKind {
        self.scene.kind
    }

    pub(super) fn objects(&self) -> usize {
        self.solids.boxes().len()
    }

    /// Casts a picture's rays. Structures whose rays cost in proportion to all objects get smaller pictures of many objects.
    ///
    /// # Errors
    /// When the structure cannot be built.
    pub(super) fn run(&self, structure: Structure, set: RaySet, options: Options) -> Result<Run, ReportError> {
        let (most, work) = if options.quick { (48, 4e6) } else { (160, 1e8) };
        let affordable = (work / self.objects().max(1) as f64).sqrt();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a picture's side")]
        let pixels = if structure.is_linear() { affordable.clamp(12.0, f64::from(most)) as u32 } else { most };
        self.picture(structure, (pixels, set), options.repeats(), Rules::Readme)
    }

    /// Casts a picture's rays, timed as often as asked for.
    ///
    /// # Errors
    /// When the structure cannot be built.
    pub(super) fn picture(
        &self,
        structure: Structure,
        picture: (u32, RaySet),
        repeats: usize,
        rules: Rules,
    ) -> Result<Run, ReportError> {
        let boxes = self.solids.boxes();
        let lists =
            |form| EventBoxes::build(boxes.len(), |i| boxes[i as usize], &EventsConfig { form, ..Default::default() });
        let grid = |resolution| BoxGrid::build(boxes, &GridConfig { resolution, ..Default::default() });
        let job = Job { over: self, picture, repeats, rules };
        match structure {
            Structure::Naive => job.cast(&Naive::new(boxes)),
            Structure::Flat => job.cast(&lists(Form::Flat)?),
            Structure::Tree => job.cast(&lists(Form::Tree)?),
            Structure::Grid30 => job.cast(&grid(Resolution::Cells([30; 3]))?),
            Structure::GridWoo => job.cast(&grid(Resolution::Density(10.0))?),
        }
    }

    /// Rays alone, found by a binary tree of boxes.
    pub(super) fn rays(&self, picture: (u32, RaySet), rules: Rules) -> RayCounts {
        let tree = BoxTree::new(self.solids.boxes());
        Tracer::new(&self.scene, &self.solids, &tree, rules, picture).trace::<()>().0
    }
}

struct Job<'a> {
    over: &'a OverBoxes,
    picture: (u32, RaySet),
    repeats: usize,
    rules: Rules,
}

impl Job<'_> {
    fn cast<W: Walker>(&self, walker: &W) -> Result<Run, ReportError> {
        let Self { over: OverBoxes { scene, solids }, picture, repeats, rules } = *self;
        let tracer = Tracer::new(scene, solids, walker, rules, picture);
        let (rays, counts) = tracer.trace::<WalkCounts>();
        let least = LeastTests::new(solids.boxes());
        let (_, fewest) = Tracer::new(scene, solids, &least, rules, picture).trace::<WalkCounts>();
        let all = rays.all().rays.max(1) as f64;
        let mut samples = Samples::default();
        if repeats > 0 {
            let pool = ThreadPoolBuilder::new().num_threads(1).build();
            let pool = pool.map_err(|e| ReportError::Threads(e.to_string()))?;
            for _ in 0..repeats {
                samples.push(pool.install(|| {
                    let watch = Stopwatch::thread();
                    tracer.trace::<()>();
                    watch.seconds()
                }));
            }
        }
        let seconds = samples.median().unwrap_or(f64::NAN) / all;
        Ok(Run { rays, counts, fewest: fewest.nodes as f64 / all, seconds })
    }
}
