//! Packets by lane: as `packet.rs`, with nothing done for each ray by itself.

use super::{RigidPlace, RigidTree, packet::in_world};
use crate::{
    accel::{
        HitSink,
        eight::{ManyVisit, walk_many},
        packet::LanePacket,
    },
    geom::Triangles,
    simd::{Simd, Task},
};

/// The rays in `open` on their way through a part.
struct Lanewise<'a> {
    tree: &'a RigidTree,
    place: &'a RigidPlace,
    prims: &'a Triangles<'a>,
    packet: &'a mut LanePacket,
    open: u32,
}

struct Nearest<'a, K> {
    rays: Lanewise<'a>,
    sink: &'a K,
}

impl<S: Simd, K: HitSink> ManyVisit<S> for Nearest<'_, K> {
    #[inline(always)]
    fn open(&self) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        self.rays.packet.limit::<S>()
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let Lanewise { tree, prims, packet, .. } = &mut self.rays;
        let LanePacket { rays, nearest, tri } = &mut **packet;
        for block in tree.leaf_blocks(word) {
            let block = [in_world(block, prims)];
            nearest.offer::<S, K>(rays, (&block, 0), mask, tri, self.sink);
            nearest.leave(&block, self.sink);
        }
    }

    #[inline(always)]
    fn few(&mut self, _word: u32, _mask: u32) -> bool {
        false
    }
}

struct Any<'a>(Lanewise<'a>);

impl<S: Simd> ManyVisit<S> for Any<'_> {
    #[inline(always)]
    fn open(&self) -> u32 {
        self.0.open
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        self.0.packet.limit::<S>()
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let Lanewise { tree, prims, packet, open, .. } = &mut self.0;
        for block in tree.leaf_blocks(word) {
            let left = mask & *open;
            if left == 0 {
                return;
            }
            *open &= !in_world(block, prims).blocked::<S>(&packet.rays, left, &mut packet.tri);
        }
    }

    #[inline(always)]
    fn few(&mut self, _word: u32, _mask: u32) -> bool {
        false
    }
}

impl<K: HitSink> Task for Nearest<'_, K> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(mut self) -> u32 {
        let Lanewise { tree, place, open, .. } = self.rays;
        let lines = place.localize_packet::<S>(&self.rays.packet.rays, self.rays.packet.far::<S>(), tree.reach32());
        walk_many(&tree.nodes, &lines, open & lines.fits(), &mut self);
        open & !lines.fits()
    }
}

impl Task for Any<'_> {
    type Output = [u32; 2];

    #[inline(always)]
    fn run<S: Simd>(mut self) -> [u32; 2] {
        let Lanewise { tree, place, open, .. } = self.0;
        let lines = place.localize_packet::<S>(&self.0.packet.rays, self.0.packet.far::<S>(), tree.reach32());
        self.0.open &= lines.fits();
        walk_many(&tree.nodes, &lines, self.0.open, &mut self);
        [open & lines.fits() & !self.0.open, open & !lines.fits()]
    }
}

impl RigidTree {
    /// Offers the triangles to the rays in `open`, all hits of which `sink` accepts: the bits of those that it could not be decided for, which were offered nothing.
    #[inline(always)]
    pub(crate) fn closest_lanes<S: Simd, K: HitSink>(
        &self,
        place: &RigidPlace,
        prims: &Triangles<'_>,
        packet: &mut LanePacket,
        open: u32,
        sink: &K,
    ) -> u32 {
        S::call(Nearest { rays: Lanewise { tree: self, place, prims, packet, open }, sink })
    }

    /// The rays in `open` that something blocks, and those that it could not be decided for.
    #[inline(always)]
    pub(crate) fn occluded_lanes<S: Simd>(
        &self,
        place: &RigidPlace,
        prims: &Triangles<'_>,
        packet: &mut LanePacket,
        open: u32,
    ) -> [u32; 2] {
        S::call(Any(Lanewise { tree: self, place, prims, packet, open }))
    }
}
