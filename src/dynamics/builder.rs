//! The background builder: one thread that builds trees from snapshots of the geometry.
//!
//! It is no rayon worker, and builds run in a pool of one thread of its own, so that it never takes more than
//! one core from the frames. A snapshot is the shared buffer itself, never a copy.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
};

use crossbeam::channel::{Receiver, Sender, TryRecvError, unbounded};
use glam::Vec3;

use crate::{
    accel::{AccelSpec, AnyAccel, BuildError},
    world::GroupLayout,
};

/// What to build: a group's triangles and their vertices at some frame.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) layout: Arc<GroupLayout>,
    pub(super) positions: Arc<Vec<Vec3>>,
    /// The frame that the snapshot is of.
    pub(super) frame: u64,
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
    /// The vertices that it was built from.
    pub(super) positions: Arc<Vec<Vec3>>,
    /// The frame that they are of.
    pub(super) frame: u64,
}

/// Why a job gave no tree.
#[derive(Debug)]
pub(super) enum Failure {
    Build(BuildError),
    Panicked(String),
}

/// The thread and the channels to it. Dropping it waits for the build under way, if any, and no more.
#[derive(Debug)]
pub(super) struct Builder {
    jobs: Option<Sender<Job>>,
    outcomes: Receiver<Outcome>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Jobs whose outcome has not been taken.
    in_flight: usize,
}

impl Builder {
    /// Starts the thread, which builds what `spec` says.
    pub(super) fn start(spec: Arc<AccelSpec>) -> std::io::Result<Self> {
        let (jobs, job_queue) = unbounded();
        let (outcome_queue, outcomes) = unbounded();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "kinora-build".to_owned())
            .build()
            .map_err(std::io::Error::other)?;
        let thread = std::thread::Builder::new().name("kinora-rebuild".to_owned()).spawn(move || {
            for job in job_queue {
                if stopped.load(Ordering::Relaxed) {
                    break;
                }
                if outcome_queue.send(run(&pool, &spec, job)).is_err() {
                    break;
                }
            }
        })?;
        Ok(Self { jobs: Some(jobs), outcomes, stop, thread: Some(thread), in_flight: 0 })
    }

    /// Hands over a job.
    pub(super) fn send(&mut self, job: Job) {
        let sender = self.jobs.as_ref().expect("open until dropped");
        sender.send(job).expect("the thread lives until dropped: builds are caught");
        self.in_flight += 1;
    }

    /// The next outcome if there is one.
    pub(super) fn poll(&mut self) -> Option<Outcome> {
        match self.outcomes.try_recv() {
            Ok(outcome) => {
                self.in_flight -= 1;
                Some(outcome)
            }
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => None,
        }
    }

    /// The next outcome, waiting for it; `None` when nothing is in flight.
    pub(super) fn wait(&mut self) -> Option<Outcome> {
        if self.in_flight == 0 {
            return None;
        }
        let outcome = self.outcomes.recv().expect("the thread answers every job: builds are caught");
        self.in_flight -= 1;
        Some(outcome)
    }
}

impl Drop for Builder {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A panic outside of a build cannot be reported from here.
            let _ = thread.join();
        }
    }
}

fn run(pool: &rayon::ThreadPool, spec: &AccelSpec, job: Job) -> Outcome {
    let prims = job.layout.indices.len();
    let _span = tracing::info_span!("rebuild", frame = job.frame, accel = spec.kind().name(), prims).entered();
    let epoch = job.layout.topology_epoch;
    let build = || {
        #[cfg(test)]
        assert!(!job.panic, "asked to panic");
        pool.install(|| spec.build(&job.layout.triangles(&job.positions)))
    };
    let result = match catch_unwind(AssertUnwindSafe(build)) {
        Ok(Ok(accel)) => Ok(Built { accel, positions: job.positions, frame: job.frame }),
        Ok(Err(error)) => Err(Failure::Build(error)),
        Err(panic) => Err(Failure::Panicked(message(panic.as_ref()))),
    };
    Outcome { epoch, result }
}

fn message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_owned())
}
