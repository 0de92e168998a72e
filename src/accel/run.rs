//! The queries as tasks, so that a structure's kernel is compiled once a level and sink, not at every place that asks.

use super::{
    Accel, AnyHit, Closest, Counter, HitSink, PACKET, TravRay,
    packet::{LanePacket, bits},
    wide::{coherent, packet::BlockTree},
};
use crate::{
    geom::{Forms, Hit, Ray, Triangles},
    glam::Vec3,
    simd::{Simd, Task},
};

/// [`Accel::closest`].
pub(super) struct ClosestTask<'a, A, C, K> {
    pub(super) accel: &'a A,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) ray: &'a TravRay,
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<A: Accel, C: Counter, K: HitSink> Task for ClosestTask<'_, A, C, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        self.accel.closest::<S, C, K>(self.prims, self.ray, self.best, self.sink, self.count);
    }
}

/// [`Accel::occluded`].
pub(super) struct OccludedTask<'a, A, C, K> {
    pub(super) accel: &'a A,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) ray: &'a TravRay,
    pub(super) sink: &'a K,
    pub(super) count: &'a mut C,
}

impl<A: Accel, C: Counter, K: HitSink> Task for OccludedTask<'_, A, C, K> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        self.accel.occluded::<S, C, K>(self.prims, self.ray, self.sink, self.count)
    }
}

/// The active rays of a packet, each by itself.
#[inline(always)]
pub(super) fn closest_singly<S: Simd, A: Accel, C: Counter, K: HitSink>(
    accel: &A,
    prims: &Triangles<'_>,
    rays: &[TravRay],
    active: u32,
    best: &mut [Closest],
    sinks: &[K],
    count: &mut C,
) {
    for i in bits(active) {
        let (ray, best, sink) = (&rays[i], &mut best[i], &sinks[i]);
        S::call(ClosestTask { accel, prims, ray, best, sink, count: &mut *count });
    }
}

/// As [`closest_singly`]: the bits of the rays that are blocked.
#[inline(always)]
pub(super) fn occluded_singly<S: Simd, A: Accel, C: Counter, K: HitSink>(
    accel: &A,
    prims: &Triangles<'_>,
    rays: &[TravRay],
    active: u32,
    sinks: &[K],
    count: &mut C,
) -> u32 {
    let mut blocked = 0;
    for i in bits(active) {
        let (ray, sink) = (&rays[i], &sinks[i]);
        blocked |= u32::from(S::call(OccludedTask { accel, prims, ray, sink, count: &mut *count })) << i;
    }
    blocked
}

/// [`Accel::closest_packet`].
pub(super) struct ClosestPacketTask<'a, A, C, K> {
    pub(super) accel: &'a A,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) rays: &'a [TravRay],
    pub(super) active: u32,
    pub(super) best: &'a mut [Closest],
    pub(super) sinks: &'a [K],
    pub(super) count: &'a mut C,
}

impl<A: Accel, C: Counter, K: HitSink> Task for ClosestPacketTask<'_, A, C, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { accel, prims, rays, active, best, sinks, count } = self;
        accel.closest_packet::<S, C, K>(prims, rays, active, best, sinks, count);
    }
}

/// [`Accel::occluded_packet`].
pub(super) struct OccludedPacketTask<'a, A, C, K> {
    pub(super) accel: &'a A,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) rays: &'a [TravRay],
    pub(super) active: u32,
    pub(super) sinks: &'a [K],
    pub(super) count: &'a mut C,
}

impl<A: Accel, C: Counter, K: HitSink> Task for OccludedPacketTask<'_, A, C, K> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self) -> u32 {
        let Self { accel, prims, rays, active, sinks, count } = self;
        accel.occluded_packet::<S, C, K>(prims, rays, active, sinks, count)
    }
}

/// [`Accel::closest_all`] by single rays or by packets.
#[inline(always)]
pub(super) fn closest_all<S: Simd, A: Accel>(
    accel: &A,
    prims: &Triangles<'_>,
    rays: &[Ray],
    packet: usize,
    forms: Forms,
    out: &mut [Option<Hit>],
) {
    if packet > 1 {
        for (rays, out) in rays.chunks(packet).zip(out.chunks_mut(packet)) {
            S::call(ClosestRaysTask { accel, prims, rays, forms, out });
        }
        return;
    }
    for (ray, out) in rays.iter().zip(out) {
        *out = closest_one::<S, A>(accel, prims, ray, forms);
    }
}

/// The closest hit of one ray.
#[inline(always)]
pub(super) fn closest_one<S: Simd, A: Accel>(accel: &A, prims: &Triangles<'_>, ray: &Ray, forms: Forms) -> Option<Hit> {
    let ray = TravRay::with_forms(ray, forms)?;
    let mut best = Closest::new(&ray);
    S::call(ClosestTask { accel, prims, ray: &ray, best: &mut best, sink: &AnyHit, count: &mut () });
    best.hit(&ray)
}

/// As [`closest_all`].
#[inline(always)]
pub(super) fn occluded_all<S: Simd, A: Accel>(
    accel: &A,
    prims: &Triangles<'_>,
    rays: &[Ray],
    packet: usize,
    forms: Forms,
    out: &mut [bool],
) {
    if packet > 1 {
        for (rays, out) in rays.chunks(packet).zip(out.chunks_mut(packet)) {
            S::call(OccludedRaysTask { accel, prims, rays, forms, out });
        }
        return;
    }
    for (ray, out) in rays.iter().zip(out) {
        *out = occluded_one::<S, A>(accel, prims, ray, forms);
    }
}

/// Whether one ray is blocked.
#[inline(always)]
pub(super) fn occluded_one<S: Simd, A: Accel>(accel: &A, prims: &Triangles<'_>, ray: &Ray, forms: Forms) -> bool {
    let Some(ray) = TravRay::with_forms(ray, forms) else { return false };
    S::call(OccludedTask { accel, prims, ray: &ray, sink: &AnyHit, count: &mut () })
}

/// A packet's rays; those that can hit nothing are replaced by a stand-in that is not active.
struct Together([TravRay; PACKET]);

impl Together {
    /// The rays, and the bits of those that can hit something.
    #[inline(always)]
    fn of(rays: &[Ray], forms: Forms) -> Option<(Self, u32)> {
        let mut out = Self([TravRay::with_forms(&Ray::new(Vec3::ZERO, Vec3::X), forms)?; PACKET]);
        let mut active = 0;
        for (i, ray) in rays.iter().enumerate() {
            if let Some(ray) = TravRay::with_forms(ray, forms) {
                out.0[i] = ray;
                active |= 1 << i;
            }
        }
        Some((out, active))
    }
}

/// The closest hits of a packet.
struct ClosestRaysTask<'a, A> {
    accel: &'a A,
    prims: &'a Triangles<'a>,
    rays: &'a [Ray],
    forms: Forms,
    out: &'a mut [Option<Hit>],
}

impl<A: Accel> Task for ClosestRaysTask<'_, A> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { accel, prims, rays, forms, out } = self;
        let Some((rays, active)) = Together::of(rays, forms) else { return };
        let mut best = [Closest::new(&rays.0[0]); PACKET];
        for (best, ray) in best.iter_mut().zip(&rays.0) {
            *best = Closest::new(ray);
        }
        let (count, sinks) = (out.len(), &[AnyHit; PACKET]);
        let (rays, best, sinks) = (&rays.0[..count], &mut best[..count], &sinks[..count]);
        S::call(ClosestPacketTask { accel, prims, rays, active, best, sinks, count: &mut () });
        for ((out, best), ray) in out.iter_mut().zip(best).zip(rays) {
            *out = best.hit(ray);
        }
    }
}

/// Whether the rays of a packet are blocked.
struct OccludedRaysTask<'a, A> {
    accel: &'a A,
    prims: &'a Triangles<'a>,
    rays: &'a [Ray],
    forms: Forms,
    out: &'a mut [bool],
}

impl<A: Accel> Task for OccludedRaysTask<'_, A> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { accel, prims, rays, forms, out } = self;
        let Some((rays, active)) = Together::of(rays, forms) else { return };
        let count = out.len();
        let (rays, sinks) = (&rays.0[..count], &[AnyHit; PACKET][..count]);
        let blocked = S::call(OccludedPacketTask { accel, prims, rays, active, sinks, count: &mut () });
        out.fill(false);
        for i in bits(blocked) {
            out[i] = true;
        }
    }
}

/// [`Accel::closest_all`].
pub(super) struct ClosestAllTask<'a, A> {
    pub(super) accel: &'a A,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) rays: &'a [Ray],
    pub(super) packet: usize,
    pub(super) forms: Forms,
    pub(super) out: &'a mut [Option<Hit>],
}

impl<A: Accel> Task for ClosestAllTask<'_, A> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        self.accel.closest_all::<S>(self.prims, self.rays, self.packet, self.forms, self.out);
    }
}

/// [`Accel::occluded_all`].
pub(super) struct OccludedAllTask<'a, A> {
    pub(super) accel: &'a A,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) rays: &'a [Ray],
    pub(super) packet: usize,
    pub(super) forms: Forms,
    pub(super) out: &'a mut [bool],
}

impl<A: Accel> Task for OccludedAllTask<'_, A> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        self.accel.occluded_all::<S>(self.prims, self.rays, self.packet, self.forms, self.out);
    }
}

/// [`AnyAccel::closest_lanes`](super::AnyAccel::closest_lanes).
pub(super) struct ClosestLanes<'a, T, K> {
    pub(super) tree: &'a T,
    pub(super) packet: &'a mut LanePacket,
    pub(super) open: u32,
    pub(super) sink: &'a K,
}

impl<T: BlockTree, K: HitSink> Task for ClosestLanes<'_, T, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, packet, open, sink } = self;
        let LanePacket { rays, nearest, tri } = packet;
        coherent::closest_in::<S, T, K>(tree, rays, open, nearest, tri, sink);
        nearest.leave(tree.blocks(), sink);
    }
}

/// [`AnyAccel::occluded_lanes`](super::AnyAccel::occluded_lanes).
pub(super) struct OccludedLanes<'a, T> {
    pub(super) tree: &'a T,
    pub(super) packet: &'a mut LanePacket,
    pub(super) open: u32,
}

impl<T: BlockTree> Task for OccludedLanes<'_, T> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self) -> u32 {
        let LanePacket { rays, tri, .. } = self.packet;
        coherent::occluded_in::<S, T>(self.tree, rays, self.open, tri)
    }
}
