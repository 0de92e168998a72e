//! Rays, packets and refits allocate nothing in steady state.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicUsize, Ordering},
};

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, AnyHit, Closest, PACKET, Refit, TravRay},
    geom::{Ray, Triangles},
    glam::Vec3,
    simd::{Simd, SimdLevel, Task, dispatch},
};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator unchanged.
#[expect(unsafe_code, reason = "an allocator is an unsafe trait")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are those of `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are those of `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

struct Cast<'a> {
    accel: &'a AnyAccel,
    prims: Triangles<'a>,
    rays: &'a [Ray],
}

impl Task for Cast<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self) -> usize {
        let mut hits = 0;
        for rays in self.rays.as_chunks::<PACKET>().0 {
            let rays = rays.map(|r| TravRay::new(&r).expect("a ray"));
            let mut best = rays.each_ref().map(Closest::new);
            let sinks = [AnyHit; PACKET];
            self.accel.closest_packet::<S, _, _>(&self.prims, &rays, 0xffff, &mut best, &sinks, &mut ());
            hits += self.accel.occluded_packet::<S, _, _>(&self.prims, &rays, 0xffff, &sinks, &mut ()).count_ones()
                as usize;
            for ray in &rays {
                let mut best = Closest::new(ray);
                self.accel.closest::<S, _, _>(&self.prims, ray, &mut best, &AnyHit, &mut ());
                hits += usize::from(best.hit(ray).is_some());
            }
        }
        hits
    }
}

#[test]
fn rays_and_refits_allocate_nothing() {
    // A grid with every vertex, edge and diagonal aimed at: the exact arithmetic is part of the count.
    let side = 20_u32;
    let grid =
        |z: f32| (0..side * side).map(move |i| Vec3::new((i % side) as f32, (i / side) as f32, z * (i % 3) as f32));
    let poses: [Vec<Vec3>; 2] = [grid(0.0).collect(), grid(0.5).collect()];
    let indices: Vec<[u32; 3]> = (0..side - 1)
        .flat_map(|y| (0..side - 1).map(move |x| y * side + x))
        .flat_map(|a| [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]])
        .collect();
    let rays: Vec<Ray> =
        (0..512).map(|i| Ray::new(Vec3::new((i % 37) as f32 * 0.5, (i / 37) as f32 * 0.5, 5.0), -Vec3::Z)).collect();
    let prims = |pose: usize| Triangles { positions: &poses[pose], indices: &indices, topology_epoch: 1 };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    for &kind in AccelKind::ALL {
        let accel = AccelSpec::new(kind).build(&prims(0)).expect("a grid builds");
        let mut out = accel.clone();
        let refits = accel.refit_into(&mut out, &prims(0)) == Refit::Done;
        let mut frame = |pose: usize| {
            // What cannot be refitted stays in the first pose.
            let pose = if refits { pose } else { 0 };
            let refit = accel.refit_into(&mut out, &prims(pose));
            assert_eq!(refit == Refit::Done, refits, "{kind}");
            let cast = |level| dispatch(level, Cast { accel: &out, prims: prims(pose), rays: &rays });
            SimdLevel::available().map(cast).sum::<usize>()
        };
        pool.install(|| {
            let hits = [frame(0), frame(1)];
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            assert_eq!([frame(0), frame(1)], hits);
            let after = ALLOCATIONS.load(Ordering::Relaxed);
            assert_eq!(after - before, 0, "{kind}");
            assert!(hits[0] >= 2 * 512, "{hits:?}");
        });
    }
}
