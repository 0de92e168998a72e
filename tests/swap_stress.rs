//! Ten thousand frames and swaps: scenes exchanged while their trees are built, and memory that does not grow.
#![allow(missing_docs, clippy::pedantic, reason = "a test file")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
};

use kinora::{
    anim::ActiveClip,
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::Forms,
    glam::DAffine3,
    scene::ClipId,
};
use scenes::{bodies, burst};

#[path = "common/scenes.rs"]
#[allow(dead_code, unreachable_pub, reason = "shared with tests inside the crate")]
mod scenes;

static HELD: AtomicI64 = AtomicI64::new(0);

struct Weighing;

// SAFETY: every call is passed on unchanged to the system's allocator; weighing touches no memory of its own.
unsafe impl GlobalAlloc for Weighing {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HELD.fetch_add(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        HELD.fetch_add(size as i64 - layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.realloc(ptr, layout, size) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Weighing = Weighing;

fn begin(policy: RebuildPolicy) -> FrameLoop {
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap());
    let (accel, top) = ("bvh2".into(), "bvh2".into());
    FrameLoop::new(FrameConfig { accel, top, policy, forms: Forms::EXACT, pool }).unwrap()
}

fn at(frame: u32) -> [ActiveClip; 1] {
    [ActiveClip { clip: ClipId(0), time_s: f64::from(frame % 97) * 0.02 }]
}

/// Without optimisation a fifth of them.
const FRAMES: u32 = if cfg!(debug_assertions) { 2_000 } else { 10_000 };

#[test]
fn ten_thousand_frames_swap_trees_exchange_scenes_and_keep_the_memory_they_had() {
    let scenes = [burst(120), bodies(6), burst(60)].map(Arc::new);
    // Every tree is swapped; and as fast as the builder is, with what is stale dropped.
    for policy in [RebuildPolicy::SwapEvery(1), RebuildPolicy::Async] {
        let mut frames = begin(policy);
        for scene in &scenes[..2] {
            frames.add(scene.clone(), DAffine3::IDENTITY);
        }
        let mut held = Vec::new();
        for frame in 0..FRAMES {
            if frame % 53 == 7 {
                let actor = usize::from(frame % 2 == 1);
                frames.replace(actor, scenes[(frame / 53) as usize % 3].clone(), DAffine3::IDENTITY);
            }
            let clip = at(frame);
            let world = frames.advance(&[&clip, &clip]).unwrap().0;
            if frame % 500 == 499 {
                world.validate().unwrap();
            }
            drop(world);
            // Always at the same place in the round of scenes.
            if frame % (53 * 3 * 2) == 0 {
                held.push(HELD.load(Ordering::Relaxed));
            }
        }
        let counts = frames.counts();
        if policy == RebuildPolicy::Async {
            assert!(counts.rebuilds_begun > 10, "{counts:?}");
        } else {
            assert!(counts.swaps > u64::from(FRAMES), "{counts:?}");
            assert!(counts.rebuilds_dropped > u64::from(FRAMES) / 100, "{counts:?}");
        }
        assert!(counts.swaps + counts.rebuilds_dropped <= counts.rebuilds_begun, "{counts:?}");
        let half = held.len() / 2;
        let most = |held: &[i64]| held.iter().copied().max().unwrap();
        let (early, late) = (most(&held[2..half]), most(&held[half..]));
        assert!(late <= early + early / 10 + (64 << 10), "{policy}: {early} bytes early, {late} late");
    }
}
