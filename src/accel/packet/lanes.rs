//! Packets over several structures.

use super::{Nearest, PacketRays, Spread};
use crate::{
    accel::{
        AnyAccel, EightPacket, HitSink,
        bvh8::{Full, Tree8},
        query::SLACK,
        run::{ClosestLanes, OccludedLanes},
    },
    geom::{Aabb, Forms, Hit, Ray},
    simd::{Lanes, Simd},
};

/// Up to [`PACKET`](super::PACKET) rays on their way through any number of structures, from their records to their answers by lane.
pub(crate) struct LanePacket {
    pub(in crate::accel) rays: PacketRays,
    pub(in crate::accel) nearest: Nearest,
    pub(in crate::accel) tri: Spread,
}

impl LanePacket {
    /// No rays.
    pub(crate) const EMPTY: Self = Self { rays: PacketRays::EMPTY, nearest: Nearest::NONE, tri: Spread::EMPTY };

    /// Takes up to as many rays as a vector has lanes, at least one, for structures within `reach` of 0: the bits of those that may go on.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&mut self, rays: &[Ray], reach: f32, forms: Forms) -> u32 {
        let taken = self.rays.load::<S>(rays, reach, forms);
        self.rays.prepare::<S>(forms.nodes);
        self.nearest.clear();
        taken
    }

    /// True when the rays in `taken` point too far apart to go together.
    #[inline(always)]
    pub(crate) fn points_apart<S: Simd>(&self, taken: u32) -> bool {
        self.rays.points_apart::<S>(taken)
    }

    /// The greatest coordinate of an origin.
    #[inline(always)]
    pub(in crate::accel) fn far<S: Simd>(&self) -> f64 {
        let [x, y, z] = &self.rays.origin32;
        let far = S::F::load(x).abs().max(S::F::load(y).abs()).max(S::F::load(z).abs());
        f64::from(S::range(far, S::F::ALL)[1])
    }

    /// The rays against nodes of boxes within `reach` of 0.
    #[inline(always)]
    pub(crate) fn lines<S: Simd>(&self, reach: f32) -> EightPacket<S> {
        let PacketRays { origin32: [x, y, z], dir32: [dx, dy, dz], t_near32, .. } = &self.rays;
        let from = [S::F::load(x), S::F::load(y), S::F::load(z)];
        let dir = [S::F::load(dx), S::F::load(dy), S::F::load(dz)];
        EightPacket::new(from, dir, [0.0; 3], reach, S::F::load(t_near32))
    }

    /// Beyond these `t` nothing counts any more.
    #[inline(always)]
    pub(crate) fn limit<S: Simd>(&self) -> S::F {
        S::F::load(&self.rays.t_cull)
    }

    /// The rays that may meet a box within the reach, at their best hits or before.
    #[inline(always)]
    pub(crate) fn meeting<S: Simd>(&self, aabb: &Aabb) -> u32 {
        if aabb.is_empty() {
            return 0;
        }
        let (mut near, mut far) = (S::F::load(&self.rays.t_near32), S::F::load(&self.rays.t_cull));
        for axis in 0..3 {
            let slab = self.rays.lines.slab::<S>(axis);
            let (low, high) = (S::F::splat(aabb.min[axis]), S::F::splat(aabb.max[axis]));
            let backward = self.rays.backward[axis];
            let (first, last) = (S::F::select(backward, high, low), S::F::select(backward, low, high));
            near = first.mul_add_loose(slab.entry_mul, slab.entry_add).max(near);
            far = last.mul_add_loose(slab.exit_mul, slab.exit_add).min(far);
        }
        (near - far).le(S::F::splat(SLACK))
    }

    /// The hits of all rays, rounded, into `out`.
    #[inline(always)]
    pub(crate) fn hits<S: Simd, K: HitSink>(&self, sink: &K, out: &mut [Option<Hit>]) {
        self.nearest.answer::<S, K>(&self.rays, &[], sink, out);
    }
}

impl AnyAccel {
    /// True for structures that [`AnyAccel::closest_lanes`] and [`AnyAccel::occluded_lanes`] may be asked of.
    pub(crate) fn takes_lanes(&self) -> bool {
        self.by_lane().is_some()
    }

    #[inline(always)]
    fn by_lane(&self) -> Option<&Tree8<Full>> {
        if let Self::Bvh8(tree) = self { tree.full() } else { None }
    }

    /// Offers the triangles to the rays in `open`, all hits of which `sink` accepts. Panics where [`AnyAccel::takes_lanes`] is false.
    #[inline(always)]
    pub(crate) fn closest_lanes<S: Simd, K: HitSink>(&self, packet: &mut LanePacket, open: u32, sink: &K) {
        let Some(tree) = self.by_lane() else { unreachable!("only bvh8's full layout takes rays by lane") };
        S::call(ClosestLanes { tree, packet, open, sink });
    }

    /// The rays in `open` that something blocks. Panics as above.
    #[inline(always)]
    pub(crate) fn occluded_lanes<S: Simd>(&self, packet: &mut LanePacket, open: u32) -> u32 {
        let Some(tree) = self.by_lane() else { unreachable!("only bvh8's full layout takes rays by lane") };
        S::call(OccludedLanes { tree, packet, open })
    }
}
