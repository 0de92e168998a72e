//! Packets over a few structures that take rays by lane: nothing is done for each ray by itself.

use super::{
    World,
    sink::{GroupSink, Unfiltered},
    top::FLAT,
};
use crate::{
    accel::{AnyHit, LanePacket, TravRay},
    geom::{Hit, Ray},
    simd::{Lanes, Simd},
};

impl World {
    /// True when every structure takes rays by lane.
    #[inline(always)]
    pub(super) fn takes_lanes(&self) -> bool {
        self.groups.len() <= FLAT && self.groups.iter().all(|group| group.rigid.is_none() && group.accel.takes_lanes())
    }

    /// False when nothing was answered, since the rays point apart.
    #[inline(always)]
    pub(super) fn nearest_by_lane<S: Simd>(&self, rays: &[Ray], hits: &mut [Option<Hit>]) -> bool {
        let (mut packet, reach) = (LanePacket::EMPTY, self.top.reach());
        for first in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(first + S::F::LEN);
            let (rays, hits) = (&rays[first..end], &mut hits[first..end]);
            let taken = packet.load::<S>(rays, reach, self.forms);
            if first == 0 && packet.points_apart::<S>(taken) {
                return false;
            }
            let mut order = [0; FLAT];
            if self.groups.len() > 1
                && taken != 0
                && let Some(leader) = TravRay::with_forms(&rays[taken.trailing_zeros() as usize], self.forms)
            {
                order = self.top.order(&self.groups, &leader);
            }
            for &number in &order[..self.groups.len()] {
                let group = &self.groups[number];
                let open = taken & packet.meeting::<S>(&group.bounds);
                if open != 0 {
                    let sink = GroupSink { layout: &self.groups[number].layout, filter: Unfiltered };
                    group.accel.closest_lanes::<S, _>(&mut packet, open, &sink);
                }
            }
            packet.hits::<S, _>(&AnyHit, hits);
            for (i, ray) in rays.iter().enumerate() {
                if (taken >> i) & 1 == 0 {
                    hits[i] = self.nearest_hit::<S>(ray);
                }
            }
        }
        true
    }

    /// `None` when nothing was answered, since the rays point apart.
    #[inline(always)]
    pub(super) fn blocked_by_lane<S: Simd>(&self, rays: &[Ray]) -> Option<u32> {
        let (mut packet, reach) = (LanePacket::EMPTY, self.top.reach());
        let mut blocked = 0;
        for first in (0..rays.len()).step_by(S::F::LEN) {
            let rays = &rays[first..rays.len().min(first + S::F::LEN)];
            let taken = packet.load::<S>(rays, reach, self.forms);
            if first == 0 && packet.points_apart::<S>(taken) {
                return None;
            }
            let mut left = taken;
            for group in &self.groups {
                let open = left & packet.meeting::<S>(&group.bounds);
                if open != 0 {
                    left &= !group.accel.occluded_lanes::<S>(&mut packet, open);
                }
            }
            blocked |= (taken & !left) << first;
            for (i, ray) in rays.iter().enumerate() {
                if (taken >> i) & 1 == 0 && self.is_blocked::<S>(ray) {
                    blocked |= 1 << (first + i);
                }
            }
        }
        Some(blocked)
    }
}
