//! Rays of common direction signs against eight boxes.

use super::{
    Bvh8,
    kernel::{ClosestFrom, Ends, GROW, OccludedFrom, slabs},
    node::{Link, Node},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        packet::{PacketRays, bits},
        query::{GROW as GROW_EACH, SHRINK, SLACK},
        wide::{
            WIDTH,
            packet::{self, Entry, FEW, Together, range, spreads},
            walk,
        },
    },
    simd::{Lanes, Simd},
};

/// All rays by their bounds, and each of them by itself: [`Spread::ends`](crate::accel::wide::packet::Spread::ends) has the proof
/// of the first, and that of the second is at `bvh2`'s node test, lane by lane.
struct Packet<S: Simd> {
    ends: Ends<S, false>,
    all_near: S::F8,
    all_far: S::F8,
    active: u32,
    origin: [S::F; 3],
    inv_near: [S::F; 3],
    inv_far: [S::F; 3],
    near: S::F,
    limit: S::F,
}

impl<S: Simd> Packet<S> {
    #[inline(always)]
    fn new(packet: &PacketRays, active: u32, backward: [bool; 3]) -> Self {
        let [x, y, z] = spreads::<S>(packet, active);
        let ends = [x.ends(backward[0]), y.ends(backward[1]), z.ends(backward[2])];
        let origin =
            |end: usize| [S::F8::splat(ends[0][end].0), S::F8::splat(ends[1][end].0), S::F8::splat(ends[2][end].0)];
        let inv =
            |end: usize| [S::F8::splat(ends[0][end].1), S::F8::splat(ends[1][end].1), S::F8::splat(ends[2][end].1)];
        let ends = Ends {
            near_inv: inv(0),
            near_offset: origin(0),
            far_inv: inv(1),
            far_offset: origin(1),
            backward: [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])],
        };
        let (one, shrink, grow) = (S::F::splat(1.0), S::F::splat(SHRINK), S::F::splat(GROW_EACH));
        let [dx, dy, dz] = &packet.dir32;
        let inv = [one / S::F::load(dx), one / S::F::load(dy), one / S::F::load(dz)];
        let [ox, oy, oz] = &packet.origin32;
        Self {
            ends,
            all_near: S::F8::splat(range(&packet.t_near32, active)[0]),
            all_far: S::F8::splat(range(&packet.t_cull, active)[1]),
            active,
            origin: [S::F::load(ox), S::F::load(oy), S::F::load(oz)],
            inv_near: [inv[0] * shrink, inv[1] * shrink, inv[2] * shrink],
            inv_far: [inv[0] * grow, inv[1] * grow, inv[2] * grow],
            near: S::F::load(&packet.t_near32),
            limit: S::F::load(&packet.t_cull),
        }
    }
}

impl<S: Simd> Together<S, Bvh8> for Packet<S> {
    type Mark = ();
    type Kids = [f32; WIDTH];
    type Rays = S::F;

    #[inline(always)]
    fn kids() -> [f32; WIDTH] {
        [0.0; WIDTH]
    }

    #[inline(always)]
    fn all(&self, node: &Node, _mark: (), entries: &mut [f32; WIDTH]) -> u32 {
        let (near, far) = slabs(node, &self.ends, self.all_near, self.all_far);
        near.store(entries);
        near.le(far.mul_add_loose(S::F8::splat(GROW), S::F8::splat(SLACK)))
    }

    #[inline(always)]
    fn mark(_entries: &[f32; WIDTH], _slot: usize) {}

    #[inline(always)]
    fn key(entries: &[f32; WIDTH], slot: usize) -> u64 {
        walk::key32(entries[slot], slot)
    }

    #[inline(always)]
    fn each(&self, node: &Node, slot: usize, _near: &S::F) -> (u32, S::F) {
        let (mut near, mut far) = (self.near, self.limit);
        for axis in 0..3 {
            let side = self.ends.backward[axis] & 1;
            let entry = S::F::splat(node.planes[axis][side][slot]) - self.origin[axis];
            let exit = S::F::splat(node.planes[axis][side ^ 1][slot]) - self.origin[axis];
            near = (entry * self.inv_near[axis]).max(near);
            far = (exit * self.inv_far[axis]).min(far);
        }
        ((near - far).le(S::F::splat(SLACK)), near)
    }

    #[inline(always)]
    fn limit(&mut self, packet: &PacketRays) {
        self.limit = S::F::load(&packet.t_cull);
        self.all_far = S::F8::splat(range(&packet.t_cull, self.active)[1]);
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
        tree: &Bvh8,
        (start, _, _): (Link, &S::F, usize),
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        S::call(ClosestFrom { tree, start, ray, best, sink, count });
    }

    #[inline(always)]
    fn occluded_below<C: Counter, K: HitSink>(
        tree: &Bvh8,
        (start, _, _): (Link, &S::F, usize),
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        S::call(OccludedFrom { tree, start, ray, sink, count })
    }
}

impl Bvh8 {
    #[inline(always)]
    pub(super) fn walk_closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        for (start, end, mut left) in packet::lanes::<S>(rays.len(), active) {
            let (rays, best, sinks) = (&rays[start..end], &mut best[start..end], &sinks[start..end]);
            while left != 0 {
                let (members, backward) = packet::group(|ray| self.is_ordinary(ray), rays, left);
                left &= !members;
                if members.count_ones() > FEW {
                    self.closest_together::<S, C, K>(rays, members, backward, best, sinks, count);
                } else {
                    for i in bits(members) {
                        self.walk_closest::<S, C, K>(&rays[i], &mut best[i], &sinks[i], count);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn closest_together<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        mask: u32,
        backward: [bool; 3],
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        let mut packet = PacketRays::new(rays, self.reach);
        for (i, best) in best.iter().enumerate() {
            packet.set_limit(i, best);
        }
        let together = Packet::<S>::new(&packet, mask, backward);
        let start = Entry { word: Self::root(), mask, mark: (), rays: together.near };
        packet::closest::<S, _, _, C, K>(self, together, start, rays, &mut packet, (best, sinks), count);
    }

    /// The active rays that something blocks.
    #[inline(always)]
    pub(super) fn walk_occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        let mut blocked = 0;
        for (start, end, mut left) in packet::lanes::<S>(rays.len(), active) {
            let (rays, sinks) = (&rays[start..end], &sinks[start..end]);
            while left != 0 {
                let (members, backward) = packet::group(|ray| self.is_ordinary(ray), rays, left);
                left &= !members;
                if members.count_ones() > FEW {
                    let packet = PacketRays::new(rays, self.reach);
                    let together = Packet::<S>::new(&packet, members, backward);
                    let root = Entry { word: Self::root(), mask: members, mark: (), rays: together.near };
                    let hits = packet::occluded::<S, _, _, C, K>(self, &together, root, rays, &packet, sinks, count);
                    blocked |= hits << start;
                } else {
                    for i in bits(members) {
                        let hit = self.walk_occluded::<S, C, K>(&rays[i], &sinks[i], count);
                        blocked |= u32::from(hit) << (start + i);
                    }
                }
            }
        }
        blocked
    }
}

/// The children of a node that a packet of equal rays meets: as a whole, and the rays one by one.
#[cfg(test)]
#[inline(always)]
pub(super) fn met_together<S: Simd>(ray: &TravRay, node: &Node) -> [u32; 2] {
    let rays = [*ray; 3];
    let dir = ray.range().dir;
    let together = Packet::<S>::new(&PacketRays::new(&rays, 0.0), 7, [dir.x < 0.0, dir.y < 0.0, dir.z < 0.0]);
    let mut entries = [0.0; WIDTH];
    let all = together.all(node, (), &mut entries);
    let mut each = 0;
    for slot in 0..WIDTH {
        let hits = together.each(node, slot, &together.near).0 & 7;
        assert!(hits == 0 || hits == 7, "{hits:b}");
        each |= (hits & 1) << slot;
    }
    [all, each]
}
