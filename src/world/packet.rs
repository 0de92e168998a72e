//! Packets of rays: what single rays answer, bit for bit, faster where rays run close together.

use super::{
    GroupFrame, World,
    sink::{GroupSink, Unfiltered},
    top::FLAT,
};
use crate::{
    accel::{Closest, PACKET, PacketBoxes, TravRay},
    geom::{Forms, Hit, Ray},
    simd::Simd,
};

/// The rays of a packet that can hit anything.
struct Packet {
    /// Lanes that are not active repeat an active one.
    rays: [TravRay; PACKET],
    active: u32,
    /// Number of lanes, active or not.
    len: usize,
}

impl Packet {
    /// `None` when no ray can hit anything.
    #[inline(always)]
    fn new(rays: &[Ray], forms: Forms) -> Option<Self> {
        let mut packet = Self { rays: [TravRay::STAND_IN; PACKET], active: 0, len: rays.len() };
        for (i, ray) in rays.iter().enumerate().take(PACKET) {
            if let Some(ray) = TravRay::with_forms(ray, forms) {
                packet.rays[i] = ray;
                packet.active |= 1 << i;
            }
        }
        if packet.active == 0 {
            return None;
        }
        let leader = *packet.leader();
        for (i, ray) in packet.rays.iter_mut().enumerate() {
            if (packet.active >> i) & 1 == 0 {
                *ray = leader;
            }
        }
        Some(packet)
    }

    /// The first active ray: it stands for all where only speed is at stake.
    #[inline(always)]
    fn leader(&self) -> &TravRay {
        &self.rays[self.active.trailing_zeros() as usize]
    }

    #[inline(always)]
    fn rays(&self) -> &[TravRay] {
        &self.rays[..self.len]
    }
}

impl World {
    /// Writes to `hits` what [`World::nearest_hit`] answers for each of `rays`.
    ///
    /// Pays when the rays start close together or run the same way; never wrong when they do not. No allocation.
    ///
    /// # Panics
    /// When there are more than [`PACKET`] rays or fewer hits than rays.
    #[inline(always)]
    pub fn nearest_hits<S: Simd>(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert!(rays.len() <= PACKET && rays.len() <= hits.len(), "at most {PACKET} rays, a hit for each");
        hits.fill(None);
        let Some(packet) = Packet::new(rays, self.forms) else { return };
        let mut best: [Closest; PACKET] = std::array::from_fn(|i| Closest::new(&packet.rays[i]));
        if self.groups.len() <= FLAT {
            let order = self.top.order(&self.groups, packet.leader());
            let boxes = PacketBoxes::new::<S>(&packet.rays);
            for &number in &order[..self.groups.len()] {
                let limits = std::array::from_fn(|i| best[i].t_cull());
                let group = &self.groups[number];
                let open = packet.active & boxes.meeting::<S>(&group.bounds, &limits);
                if open != 0 {
                    group.closest_packet::<S>(packet.rays(), open, &mut best[..packet.len]);
                }
            }
        } else {
            for i in 0..packet.len {
                if (packet.active >> i) & 1 == 1 {
                    let mut walk = self.top.walk(&self.groups, &packet.rays[i]);
                    while let Some(group) = walk.next(best[i].t_high()) {
                        group.closest_packet::<S>(&packet.rays[i..=i], 1, &mut best[i..=i]);
                    }
                }
            }
        }
        for i in 0..packet.len {
            hits[i] = best[i].hit(&packet.rays[i]);
        }
    }

    /// The bits of those of `rays` for which [`World::is_blocked`] answers true, the first ray's lowest.
    ///
    /// # Panics
    /// When there are more than [`PACKET`] rays.
    #[inline(always)]
    pub fn blocked<S: Simd>(&self, rays: &[Ray]) -> u32 {
        assert!(rays.len() <= PACKET, "at most {PACKET} rays");
        let Some(packet) = Packet::new(rays, self.forms) else { return 0 };
        let mut blocked = 0;
        if self.groups.len() <= FLAT {
            let boxes = PacketBoxes::new::<S>(&packet.rays);
            let limits = std::array::from_fn(|i| packet.rays[i].range().t_far);
            for group in &self.groups {
                let open = packet.active & !blocked & boxes.meeting::<S>(&group.bounds, &limits);
                if open != 0 {
                    blocked |= group.occluded_packet::<S>(packet.rays(), open);
                }
            }
            return blocked;
        }
        for i in 0..packet.len {
            if (packet.active >> i) & 1 == 1 {
                let mut walk = self.top.walk(&self.groups, &packet.rays[i]);
                let t_far = f64::from(packet.rays[i].range().t_far);
                while let Some(group) = walk.next(t_far) {
                    if group.occluded_packet::<S>(&packet.rays[i..=i], 1) != 0 {
                        blocked |= 1 << i;
                        break;
                    }
                }
            }
        }
        blocked
    }
}

impl GroupFrame {
    #[inline(always)]
    fn closest_packet<S: Simd>(&self, rays: &[TravRay], active: u32, best: &mut [Closest]) {
        let prims = self.triangles();
        if let Some((tree, place)) = &self.rigid {
            let sink = GroupSink { layout: &self.layout, filter: Unfiltered };
            for (i, ray) in rays.iter().enumerate() {
                if (active >> i) & 1 == 1 {
                    tree.closest::<S, _>(place, &prims, ray, &mut best[i], &sink);
                }
            }
            return;
        }
        let sinks = [GroupSink { layout: &self.layout, filter: Unfiltered }; PACKET];
        self.accel.closest_packet::<S, (), _>(&prims, rays, active, best, &sinks[..rays.len()], &mut ());
    }

    #[inline(always)]
    fn occluded_packet<S: Simd>(&self, rays: &[TravRay], active: u32) -> u32 {
        let prims = self.triangles();
        if let Some((tree, place)) = &self.rigid {
            let sink = GroupSink { layout: &self.layout, filter: Unfiltered };
            let mut blocked = 0;
            for (i, ray) in rays.iter().enumerate() {
                if (active >> i) & 1 == 1 {
                    blocked |= u32::from(tree.occluded::<S, _>(place, &prims, ray, &sink)) << i;
                }
            }
            return blocked;
        }
        let sinks = [GroupSink { layout: &self.layout, filter: Unfiltered }; PACKET];
        self.accel.occluded_packet::<S, (), _>(&prims, rays, active, &sinks[..rays.len()], &mut ())
    }
}
