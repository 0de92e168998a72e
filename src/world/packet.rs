//! Packets of rays: what single rays answer, bit for bit, faster where rays run close together.

use super::{
    GroupFrame, World,
    query::{AnyGroup, NearestGroup},
    sink::{GroupSink, Unfiltered},
    top::FLAT,
};
use crate::{
    accel::{
        Closest, EightPacket, LEAF, LanePacket, ManyVisit, PACKET, PacketBoxes, RigidPacket, TravRay, walk_many,
        walk_one,
    },
    geom::{Forms, Hit, Ray},
    simd::{Lanes, Simd},
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
        let mut lanes = LanePacket::EMPTY;
        self.nearest_hits_with::<S>(&mut lanes, rays, hits);
    }

    /// [`World::nearest_hits`] for callers with many packets: `lanes` is overwritten where it is used, so nothing is cleared for each.
    #[inline(always)]
    pub(crate) fn nearest_hits_with<S: Simd>(&self, lanes: &mut LanePacket, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert!(rays.len() <= PACKET && rays.len() <= hits.len(), "at most {PACKET} rays, a hit for each");
        hits[rays.len()..].fill(None);
        if self.top.takes_lanes() && self.nearest_by_lane::<S>(lanes, rays, hits) {
            return;
        }
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
            for start in (0..packet.len).step_by(S::F::LEN) {
                let end = packet.len.min(start + S::F::LEN);
                let active = packet.active >> start & S::F::ALL;
                self.nearest_of_many::<S>(&packet.rays[start..end], active, &mut best[start..end]);
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
        let mut lanes = LanePacket::EMPTY;
        self.blocked_with::<S>(&mut lanes, rays)
    }

    /// [`World::blocked`] for callers with many packets, as [`World::nearest_hits_with`].
    #[inline(always)]
    pub(crate) fn blocked_with<S: Simd>(&self, lanes: &mut LanePacket, rays: &[Ray]) -> u32 {
        assert!(rays.len() <= PACKET, "at most {PACKET} rays");
        if self.top.takes_lanes()
            && let Some(blocked) = self.blocked_by_lane::<S>(lanes, rays)
        {
            return blocked;
        }
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
        for start in (0..packet.len).step_by(S::F::LEN) {
            let end = packet.len.min(start + S::F::LEN);
            let active = packet.active >> start & S::F::ALL;
            blocked |= self.blocked_of_many::<S>(&packet.rays[start..end], active) << start;
        }
        blocked
    }

    /// Those of the rays in `active`, a vector of them or fewer, over more than [`FLAT`] groups.
    #[inline(always)]
    fn nearest_of_many<S: Simd>(&self, rays: &[TravRay], active: u32, best: &mut [Closest]) {
        let mut single = active;
        let nodes = self.top.wide();
        if active.count_ones() > FEW && !nodes.is_empty() {
            let lines = lines::<S>(rays, self.top.reach());
            single &= !lines.fits();
            let mut limits = [0.0; PACKET];
            for (limit, best) in limits.iter_mut().zip(&*best) {
                *limit = best.t_cull();
            }
            let mut visit = NearestGroups { world: self, rays, best, limits, packet: None };
            walk_many(nodes, &lines, active & lines.fits(), &mut visit);
        }
        for i in bits(single) {
            self.nearest_of_one::<S>(&rays[i], &mut best[i]);
        }
    }

    #[inline(always)]
    fn nearest_of_one<S: Simd>(&self, ray: &TravRay, best: &mut Closest) {
        if let Some(line) = self.top.line::<S>(ray) {
            let mut visit = NearestGroup { groups: &self.groups, ray, best, filter: Unfiltered };
            walk_one::<S, _>(self.top.wide(), &line, 0, &mut visit);
            return;
        }
        let mut walk = self.top.walk(&self.groups, ray);
        while let Some(group) = walk.next(best.t_high()) {
            group.closest::<S, _>(ray, best, Unfiltered);
        }
    }

    /// As [`World::nearest_of_many`]: the bits of those that are blocked.
    #[inline(always)]
    fn blocked_of_many<S: Simd>(&self, rays: &[TravRay], active: u32) -> u32 {
        let (mut single, mut blocked) = (active, 0);
        let nodes = self.top.wide();
        if active.count_ones() > FEW && !nodes.is_empty() {
            let lines = lines::<S>(rays, self.top.reach());
            single &= !lines.fits();
            let mut limits = [0.0; PACKET];
            for (limit, ray) in limits.iter_mut().zip(rays) {
                *limit = ray.range().t_far;
            }
            let together = active & lines.fits();
            let mut visit = AnyGroups { world: self, rays, open: together, limits, packet: None };
            walk_many(nodes, &lines, together, &mut visit);
            blocked = together & !visit.open;
        }
        for i in bits(single) {
            blocked |= u32::from(self.is_one_blocked::<S>(&rays[i])) << i;
        }
        blocked
    }

    #[inline(always)]
    fn is_one_blocked<S: Simd>(&self, ray: &TravRay) -> bool {
        if let Some(line) = self.top.line::<S>(ray) {
            let mut visit = AnyGroup { groups: &self.groups, ray, filter: Unfiltered, is_blocked: false };
            walk_one::<S, _>(self.top.wide(), &line, 0, &mut visit);
            return visit.is_blocked;
        }
        let mut walk = self.top.walk(&self.groups, ray);
        let t_far = f64::from(ray.range().t_far);
        while let Some(group) = walk.next(t_far) {
            if group.occluded::<S, _>(ray, Unfiltered) {
                return true;
            }
        }
        false
    }
}

/// Up to this many rays go one by one.
const FEW: u32 = 2;

/// Rays of a packet against boxes within `reach` of 0.
#[inline(always)]
fn lines<S: Simd>(rays: &[TravRay], reach: f32) -> EightPacket<S> {
    let (mut from, mut dir, mut near) = ([[0.0; PACKET]; 3], [[0.0; PACKET]; 3], [0.0; PACKET]);
    for (lane, near) in near.iter_mut().enumerate() {
        let range = rays[lane.min(rays.len() - 1)].range();
        for axis in 0..3 {
            from[axis][lane] = range.origin[axis];
            dir[axis][lane] = range.dir[axis];
        }
        *near = range.t_near;
    }
    EightPacket::new(
        [S::F::load(&from[0]), S::F::load(&from[1]), S::F::load(&from[2])],
        [S::F::load(&dir[0]), S::F::load(&dir[1]), S::F::load(&dir[2])],
        [0.0; 3],
        reach,
        S::F::load(&near),
    )
}

/// Offers the triangles of groups to the rays of a packet.
struct NearestGroups<'a> {
    world: &'a World,
    rays: &'a [TravRay],
    best: &'a mut [Closest],
    limits: [f32; PACKET],
    /// For rigid groups, once there is one.
    packet: Option<RigidPacket>,
}

impl<S: Simd> ManyVisit<S> for NearestGroups<'_> {
    #[inline(always)]
    fn open(&self) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        S::F::load(&self.limits)
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let group = &self.world.groups[(word & !LEAF) as usize];
        group.closest_of_vector::<S>(self.rays, mask, self.best, &mut self.packet, self.world.top.reach());
        for i in bits(mask) {
            self.limits[i & (PACKET - 1)] = self.best[i].t_cull();
        }
    }

    #[inline(always)]
    fn few(&mut self, word: u32, mask: u32) -> bool {
        if mask.count_ones() > FEW {
            return false;
        }
        for i in bits(mask) {
            // The packet's rays fit as those of its lanes do.
            let Some(line) = self.world.top.line::<S>(&self.rays[i]) else { return false };
            let (ray, best) = (&self.rays[i], &mut self.best[i]);
            let mut visit = NearestGroup { groups: &self.world.groups, ray, best, filter: Unfiltered };
            walk_one::<S, _>(self.world.top.wide(), &line, word, &mut visit);
            self.limits[i & (PACKET - 1)] = self.best[i].t_cull();
        }
        true
    }
}

/// Asks groups which rays of a packet they block.
struct AnyGroups<'a> {
    world: &'a World,
    rays: &'a [TravRay],
    open: u32,
    limits: [f32; PACKET],
    packet: Option<RigidPacket>,
}

impl<S: Simd> ManyVisit<S> for AnyGroups<'_> {
    #[inline(always)]
    fn open(&self) -> u32 {
        self.open
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        S::F::load(&self.limits)
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let group = &self.world.groups[(word & !LEAF) as usize];
        let reach = self.world.top.reach();
        self.open &= !group.occluded_of_vector::<S>(self.rays, mask, &mut self.packet, reach);
    }

    #[inline(always)]
    fn few(&mut self, word: u32, mask: u32) -> bool {
        if mask.count_ones() > FEW {
            return false;
        }
        for i in bits(mask) {
            let ray = &self.rays[i];
            let Some(line) = self.world.top.line::<S>(ray) else { return false };
            let mut visit = AnyGroup { groups: &self.world.groups, ray, filter: Unfiltered, is_blocked: false };
            walk_one::<S, _>(self.world.top.wide(), &line, word, &mut visit);
            self.open &= !(u32::from(visit.is_blocked) << i);
        }
        true
    }
}

/// Numbers of the set bits.
#[inline(always)]
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

impl GroupFrame {
    /// Any number of rays.
    #[inline(always)]
    fn closest_packet<S: Simd>(&self, rays: &[TravRay], active: u32, best: &mut [Closest]) {
        if self.rigid.is_none() {
            self.closest_of_vector::<S>(rays, active, best, &mut None, 0.0);
            return;
        }
        for start in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(start + S::F::LEN);
            let (rays, best) = (&rays[start..end], &mut best[start..end]);
            self.closest_of_vector::<S>(rays, active >> start & S::F::ALL, best, &mut None, self.bounds.reach());
        }
    }

    /// Any number of rays.
    #[inline(always)]
    fn occluded_packet<S: Simd>(&self, rays: &[TravRay], active: u32) -> u32 {
        if self.rigid.is_none() {
            return self.occluded_of_vector::<S>(rays, active, &mut None, 0.0);
        }
        let mut blocked = 0;
        for start in (0..rays.len()).step_by(S::F::LEN) {
            let rays = &rays[start..rays.len().min(start + S::F::LEN)];
            let active = active >> start & S::F::ALL;
            blocked |= self.occluded_of_vector::<S>(rays, active, &mut None, self.bounds.reach()) << start;
        }
        blocked
    }

    /// At most a vector of rays where the group is rigid; `packet` holds them once they were needed by component, for coordinates up to `reach`.
    #[inline(always)]
    fn closest_of_vector<S: Simd>(
        &self,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        packet: &mut Option<RigidPacket>,
        reach: f32,
    ) {
        let prims = self.triangles();
        let sinks = [GroupSink { layout: &self.layout, filter: Unfiltered }; PACKET];
        let sinks = &sinks[..rays.len()];
        let Some((tree, place)) = &self.rigid else {
            self.accel.closest_packet::<S, (), _>(&prims, rays, active, best, sinks, &mut ());
            return;
        };
        if packet.is_none() {
            *packet = Some(RigidPacket::new::<S>(rays, reach));
        }
        if let Some(packet) = packet {
            tree.closest_packet::<S, _>(place, &prims, (rays, packet), active, best, sinks);
        }
    }

    /// As [`GroupFrame::closest_of_vector`].
    #[inline(always)]
    fn occluded_of_vector<S: Simd>(
        &self,
        rays: &[TravRay],
        active: u32,
        packet: &mut Option<RigidPacket>,
        reach: f32,
    ) -> u32 {
        let prims = self.triangles();
        let sinks = [GroupSink { layout: &self.layout, filter: Unfiltered }; PACKET];
        let sinks = &sinks[..rays.len()];
        let Some((tree, place)) = &self.rigid else {
            return self.accel.occluded_packet::<S, (), _>(&prims, rays, active, sinks, &mut ());
        };
        if packet.is_none() {
            *packet = Some(RigidPacket::new::<S>(rays, reach));
        }
        let Some(packet) = packet else { return 0 };
        tree.occluded_packet::<S, _>(place, &prims, (rays, packet), active, sinks)
    }
}
