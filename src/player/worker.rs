//! The render thread: takes the newest job, refines while there is none, never makes the window wait.

use std::{
    collections::VecDeque,
    io,
    path::PathBuf,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
};

use super::request::{Job, Picture, Report, Shot, StillJob};

/// What does the work of the render thread.
pub(super) trait Engine: Send + 'static {
    /// A picture of one sample a pixel at the window's size over `divisor`; `None` when `stop` became true before
    /// it was done.
    ///
    /// # Errors
    /// When the scene cannot be traced, in words.
    fn draft(&mut self, shot: &Shot, divisor: u32, stop: &AtomicBool) -> Result<Option<Picture>, String>;

    /// The next picture of a refinement: the first of a shot (`restart`) or one with more samples; `None` as in
    /// [`Engine::draft`], with the refinement as it was before.
    ///
    /// # Errors
    /// As [`Engine::draft`].
    fn refine(&mut self, shot: &Shot, restart: bool, stop: &AtomicBool) -> Result<Option<Picture>, String>;

    /// Traces a still and writes it; the file it went to.
    ///
    /// # Errors
    /// Tracing or writing failed, in words.
    fn still(&mut self, job: &StillJob) -> Result<PathBuf, String>;

    /// Takes back the memory of a picture that is no longer shown.
    fn recycle(&mut self, rgba: Vec<u8>);
}

#[derive(Debug, Default)]
struct Inbox {
    job: Option<Job>,
    stills: VecDeque<StillJob>,
    spent: Vec<Vec<u8>>,
}

#[derive(Debug, Default)]
struct Mailbox {
    inbox: Mutex<Inbox>,
    changed: Condvar,
    /// There is something in the inbox: a refinement should let go.
    is_waited_for: AtomicBool,
    /// The window is gone: a draft should let go too.
    is_closed: AtomicBool,
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Inbox> {
        // The lock only ever guards plain moves, so a poisoned inbox is still whole.
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Inbox)) {
        let mut inbox = self.lock();
        change(&mut inbox);
        self.is_waited_for.store(true, Ordering::Relaxed);
        drop(inbox);
        self.changed.notify_one();
    }

    /// The next task; stills first. `None` ends the thread. Waits unless `may_refine`.
    fn next(&self, may_refine: bool, spent: &mut Vec<Vec<u8>>) -> Option<Task> {
        let mut inbox = self.lock();
        loop {
            spent.append(&mut inbox.spent);
            if let Some(still) = inbox.stills.pop_front() {
                // The rest of the inbox is still to be looked at.
                return Some(Task::Still(still));
            }
            if self.is_closed.load(Ordering::Relaxed) {
                return None;
            }
            self.is_waited_for.store(false, Ordering::Relaxed);
            if let Some(job) = inbox.job.take() {
                return Some(Task::Job(job));
            }
            if may_refine {
                return Some(Task::RefineOn);
            }
            inbox = self.changed.wait(inbox).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

enum Task {
    Job(Job),
    Still(StillJob),
    RefineOn,
}

/// The window's end of the render thread. Dropping it ends the thread after the stills that were asked for.
#[derive(Debug)]
pub(super) struct Worker {
    mailbox: Arc<Mailbox>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread over `engine`; `report` is called from it and must not block.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub(super) fn start(engine: impl Engine, report: impl Fn(Report) + Send + 'static) -> io::Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let inner = Arc::clone(&mailbox);
        let builder = std::thread::Builder::new().name("kinora-render".to_owned());
        let thread = builder.spawn(move || serve(&inner, engine, &report))?;
        Ok(Self { mailbox, thread: Some(thread) })
    }

    /// Asks for a picture in place of any asked for before.
    pub(super) fn post(&self, job: Job) {
        self.mailbox.change(|inbox| inbox.job = Some(job));
    }

    /// Asks for a still; it is made before anything else.
    pub(super) fn post_still(&self, still: StillJob) {
        self.mailbox.change(|inbox| inbox.stills.push_back(still));
    }

    /// Hands back the memory of a picture.
    pub(super) fn recycle(&self, rgba: Vec<u8>) {
        self.mailbox.lock().spent.push(rgba);
    }

    /// True when the thread is gone, which only a panic in it can cause.
    pub(super) fn is_dead(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.mailbox.change(|_| self.mailbox.is_closed.store(true, Ordering::Relaxed));
        if let Some(thread) = self.thread.take() {
            // A panic has been printed by its hook and noticed through `is_dead`.
            let _ = thread.join();
        }
    }
}

fn serve(mailbox: &Mailbox, mut engine: impl Engine, report: &impl Fn(Report)) {
    let mut refining = None;
    let mut has_begun = false;
    let mut spent = Vec::new();
    while let Some(task) = mailbox.next(refining.is_some(), &mut spent) {
        spent.drain(..).for_each(|rgba| engine.recycle(rgba));
        let result = match task {
            Task::Still(still) => {
                report(Report::Still(engine.still(&still)));
                continue;
            }
            Task::Job(Job::Draft(shot, divisor)) => {
                refining = None;
                engine.draft(&shot, divisor, &mailbox.is_closed)
            }
            Task::Job(Job::Refine(shot)) => {
                has_begun = false;
                engine.refine(refining.insert(shot), true, &mailbox.is_waited_for)
            }
            Task::RefineOn => match &refining {
                Some(shot) => engine.refine(shot, !has_begun, &mailbox.is_waited_for),
                None => continue,
            },
        };
        let Some(result) = result.transpose() else { continue };
        has_begun = true;
        if result.as_ref().map_or(true, |picture| picture.is_final) {
            refining = None;
        }
        report(match result {
            Ok(picture) => Report::Picture(Box::new(picture)),
            Err(reason) => Report::Failed(reason),
        });
    }
}

#[cfg(test)]
mod tests {
    use std::{
        sync::mpsc::{Receiver, channel},
        time::Duration,
    };

    use glam::DAffine3;

    use super::*;
    use crate::{
        geom::Aabb,
        player::request::{FrameTimes, StillFile, ViewSpec},
        render::{CameraView, Shading},
        scene::{Projection, Scene},
    };

    /// Reports what it is asked for as one-row pictures; waits for a token before each draft.
    struct Fake {
        gate: Option<Receiver<()>>,
        samples: u32,
        recycled: usize,
    }

    fn shot(time_s: f64) -> Shot {
        Shot {
            scene: Arc::new(Scene::default()),
            clips: [].into(),
            time_s,
            view: ViewSpec::Framed,
            shading: Shading::Direct,
            structure: "list".into(),
            width: 8,
            height: 1,
        }
    }

    impl Fake {
        fn picture(&self, shot: &Shot, divisor: u32, is_final: bool) -> Picture {
            let projection = Projection::Orthographic { x_mag: 1.0, y_mag: 1.0, z_near: 0.0, z_far: 1.0 };
            Picture {
                rgba: vec![0; self.recycled],
                width: shot.width,
                height: shot.height,
                shot: shot.clone(),
                divisor,
                samples: self.samples,
                is_final,
                times: FrameTimes::default(),
                rays: 0,
                counts: crate::dynamics::LoopCounts::default(),
                view: CameraView { world_from_camera: DAffine3::IDENTITY, projection },
                bounds: Aabb::EMPTY,
            }
        }
    }

    impl Engine for Fake {
        fn draft(&mut self, shot: &Shot, divisor: u32, _stop: &AtomicBool) -> Result<Option<Picture>, String> {
            if let Some(gate) = &self.gate {
                gate.recv().map_err(|_| "closed".to_owned())?;
            }
            if shot.time_s < 0.0 { Err("negative".to_owned()) } else { Ok(Some(self.picture(shot, divisor, true))) }
        }

        fn refine(&mut self, shot: &Shot, restart: bool, stop: &AtomicBool) -> Result<Option<Picture>, String> {
            // A time below zero stands for a pass that takes for ever.
            if shot.time_s < 0.0 {
                while !stop.load(Ordering::Relaxed) {
                    std::thread::yield_now();
                }
                return Ok(None);
            }
            self.samples = if restart { 1 } else { self.samples + 1 };
            Ok(Some(self.picture(shot, 1, self.samples == 4)))
        }

        fn still(&mut self, job: &StillJob) -> Result<PathBuf, String> {
            match &job.file {
                StillFile::Exact(path) => Ok(path.clone()),
                StillFile::Numbered(_) => Err("full".to_owned()),
            }
        }

        fn recycle(&mut self, _rgba: Vec<u8>) {
            self.recycled += 1;
        }
    }

    fn start(gate: Option<Receiver<()>>) -> (Worker, Receiver<Report>) {
        let (send, receive) = channel();
        let engine = Fake { gate, samples: 0, recycled: 0 };
        let worker = Worker::start(engine, move |report| send.send(report).unwrap_or(())).unwrap();
        (worker, receive)
    }

    fn next(receive: &Receiver<Report>) -> Report {
        receive.recv_timeout(Duration::from_secs(20)).expect("a report")
    }

    fn next_picture(receive: &Receiver<Report>) -> Picture {
        match next(receive) {
            Report::Picture(picture) => *picture,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn jobs_posted_while_one_runs_are_replaced_by_the_last() {
        let (open, gate) = channel();
        let (worker, receive) = start(Some(gate));
        worker.post(Job::Draft(shot(0.0), 1));
        while worker.mailbox.lock().job.is_some() {
            std::thread::yield_now();
        }
        for time in 1..=5 {
            worker.post(Job::Draft(shot(f64::from(time)), 2));
        }
        open.send(()).unwrap();
        open.send(()).unwrap();
        assert!(next_picture(&receive).shot.time_s < 0.5);
        assert!((next_picture(&receive).shot.time_s - 5.0).abs() < 1e-12);
        drop(open);
        drop(worker);
        assert!(receive.recv().is_err(), "nothing in between");
    }

    #[test]
    fn refinement_goes_on_until_it_is_final_and_then_rests() {
        let (worker, receive) = start(None);
        worker.post(Job::Refine(shot(1.0)));
        let samples: Vec<_> = (0..4).map(|_| next_picture(&receive).samples).collect();
        assert_eq!(samples, [1, 2, 3, 4]);
        assert!(receive.recv_timeout(Duration::from_millis(50)).is_err());
        worker.post(Job::Refine(shot(2.0)));
        assert_eq!(next_picture(&receive).samples, 1);
    }

    #[test]
    fn refining_pass_lets_go_for_a_job_a_still_and_the_end() {
        let (worker, receive) = start(None);
        worker.post(Job::Refine(shot(-1.0)));
        worker.post_still(StillJob { shot: shot(0.0), file: StillFile::Exact("a.png".into()) });
        assert!(matches!(next(&receive), Report::Still(Ok(_))));
        worker.post(Job::Draft(shot(2.0), 1));
        assert!((next_picture(&receive).shot.time_s - 2.0).abs() < 1e-12);
        worker.post(Job::Refine(shot(-1.0)));
        drop(worker);
        assert!(receive.recv().is_err());
    }

    #[test]
    fn stills_are_made_even_when_the_worker_is_dropped_at_once() {
        let (worker, receive) = start(None);
        let still = |file| StillJob { shot: shot(0.0), file };
        worker.post_still(still(StillFile::Exact("a.png".into())));
        worker.post_still(still(StillFile::Numbered("b".into())));
        drop(worker);
        assert!(matches!(next(&receive), Report::Still(Ok(path)) if path.ends_with("a.png")));
        assert!(matches!(next(&receive), Report::Still(Err(reason)) if reason == "full"));
    }

    #[test]
    fn failed_job_is_reported_and_the_next_one_still_runs() {
        let (worker, receive) = start(None);
        worker.post(Job::Draft(shot(-1.0), 1));
        assert!(matches!(next(&receive), Report::Failed(reason) if reason == "negative"));
        worker.post(Job::Draft(shot(3.0), 1));
        assert!((next_picture(&receive).shot.time_s - 3.0).abs() < 1e-12);
        assert!(!worker.is_dead());
    }

    #[test]
    fn memory_of_shown_pictures_goes_back_to_the_engine() {
        let (worker, receive) = start(None);
        worker.recycle(vec![1, 2]);
        worker.recycle(vec![3]);
        worker.post(Job::Draft(shot(0.0), 1));
        assert_eq!(next_picture(&receive).rgba.len(), 2);
    }
}
