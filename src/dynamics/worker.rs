//! One thread that takes jobs in order and hands back what came of each.

use std::collections::VecDeque;

use super::sync::{Arc, Condvar, Mutex, MutexGuard, thread};

/// The thread, and what it shares with its owner. Dropping it waits for the job under way, if any, and no more.
#[derive(Debug)]
pub(super) struct Worker<J, O> {
    shared: Arc<Shared<J, O>>,
    thread: Option<thread::JoinHandle<()>>,
    /// Jobs whose outcome has not been taken.
    in_flight: usize,
}

#[derive(Debug)]
struct Shared<J, O> {
    queue: Mutex<Queue<J, O>>,
    /// Jobs were added, or the end has come.
    jobs_changed: Condvar,
    /// Outcomes were added, or the thread is gone.
    outcomes_changed: Condvar,
}

#[derive(Debug)]
struct Queue<J, O> {
    jobs: VecDeque<J>,
    outcomes: VecDeque<O>,
    /// Nobody wants further outcomes.
    is_ended: bool,
    /// The thread makes no further outcomes.
    is_gone: bool,
}

impl<J: Send + 'static, O: Send + 'static> Worker<J, O> {
    /// Starts a thread of this name that does `work` for each job. `work` must not panic: the thread then ends.
    pub(super) fn start(name: &str, work: impl FnMut(J) -> O + Send + 'static) -> std::io::Result<Self> {
        let queue = Queue { jobs: VecDeque::new(), outcomes: VecDeque::new(), is_ended: false, is_gone: false };
        let shared = Arc::new(Shared {
            queue: Mutex::new(queue),
            jobs_changed: Condvar::new(),
            outcomes_changed: Condvar::new(),
        });
        let theirs = shared.clone();
        let thread = thread::Builder::new().name(name.to_owned()).spawn(move || serve(&theirs, work))?;
        Ok(Self { shared, thread: Some(thread), in_flight: 0 })
    }

    /// Hands over a job; never waits for one.
    pub(super) fn send(&mut self, job: J) {
        self.shared.lock().jobs.push_back(job);
        self.shared.jobs_changed.notify_one();
        self.in_flight += 1;
    }

    /// The next outcome if there is one; never waits for a job.
    pub(super) fn poll(&mut self) -> Option<O> {
        let outcome = self.shared.lock().outcomes.pop_front()?;
        self.in_flight -= 1;
        Some(outcome)
    }

    /// The next outcome, waiting for it; `None` when no job is in flight or the thread is gone.
    pub(super) fn wait(&mut self) -> Option<O> {
        if self.in_flight == 0 {
            return None;
        }
        let mut queue = self.shared.lock();
        while queue.outcomes.is_empty() && !queue.is_gone {
            queue = self.shared.outcomes_changed.wait(queue).expect("nobody panics with the queue");
        }
        let outcome = queue.outcomes.pop_front()?;
        self.in_flight -= 1;
        Some(outcome)
    }
}

impl<J, O> Drop for Worker<J, O> {
    fn drop(&mut self) {
        // What is dropped may be large, so it is dropped without the lock.
        let left = {
            let mut queue = self.shared.lock();
            queue.is_ended = true;
            std::mem::take(&mut queue.jobs)
        };
        self.shared.jobs_changed.notify_one();
        drop(left);
        if let Some(thread) = self.thread.take() {
            // A panic outside of the jobs cannot be reported from here.
            let _ = thread.join();
        }
    }
}

impl<J, O> Shared<J, O> {
    fn lock(&self) -> MutexGuard<'_, Queue<J, O>> {
        self.queue.lock().expect("nobody panics with the queue")
    }
}

/// Does jobs until the end.
fn serve<J, O>(shared: &Shared<J, O>, mut work: impl FnMut(J) -> O) {
    let _gone = Gone(shared);
    loop {
        let mut queue = shared.lock();
        while queue.jobs.is_empty() && !queue.is_ended {
            queue = shared.jobs_changed.wait(queue).expect("nobody panics with the queue");
        }
        if queue.is_ended {
            return;
        }
        let Some(job) = queue.jobs.pop_front() else { continue };
        drop(queue);
        let outcome = work(job);
        shared.lock().outcomes.push_back(outcome);
        shared.outcomes_changed.notify_one();
    }
}

/// Tells the owner that the thread ends, however it does.
struct Gone<'a, J, O>(&'a Shared<J, O>);

impl<J, O> Drop for Gone<'_, J, O> {
    fn drop(&mut self) {
        self.0.lock().is_gone = true;
        self.0.outcomes_changed.notify_one();
    }
}
