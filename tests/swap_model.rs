//! The code that hands geometry and trees between threads, under a model checker: every interleaving of a few jobs and frames.
//!
//! The very files of `src/dynamics` are compiled here over loom's types.
#![allow(missing_docs, unreachable_pub, clippy::pedantic, reason = "a test file")]

mod sync {
    pub use loom::{
        sync::{Arc, Condvar, Mutex, MutexGuard},
        thread,
    };
}

#[path = "../src/dynamics/worker.rs"]
mod worker;

#[path = "../src/dynamics/pool.rs"]
#[allow(dead_code, reason = "the frame loop uses the rest")]
mod pool;

use std::panic::{AssertUnwindSafe, catch_unwind};

use pool::Pool;
use sync::{Arc, thread};
use worker::Worker;

/// A snapshot: every number is that of the frame.
type Snapshot = Arc<Vec<u64>>;

/// What a build looks at and makes: the frame, if all of the snapshot is of it.
fn build(snapshot: &Snapshot) -> u64 {
    assert!(snapshot.iter().all(|&number| number == snapshot[0]), "a snapshot changed under the builder: {snapshot:?}");
    snapshot[0]
}

#[test]
fn every_job_is_answered_once_and_in_order() {
    loom::model(|| {
        let mut worker = Worker::start("model", |job: u32| job * 10).unwrap();
        worker.send(1);
        let early = worker.poll();
        worker.send(2);
        let mut outcomes: Vec<u32> = early.into_iter().collect();
        while let Some(outcome) = worker.wait() {
            outcomes.push(outcome);
        }
        assert_eq!(outcomes, [10, 20]);
        assert!(worker.poll().is_none());
    });
}

#[test]
fn the_end_comes_with_jobs_waiting_and_takes_no_further_one() {
    loom::model(|| {
        let started = Arc::new(loom::sync::atomic::AtomicUsize::new(0));
        let theirs = started.clone();
        let mut worker = Worker::start("model", move |(): ()| {
            theirs.fetch_add(1, loom::sync::atomic::Ordering::SeqCst);
        })
        .unwrap();
        worker.send(());
        worker.send(());
        drop(worker);
        // Joined: what was begun is done, and nothing is begun later.
        let done = started.load(loom::sync::atomic::Ordering::SeqCst);
        assert!(done <= 2);
        assert_eq!(Arc::strong_count(&started), 1, "the thread is gone");
    });
}

#[test]
fn snapshots_are_never_written_while_a_builder_or_a_reader_holds_them() {
    loom::model(|| {
        let mut worker = Worker::start("model", |snapshot: Snapshot| build(&snapshot)).unwrap();
        let mut pool: Pool<Vec<u64>> = Pool::default();
        let mut reader = None;
        let mut swapped = Vec::new();
        for frame in 1..=3 {
            swapped.extend(worker.poll());
            let mut next = pool.take(|| vec![0; 2]);
            let numbers = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
            numbers.fill(frame);
            pool.keep(next.clone());
            if frame == 1 {
                worker.send(next);
            } else if frame == 2 {
                reader = Some(thread::spawn(move || build(&next)));
            }
        }
        assert_eq!(reader.unwrap().join().unwrap(), 2);
        while let Some(built) = worker.wait() {
            swapped.push(built);
        }
        assert_eq!(swapped, [1]);
    });
}

#[test]
fn a_tree_of_an_older_epoch_is_dropped_and_one_of_this_epoch_is_taken_whatever_the_timing() {
    loom::model(|| {
        let mut worker = Worker::start("model", |epoch: u64| epoch).unwrap();
        let (mut epoch, mut taken, mut dropped) = (1, Vec::new(), 0);
        worker.send(epoch);
        for frame in 0..2 {
            if frame == 1 {
                // The scene is exchanged while its tree is built.
                epoch = 2;
                worker.send(epoch);
            }
            while let Some(built) = if frame == 1 { worker.wait() } else { worker.poll() } {
                if built == epoch { taken.push(built) } else { dropped += 1 }
            }
        }
        assert!(taken.ends_with(&[2]) && taken.len() + dropped == 2, "{taken:?}, {dropped} dropped");
    });
}

#[test]
fn a_panic_in_a_job_is_an_outcome_and_the_next_job_is_done() {
    loom::model(|| {
        let work = |job: u32| catch_unwind(AssertUnwindSafe(|| if job == 1 { panic!("asked to") } else { job })).ok();
        let mut worker = Worker::start("model", work).unwrap();
        worker.send(1);
        worker.send(2);
        assert_eq!((worker.wait(), worker.wait(), worker.wait()), (Some(None), Some(Some(2)), None));
    });
}
