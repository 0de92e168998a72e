//! Frames in steady state allocate nothing: pose, deform, refit and rays.
//!
//! One test function, since the count is of the whole process.
#![allow(missing_docs, reason = "a test file")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use kinora::{
    anim::ActiveClip,
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::{Forms, Ray},
    glam::{DAffine3, Vec3},
    scene::{ClipId, Scene, import},
    simd::{Simd, SimdLevel, Task, dispatch},
    world::{TopKind, World},
};
use scenes::{bodies, figure};

mod common;
#[path = "common/scenes.rs"]
#[allow(dead_code, unreachable_pub, clippy::pedantic, reason = "shared with tests inside the crate")]
mod scenes;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

struct Counting;

// SAFETY: every call is passed on unchanged to the system's allocator; counting touches no memory of its own.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.realloc(ptr, layout, size) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A grid of rays through the world's box; the number of hits and of blocked rays.
struct Trace<'a>(&'a World);

impl Task for Trace<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self) -> usize {
        let bounds = self.0.bounds();
        let eye = bounds.center() + Vec3::new(0.3, 0.2, 1.0) * bounds.diagonal();
        let ray = |i: u16| {
            let place = Vec3::new(f32::from(i % 8) / 7.0, f32::from(i / 8) / 7.0, 0.5);
            Ray::new(eye, bounds.min + bounds.extent() * place - eye)
        };
        let hit = |ray: &Ray| self.0.closest_hit::<S, _>(ray, &|_| true);
        (0..32).map(ray).map(|r| usize::from(hit(&r).is_some()) + usize::from(self.0.is_blocked::<S>(&r))).sum()
    }
}

fn advance(frames: &mut FrameLoop, frame: u16) -> usize {
    let clip = [ActiveClip { clip: ClipId(0), time_s: f64::from(frame % 48) / 24.0 }];
    let clips: [&[ActiveClip]; 2] = [&clip, &clip];
    let (world, _) = frames.advance(&clips).unwrap();
    let hits = dispatch(SimdLevel::best(), Trace(&world));
    let clone = world.clone();
    assert!(world.group_count() > 0 && clone.triangle_count() > 0);
    hits
}

/// Allocations of frames 100 to 199 of a loop over `scenes`.
fn steady_allocations(top: &str, policy: RebuildPolicy, inside: bool, scenes: &[Arc<Scene>]) -> u64 {
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap());
    let config = FrameConfig { accel: "bvh2".into(), top: top.into(), policy, forms: Forms::EXACT, pool: pool.clone() };
    let mut frames = FrameLoop::new(config).unwrap();
    for scene in scenes {
        frames.add(scene.clone(), DAffine3::IDENTITY);
    }
    let mut measure = || {
        let mut hits: usize = (0..100).map(|frame| advance(&mut frames, frame)).sum();
        let refits = frames.counts().refits;
        let begun = frames.counts().rebuilds_begun;
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        hits += (100..200).map(|frame| advance(&mut frames, frame)).sum::<usize>();
        let allocations = ALLOCATIONS.load(Ordering::Relaxed) - before;
        assert!(hits > 100, "{hits}");
        assert!(frames.counts().refits >= refits + 90, "the frames must move");
        assert_eq!(frames.counts().rebuilds_begun, begun, "a walk does not decay");
        allocations
    };
    if inside { pool.install(measure) } else { measure() }
}

#[test]
fn frames_in_steady_state_allocate_nothing() {
    let mut casts = vec![vec![Arc::new(figure(100)), Arc::new(bodies(12))]];
    if let Some(shared) = common::shared_dir() {
        let man = import::from_path(&shared.join("assets/khronos/CesiumMan/glTF-Binary/CesiumMan.glb")).unwrap();
        casts.push(vec![Arc::new(man)]);
    }
    for (cast, scenes) in casts.iter().enumerate() {
        for top in TopKind::ALL.map(TopKind::name) {
            let inside = steady_allocations(top, RebuildPolicy::Refit, true, scenes);
            assert_eq!(inside, 0, "{top}");
        }
        // From outside of the pool each frame is one job of rayon's queue, which takes a block for every 63.
        if cast == 0 {
            let outside = steady_allocations("bvh2", RebuildPolicy::Refit, false, scenes);
            assert!(outside <= 4, "{outside}");
        }
    }
}
