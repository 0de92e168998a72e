//! Rays of common direction signs against eight boxes.

use super::{
    format::Format,
    kernel::{ClosestFrom, OccludedFrom},
    node::{EightNode, Link},
    tree::Tree8,
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        packet::PacketRays,
        query::SLACK,
        slabs::Slab,
        wide::{
            WIDTH,
            packet::{Entry, GROW, PacketTree, Spread, Start, Together, spreads},
            walk,
        },
    },
    geom::Triangles,
    simd::{Lanes, Simd},
};

/// `(plane - origin) * inv` of the first or the last ray to pass a plane.
#[derive(Clone, Copy)]
struct End<S: Simd> {
    origin: S::F8,
    inv: S::F8,
}

/// All rays by their bounds, and each of them by itself: [`Spread::ends`](crate::accel::wide::packet::Spread::ends) has the proof
/// of the first, and that of the second is at [`Slab`], lane by lane.
pub(in crate::accel) struct Packet<S: Simd> {
    /// By axis, entries and exits.
    ends: [[End<S>; 2]; 3],
    /// 1 where the rays run downward.
    backward: [usize; 3],
    all_near: S::F8,
    all_far: S::F8,
    active: u32,
    slabs: [Slab<S::F>; 3],
    near: S::F,
    limit: S::F,
}

impl<S: Simd> Packet<S> {
    #[inline(always)]
    fn new(packet: &PacketRays, (active, backward): (u32, [bool; 3])) -> Self {
        let [x, y, z] = spreads::<S>(packet, active);
        let ends = |spread: Spread, backward: bool| {
            let [entry, exit] = spread.ends(backward);
            [
                End { origin: S::F8::splat(entry.0), inv: S::F8::splat(entry.1) },
                End { origin: S::F8::splat(exit.0), inv: S::F8::splat(exit.1) },
            ]
        };
        Self {
            ends: [ends(x, backward[0]), ends(y, backward[1]), ends(z, backward[2])],
            backward: [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])],
            all_near: S::F8::splat(S::range(S::F::load(&packet.t_near32), active)[0]),
            all_far: S::F8::splat(S::range(S::F::load(&packet.t_cull), active)[1]),
            active,
            slabs: [packet.lines.slab::<S>(0), packet.lines.slab::<S>(1), packet.lines.slab::<S>(2)],
            near: S::F::load(&packet.t_near32),
            limit: S::F::load(&packet.t_cull),
        }
    }
}

impl<S: Simd, F: Format> Together<S, Tree8<F>> for Packet<S> {
    type Mark = ();
    type Kids = [f32; WIDTH];
    type Rays = S::F;

    #[inline(always)]
    fn kids() -> [f32; WIDTH] {
        [0.0; WIDTH]
    }

    #[inline(always)]
    fn all(&self, node: &F::Node, _mark: (), entries: &mut [f32; WIDTH]) -> u32 {
        let (mut near, mut far) = (self.all_near, self.all_far);
        for axis in 0..3 {
            let (side, [entry, exit]) = (self.backward[axis] & 1, &self.ends[axis]);
            let (first, last) = (node.planes::<S>(axis, side), node.planes::<S>(axis, side ^ 1));
            near = ((first - entry.origin) * entry.inv).max(near);
            far = ((last - exit.origin) * exit.inv).min(far);
        }
        near.store(entries);
        near.le(far.mul_add_loose(S::F8::splat(GROW), S::F8::splat(SLACK))) & node.present()
    }

    #[inline(always)]
    fn mark(_entries: &[f32; WIDTH], _slot: usize) {}

    #[inline(always)]
    fn key(entries: &[f32; WIDTH], slot: usize) -> u64 {
        walk::key32(entries[slot], slot)
    }

    #[inline(always)]
    fn each(&self, node: &F::Node, slot: usize, _near: &S::F) -> (u32, S::F) {
        let (mut near, mut far) = (self.near, self.limit);
        for axis in 0..3 {
            let (side, slab) = (self.backward[axis] & 1, &self.slabs[axis]);
            let (first, last) = (node.plane(axis, side, slot), node.plane(axis, side ^ 1, slot));
            near = S::F::splat(first).mul_add_loose(slab.entry_mul, slab.entry_add).max(near);
            far = S::F::splat(last).mul_add_loose(slab.exit_mul, slab.exit_add).min(far);
        }
        ((near - far).le(S::F::splat(SLACK)), near)
    }

    #[inline(always)]
    fn limit(&mut self, packet: &PacketRays) {
        self.limit = S::F::load(&packet.t_cull);
        self.all_far = S::F8::splat(S::range(S::F::load(&packet.t_cull), self.active)[1]);
    }

    #[inline(always)]
    fn reopened(&self, near: &mut S::F) -> u32 {
        (*near - self.limit).le(S::F::splat(SLACK))
    }

    #[inline(always)]
    fn meeting(&self, _block: &TriBlock, _near: &S::F) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    fn closest_below<C: Counter, K: HitSink>(
        tree: &Tree8<F>,
        (start, _, _): (Link, &S::F, usize),
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        S::call(ClosestFrom { tree, start, ray, best, sink, count });
    }

    #[inline(always)]
    fn occluded_below<C: Counter, K: HitSink>(
        tree: &Tree8<F>,
        (start, _, _): (Link, &S::F, usize),
        ray: (&TravRay, &Triangles<'_>),
        sink: &K,
        count: &mut C,
    ) -> bool {
        S::call(OccludedFrom { tree, start, ray, sink, count })
    }
}

impl<F: Format> PacketTree for Tree8<F> {
    type Packet<S: Simd> = Packet<S>;

    #[inline(always)]
    fn start<S: Simd>(&self, packet: &PacketRays, rays: (u32, [bool; 3])) -> Start<S, Self> {
        let together = Packet::<S>::new(packet, rays);
        let root = Entry { word: Self::root(), mask: rays.0, mark: (), rays: together.near };
        (together, Some(root))
    }
}

/// The children of a node that a packet of equal rays meets: as a whole, and the rays one by one.
#[cfg(test)]
#[inline(always)]
pub(super) fn met_together<S: Simd, F: Format>(ray: &TravRay, node: &F::Node, reach: f32) -> [u32; 2] {
    let rays = [*ray; 3];
    let dir = ray.range().dir;
    let signs = [dir.x < 0.0, dir.y < 0.0, dir.z < 0.0];
    let mut packet = PacketRays::new(&rays, reach);
    packet.prepare::<S>(crate::geom::Precision::Exact);
    let together = Packet::<S>::new(&packet, (7, signs));
    let mut entries = [0.0; WIDTH];
    let all = Together::<S, Tree8<F>>::all(&together, node, (), &mut entries) & 0xff;
    let mut each = 0;
    for slot in 0..WIDTH {
        let hits = Together::<S, Tree8<F>>::each(&together, node, slot, &together.near).0 & 7;
        assert!(hits == 0 || hits == 7, "{hits:b}");
        each |= (hits & 1) << slot;
    }
    [all, each & node.present()]
}
