use arrayvec::ArrayVec;

use super::{
    Bvh2, MAX_DEPTH,
    node::{Link, Pair},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        packet::{PACKET, PacketRays},
        query::SLACK,
        run,
        slabs::{self, Extent, Slab},
    },
    geom::{Precision, Triangles},
    simd::{Lanes, Simd},
};

/// Rays of common direction signs, one to a lane, against single boxes. The proof at [`Slab`] holds lane by lane.
struct PacketNode<S: Simd> {
    slabs: [Slab<S::F>; 3],
    backward: [bool; 3],
    t_near: S::F,
    limit: S::F,
}

impl<S: Simd> PacketNode<S> {
    #[inline(always)]
    fn new(packet: &PacketRays, reach: f32, nodes: Precision) -> Self {
        let (origin, dir) = (load3::<S>(&packet.origin32), load3::<S>(&packet.dir32));
        let extent = Extent::new(origin, dir, reach);
        Self {
            slabs: [
                Slab::new(origin[0], dir[0], &extent, nodes),
                Slab::new(origin[1], dir[1], &extent, nodes),
                Slab::new(origin[2], dir[2], &extent, nodes),
            ],
            backward: [packet.dir32[0][0] < 0.0, packet.dir32[1][0] < 0.0, packet.dir32[2][0] < 0.0],
            t_near: S::F::load(&packet.t_near32),
            limit: S::F::load(&packet.t_cull),
        }
    }

    /// Rays that may meet a child's box, and where each enters it, rounded down.
    #[inline(always)]
    fn test(&self, pair: &Pair, child: usize) -> (u32, S::F) {
        let (mut near, mut far) = (self.t_near, self.limit);
        for axis in 0..3 {
            let (entry, exit) = if self.backward[axis] { (child + 2, child) } else { (child, child + 2) };
            let (entry, exit) = (S::F::splat(pair.planes[axis][entry]), S::F::splat(pair.planes[axis][exit]));
            let slab = &self.slabs[axis];
            near = entry.mul_add_loose(slab.entry_mul, slab.entry_add).max(near);
            far = exit.mul_add_loose(slab.exit_mul, slab.exit_add).min(far);
        }
        ((near - far).le(S::F::splat(SLACK)), near)
    }
}

/// A child to visit: which rays meet its box, and where.
#[derive(Clone, Copy)]
struct Entry<S: Simd> {
    link: Link,
    mask: u32,
    near: S::F,
}

/// Children to visit; at most one a level, and the builder bounds the depth.
type Stack<S> = ArrayVec<Entry<S>, MAX_DEPTH>;

#[inline(always)]
fn load3<S: Simd>(rows: &[[f32; PACKET]; 3]) -> [S::F; 3] {
    [S::F::load(&rows[0]), S::F::load(&rows[1]), S::F::load(&rows[2])]
}

/// True when the rays' directions agree in sign on every axis.
#[inline(always)]
fn agree(rays: &[TravRay]) -> bool {
    let (mut all, mut any) = (7, 0);
    for ray in rays {
        // There is no -0 here.
        let dir = ray.range().dir;
        let signs = (dir.x.to_bits() >> 31) | (dir.y.to_bits() >> 31) << 1 | (dir.z.to_bits() >> 31) << 2;
        all &= signs;
        any |= signs;
    }
    all == any
}

impl Bvh2 {
    /// True when the rays can be walked together.
    #[inline(always)]
    fn takes_packet(&self, rays: &[TravRay], active: u32) -> bool {
        active.count_ones() > 2 && rays.iter().all(|ray| slabs::fits(ray, self.reach)) && agree(rays)
    }

    #[inline(always)]
    pub(super) fn walk_closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        for first in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(first + S::F::LEN);
            let (rays, best, sinks) = (&rays[first..end], &mut best[first..end], &sinks[first..end]);
            let active = (active >> first) & ((1 << rays.len()) - 1);
            if self.takes_packet(rays, active) {
                self.closest_together::<S, C, K>(rays, active, best, sinks, count);
            } else {
                run::closest_singly::<S, _, C, K>(self, prims, rays, active, best, sinks, count);
            }
        }
    }

    #[inline(always)]
    fn closest_together<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        let mut packet = PacketRays::new(rays, self.reach);
        for (i, best) in best.iter().enumerate() {
            packet.set_limit(i, best);
        }
        let mut node = PacketNode::<S>::new(&packet, self.reach, rays[0].forms().nodes);
        let mut stack = Stack::<S>::new();
        let (mut link, mut mask) = (Link::inner(0), active);
        loop {
            if link.is_leaf() {
                for block in self.leaf_blocks(link, count) {
                    block.closest_packet::<S, C, K>(rays, &mut packet, mask, best, sinks, count);
                }
                node.limit = S::F::load(&packet.t_cull);
            } else {
                count.node();
                count.node();
                if let Some(next) = descend(&node, &mut stack, &self.pairs[link.pair()], mask) {
                    (link, mask) = next;
                    continue;
                }
            }
            (link, mask) = loop {
                let Some(entry) = stack.pop() else { return };
                let mask = entry.mask & (entry.near - node.limit).le(S::F::splat(SLACK));
                if mask != 0 {
                    break (entry.link, mask);
                }
            };
        }
    }

    /// The active rays that something blocks.
    #[inline(always)]
    pub(super) fn walk_occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        let mut blocked = 0;
        for first in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(first + S::F::LEN);
            let (rays, sinks) = (&rays[first..end], &sinks[first..end]);
            let active = (active >> first) & ((1 << rays.len()) - 1);
            let part = if self.takes_packet(rays, active) {
                self.occluded_together::<S, C, K>(rays, active, sinks, count)
            } else {
                run::occluded_singly::<S, _, C, K>(self, prims, rays, active, sinks, count)
            };
            blocked |= part << first;
        }
        blocked
    }

    #[inline(always)]
    fn occluded_together<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        let packet = PacketRays::new(rays, self.reach);
        let node = PacketNode::<S>::new(&packet, self.reach, rays[0].forms().nodes);
        let mut stack = Stack::<S>::new();
        let mut open = active;
        let (mut link, mut mask) = (Link::inner(0), active);
        loop {
            if link.is_leaf() {
                for block in self.leaf_blocks(link, count) {
                    open &= !block.occluded_packet::<S, C, K>(rays, &packet, mask & open, sinks, count);
                }
                if open == 0 {
                    return active;
                }
            } else {
                count.node();
                count.node();
                if let Some(next) = descend(&node, &mut stack, &self.pairs[link.pair()], mask & open) {
                    (link, mask) = next;
                    continue;
                }
            }
            (link, mask) = loop {
                let Some(entry) = stack.pop() else { return active & !open };
                let mask = entry.mask & open;
                if mask != 0 {
                    break (entry.link, mask);
                }
            };
        }
    }
}

/// Tests both children for the rays of `mask`; the one that most rays enter first is next, the other goes to the stack.
#[inline(always)]
fn descend<S: Simd>(node: &PacketNode<S>, stack: &mut Stack<S>, pair: &Pair, mask: u32) -> Option<(Link, u32)> {
    let (hits0, near0) = node.test(pair, 0);
    let (hits1, near1) = node.test(pair, 1);
    let (hits0, hits1) = (hits0 & mask, hits1 & mask);
    let [first, second] = pair.links;
    if hits0 == 0 {
        return (hits1 != 0).then_some((second, hits1));
    }
    if hits1 == 0 {
        return Some((first, hits0));
    }
    let both = hits0 & hits1;
    let sooner = near0.le(near1) & both;
    if 2 * sooner.count_ones() >= both.count_ones() {
        stack.push(Entry { link: second, mask: hits1, near: near1 });
        Some((first, hits0))
    } else {
        stack.push(Entry { link: first, mask: hits0, near: near0 });
        Some((second, hits1))
    }
}
