//! Packets over structures that take rays by lane: nothing is done for each ray by itself.

use super::{
    GroupFrame, World,
    sink::{GroupSink, Unfiltered},
    top::FLAT,
};
use crate::{
    accel::{AnyHit, LEAF, LanePacket, ManyVisit, TravRay, walk_many},
    geom::{Hit, Ray},
    simd::{Lanes, Simd, Task},
};

/// Groups as rays come upon them, for those that look for their nearest hits.
struct NearestLanes<'a> {
    groups: &'a [GroupFrame],
    packet: &'a mut LanePacket,
    /// Rays that are left to be answered by themselves.
    alone: u32,
}

impl NearestLanes<'_> {
    #[inline(always)]
    fn offer<S: Simd>(&mut self, group: &GroupFrame, open: u32) {
        let sink = GroupSink { layout: &group.layout, filter: Unfiltered };
        match &group.rigid {
            Some((tree, place)) => {
                self.alone |= tree.closest_lanes::<S, _>(place, &group.triangles(), self.packet, open, &sink);
            }
            None => group.accel.closest_lanes::<S, _>(self.packet, open, &sink),
        }
    }
}

impl<S: Simd> ManyVisit<S> for NearestLanes<'_> {
    #[inline(always)]
    fn open(&self) -> u32 {
        !self.alone
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        self.packet.limit::<S>()
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let groups = self.groups;
        self.offer::<S>(&groups[(word & !LEAF) as usize], mask);
    }

    #[inline(always)]
    fn few(&mut self, _word: u32, _mask: u32) -> bool {
        false
    }
}

/// The same for rays that look for anything.
struct AnyLanes<'a> {
    groups: &'a [GroupFrame],
    packet: &'a mut LanePacket,
    open: u32,
    blocked: u32,
    /// Rays that are left to be answered by themselves.
    alone: u32,
}

impl AnyLanes<'_> {
    #[inline(always)]
    fn ask<S: Simd>(&mut self, group: &GroupFrame, open: u32) {
        let [blocked, alone] = match &group.rigid {
            Some((tree, place)) => tree.occluded_lanes::<S>(place, &group.triangles(), self.packet, open),
            None => [group.accel.occluded_lanes::<S>(self.packet, open), 0],
        };
        self.open &= !(blocked | alone);
        self.blocked |= blocked;
        self.alone |= alone;
    }
}

impl<S: Simd> ManyVisit<S> for AnyLanes<'_> {
    #[inline(always)]
    fn open(&self) -> u32 {
        self.open
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        self.packet.limit::<S>()
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let groups = self.groups;
        self.ask::<S>(&groups[(word & !LEAF) as usize], mask);
    }

    #[inline(always)]
    fn few(&mut self, _word: u32, _mask: u32) -> bool {
        false
    }
}

/// [`World::nearest_by_lane`], called so that what it needs of the stack is not a part of what every query needs.
struct Nearest<'a> {
    world: &'a World,
    packet: &'a mut LanePacket,
    rays: &'a [Ray],
    hits: &'a mut [Option<Hit>],
}

impl Task for Nearest<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        self.world.nearest_in_lanes::<S>(self.packet, self.rays, self.hits)
    }
}

/// [`World::blocked_by_lane`], called as [`Nearest`] is.
struct Blocked<'a> {
    world: &'a World,
    packet: &'a mut LanePacket,
    rays: &'a [Ray],
}

impl Task for Blocked<'_> {
    type Output = Option<u32>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Option<u32> {
        self.world.blocked_in_lanes::<S>(self.packet, self.rays)
    }
}

impl World {
    /// False when nothing was answered, since the rays point apart.
    #[inline(always)]
    pub(super) fn nearest_by_lane<S: Simd>(
        &self,
        packet: &mut LanePacket,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) -> bool {
        S::call(Nearest { world: self, packet, rays, hits })
    }

    #[inline(always)]
    fn nearest_in_lanes<S: Simd>(&self, packet: &mut LanePacket, rays: &[Ray], hits: &mut [Option<Hit>]) -> bool {
        for first in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(first + S::F::LEN);
            let (rays, hits) = (&rays[first..end], &mut hits[first..end]);
            let taken = packet.load::<S>(rays, self.top.reach(), self.forms);
            if first == 0 && packet.points_apart::<S>(taken) {
                return false;
            }
            let alone = !taken | self.offer_groups::<S>(rays, packet, taken);
            packet.hits::<S, _>(&AnyHit, hits);
            for (i, ray) in rays.iter().enumerate() {
                if (alone >> i) & 1 == 1 {
                    hits[i] = self.nearest_hit::<S>(ray);
                }
            }
        }
        true
    }

    /// Offers all groups to the rays in `taken`; the bits of those that are left to be answered by themselves.
    #[inline(always)]
    fn offer_groups<S: Simd>(&self, rays: &[Ray], packet: &mut LanePacket, taken: u32) -> u32 {
        if taken == 0 {
            return 0;
        }
        let mut visit = NearestLanes { groups: &self.groups, packet, alone: 0 };
        if self.groups.len() > FLAT {
            let lines = visit.packet.lines::<S>(self.top.reach());
            visit.alone = taken & !lines.fits();
            walk_many(self.top.wide(), &lines, taken & lines.fits(), &mut visit);
            return visit.alone;
        }
        let mut order = [0; FLAT];
        if self.groups.len() > 1
            && let Some(leader) = TravRay::with_forms(&rays[taken.trailing_zeros() as usize], self.forms)
        {
            order = self.top.order(&self.groups, &leader);
        }
        for &number in &order[..self.groups.len()] {
            let group = &self.groups[number];
            let open = taken & !visit.alone & visit.packet.meeting::<S>(&group.bounds);
            if open != 0 {
                visit.offer::<S>(group, open);
            }
        }
        visit.alone
    }

    /// `None` when nothing was answered, since the rays point apart.
    #[inline(always)]
    pub(super) fn blocked_by_lane<S: Simd>(&self, packet: &mut LanePacket, rays: &[Ray]) -> Option<u32> {
        S::call(Blocked { world: self, packet, rays })
    }

    #[inline(always)]
    fn blocked_in_lanes<S: Simd>(&self, packet: &mut LanePacket, rays: &[Ray]) -> Option<u32> {
        let mut blocked = 0;
        for first in (0..rays.len()).step_by(S::F::LEN) {
            let rays = &rays[first..rays.len().min(first + S::F::LEN)];
            let taken = packet.load::<S>(rays, self.top.reach(), self.forms);
            if first == 0 && packet.points_apart::<S>(taken) {
                return None;
            }
            let [stopped, alone] = self.ask_groups::<S>(packet, taken);
            blocked |= stopped << first;
            for (i, ray) in rays.iter().enumerate() {
                if ((!taken | alone) >> i) & 1 == 1 && self.is_blocked::<S>(ray) {
                    blocked |= 1 << (first + i);
                }
            }
        }
        Some(blocked)
    }

    /// The bits of the rays in `taken` that something blocks, and of those that are left to be answered by themselves.
    #[inline(always)]
    fn ask_groups<S: Simd>(&self, packet: &mut LanePacket, taken: u32) -> [u32; 2] {
        let mut visit = AnyLanes { groups: &self.groups, packet, open: taken, blocked: 0, alone: 0 };
        if self.groups.len() > FLAT {
            let lines = visit.packet.lines::<S>(self.top.reach());
            visit.alone = taken & !lines.fits();
            visit.open &= lines.fits();
            walk_many(self.top.wide(), &lines, visit.open, &mut visit);
        } else {
            for group in &self.groups {
                let open = visit.open & visit.packet.meeting::<S>(&group.bounds);
                if open != 0 {
                    visit.ask::<S>(group, open);
                }
            }
        }
        [visit.blocked, visit.alone]
    }
}
