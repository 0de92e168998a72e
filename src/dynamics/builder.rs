//! The background builder: one thread that builds trees from snapshots of the geometry.
//!
//! It is no rayon worker, and builds run in a pool of one thread of its own, so that it never takes more than
//! one core from the frames. A snapshot is the shared buffer itself, never a copy.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use glam::Vec3;

use super::worker::Worker;
use crate::{
    accel::{AccelSpec, AnyAccel, BuildError},
    world::GroupLayout,
};

/// What to build: a group's triangles and their vertices at some frame.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) layout: Arc<GroupLayout>,
    pub(super) positions: Arc<Vec<Vec3>>,
    /// The vertices a frame earlier, if they moved since.
    pub(super) before: Option<Arc<Vec<Vec3>>>,
    /// By how many frames of such motion the tree shall be ahead.
    pub(super) ahead: f32,
    /// The frame that the snapshot is of.
    pub(super) frame: u64,
    /// The tree is to be swapped in only if it is no worse than the one in use.
    pub(super) on_trial: bool,
    /// A tree that is ready soon is wanted more than a good one.
    pub(super) is_fast: bool,
    /// Panic instead of building.
    #[cfg(test)]
    pub(super) panic: bool,
}

/// What came of a job.
#[derive(Debug)]
pub(super) struct Outcome {
    /// The topology epoch of the job's layout.
    pub(super) epoch: u64,
    pub(super) result: Result<Built, Failure>,
}

/// A finished rebuild.
#[derive(Debug)]
pub(super) struct Built {
    pub(super) accel: AnyAccel,
    /// The vertices that it was built from, if they are those of a frame.
    pub(super) positions: Option<Arc<Vec<Vec3>>>,
    /// The frame that they are of.
    pub(super) frame: u64,
    /// As the job's, of trees that are ahead.
    pub(super) on_trial: bool,
    /// It was built by the fast builder.
    pub(super) is_fast: bool,
}

/// Why a job gave no tree.
#[derive(Debug)]
pub(super) enum Failure {
    Build(BuildError),
    Panicked(String),
}

/// The thread and what it builds with. Dropping it waits for the build under way, if any, and no more.
pub(super) type Builder = Worker<Job, Outcome>;

/// Starts the thread, which builds what `spec` says, or in haste what its fast form says.
pub(super) fn start(spec: Arc<AccelSpec>) -> std::io::Result<Builder> {
    let fast = spec.fast();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .thread_name(|_| "kinora-build".to_owned())
        .build()
        .map_err(std::io::Error::other)?;
    let mut expected = Vec::new();
    Worker::start("kinora-rebuild", move |job: Job| {
        let fast = fast.as_ref().filter(|_| job.is_fast);
        run(&pool, fast.unwrap_or(&spec), fast.is_some(), job, &mut expected)
    })
}

fn run(pool: &rayon::ThreadPool, spec: &AccelSpec, is_fast: bool, job: Job, expected: &mut Vec<Vec3>) -> Outcome {
    let prims = job.layout.indices.len();
    let _span = tracing::info_span!("rebuild", frame = job.frame, accel = spec.kind().name(), prims).entered();
    let epoch = job.layout.topology_epoch;
    let before = job.before.as_ref().filter(|before| job.ahead > 0.0 && before.len() == job.positions.len());
    let build = || {
        #[cfg(test)]
        assert!(!job.panic, "asked to panic");
        let positions = match before {
            Some(before) => {
                expect(before, &job.positions, job.ahead, expected);
                &expected[..]
            }
            None => &job.positions[..],
        };
        pool.install(|| spec.build(&job.layout.triangles(positions)))
    };
    let result = match catch_unwind(AssertUnwindSafe(build)) {
        Ok(Ok(accel)) => Ok(Built {
            accel,
            on_trial: job.on_trial && before.is_some(),
            is_fast,
            positions: before.is_none().then_some(job.positions),
            frame: job.frame,
        }),
        Ok(Err(error)) => Err(Failure::Build(error)),
        Err(panic) => Err(Failure::Panicked(message(panic.as_ref()))),
    };
    Outcome { epoch, result }
}

/// Where vertices will be when they go on as they did from one frame to the next: the tree will be in use then. Only its topology comes of it.
fn expect(before: &[Vec3], now: &[Vec3], frames: f32, out: &mut Vec<Vec3>) {
    out.clear();
    out.extend(before.iter().zip(now).map(|(&before, &now)| {
        let then = now + (now - before) * frames;
        if then.is_finite() { then } else { now }
    }));
}

fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_owned())
}
