//! Packets: rays are brought into the part's space together, a lane each, and the triangles of a leaf into a block of the world's.

use super::{
    RigidPlace, RigidTree,
    single::{Any, Nearest, Walk},
};
use crate::{
    accel::{
        Closest, HitSink, TravRay,
        block::TriBlock,
        eight::{EightPacket, ManyVisit, walk_many},
        packet::{PACKET, PacketRays, bits},
    },
    geom::Triangles,
    simd::{Lanes, Simd, Task},
};

/// Up to this many rays go one by one.
const FEW: u32 = 2;

/// The rays of a packet by component, for any number of parts.
pub(crate) struct RigidPacket {
    rays: PacketRays,
    /// The greatest coordinate of an origin.
    far: f64,
}

impl RigidPacket {
    /// As many rays as there are lanes, or fewer, at least one, for triangles whose coordinates in the world are at most `reach` in size.
    #[inline(always)]
    pub(crate) fn new<S: Simd>(rays: &[TravRay], reach: f32) -> Self {
        debug_assert!((1..=S::F::LEN).contains(&rays.len()));
        let mut far = 0.0_f32;
        for ray in rays {
            far = far.max(ray.far());
        }
        Self { rays: PacketRays::new(rays, reach), far: f64::from(far) }
    }
}

impl RigidPlace {
    /// The rays of a packet in the part's space, as [`RigidPlace::localize`].
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the walk allows for the rounding, and for infinities")]
    pub(super) fn localize_packet<S: Simd>(&self, packet: &PacketRays, far: f64, reach: f32) -> EightPacket<S> {
        let (x, y, z) = (self.part_from_world.x_axis, self.part_from_world.y_axis, self.part_from_world.z_axis);
        let mut from = [[0.0_f32; PACKET]; 3];
        let mut dir = [[0.0_f32; PACKET]; 3];
        let PacketRays { origin32, dir32, t_near32, .. } = packet;
        for first in (0..S::F::LEN).step_by(S::D::LEN) {
            let ox = S::load_wide(&origin32[0][first..]) - S::D::splat(self.origin.x);
            let oy = S::load_wide(&origin32[1][first..]) - S::D::splat(self.origin.y);
            let oz = S::load_wide(&origin32[2][first..]) - S::D::splat(self.origin.z);
            let dx = S::load_wide(&dir32[0][first..]);
            let dy = S::load_wide(&dir32[1][first..]);
            let dz = S::load_wide(&dir32[2][first..]);
            for axis in 0..3 {
                let (x, y, z) = (S::D::splat(x[axis]), S::D::splat(y[axis]), S::D::splat(z[axis]));
                let (mut wide_from, mut wide_dir) = ([0.0_f64; PACKET], [0.0_f64; PACKET]);
                (ox * x + oy * y + oz * z).store(&mut wide_from);
                (dx * x + dy * y + dz * z).store(&mut wide_dir);
                for lane in 0..S::D::LEN {
                    from[axis][first + lane] = wide_from[lane] as f32;
                    dir[axis][first + lane] = wide_dir[lane] as f32;
                }
            }
        }
        let margin = self.margin + self.margin_per_unit * far;
        EightPacket::new(
            [S::F::load(&from[0]), S::F::load(&from[1]), S::F::load(&from[2])],
            [S::F::load(&dir[0]), S::F::load(&dir[1]), S::F::load(&dir[2])],
            [margin.x as f32, margin.y as f32, margin.z as f32],
            reach,
            S::F::load(t_near32),
        )
    }
}

/// The triangles of a block where they are in the world.
#[inline(always)]
pub(super) fn in_world(block: &TriBlock, prims: &Triangles<'_>) -> TriBlock {
    let mut own = TriBlock::new([block.prim(0), block.prim(1), block.prim(2), block.prim(3)]);
    own.refit(prims);
    own
}

/// What both walks know.
struct Common<'a, K> {
    tree: &'a RigidTree,
    place: &'a RigidPlace,
    prims: &'a Triangles<'a>,
    rays: &'a [TravRay],
    sinks: &'a [K],
}

struct NearestOfMany<'a, K> {
    common: Common<'a, K>,
    packet: &'a mut PacketRays,
    best: &'a mut [Closest],
}

impl<K: HitSink> NearestOfMany<'_, K> {
    #[inline(always)]
    fn one<S: Simd>(&mut self, i: usize, start: u32) {
        let &Common { tree, place, prims, rays, sinks } = &self.common;
        let mut look = Nearest { prims, ray: &rays[i], best: &mut self.best[i], sink: &sinks[i] };
        S::call(Walk { tree, place, ray: &rays[i], start, look: &mut look });
        self.packet.set_limit(i, &self.best[i]);
    }
}

impl<S: Simd, K: HitSink> ManyVisit<S> for NearestOfMany<'_, K> {
    #[inline(always)]
    fn open(&self) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        S::F::load(&self.packet.t_cull)
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let &Common { tree, prims, rays, sinks, .. } = &self.common;
        for block in tree.leaf_blocks(word) {
            let block = in_world(block, prims);
            block.closest_packet::<S, (), K>(rays, self.packet, mask, self.best, sinks, &mut ());
        }
    }

    #[inline(always)]
    fn few(&mut self, word: u32, mask: u32) -> bool {
        if mask.count_ones() > FEW {
            return false;
        }
        for i in bits(mask) {
            self.one::<S>(i, word);
        }
        true
    }
}

struct AnyOfMany<'a, K> {
    common: Common<'a, K>,
    packet: &'a PacketRays,
    open: u32,
}

impl<K: HitSink> AnyOfMany<'_, K> {
    #[inline(always)]
    fn one<S: Simd>(&mut self, i: usize, start: u32) {
        let &Common { tree, place, prims, rays, sinks } = &self.common;
        let mut look = Any { prims, ray: &rays[i], sink: &sinks[i], is_blocked: false };
        S::call(Walk { tree, place, ray: &rays[i], start, look: &mut look });
        self.open &= !(u32::from(look.is_blocked) << i);
    }
}

impl<S: Simd, K: HitSink> ManyVisit<S> for AnyOfMany<'_, K> {
    #[inline(always)]
    fn open(&self) -> u32 {
        self.open
    }

    #[inline(always)]
    fn limit(&self) -> S::F {
        S::F::load(&self.packet.t_cull)
    }

    #[inline(always)]
    fn leaf(&mut self, word: u32, mask: u32) {
        let &Common { tree, prims, rays, sinks, .. } = &self.common;
        for block in tree.leaf_blocks(word) {
            let block = in_world(block, prims);
            self.open &= !block.occluded_packet::<S, (), K>(rays, self.packet, mask & self.open, sinks, &mut ());
        }
    }

    #[inline(always)]
    fn few(&mut self, word: u32, mask: u32) -> bool {
        if mask.count_ones() > FEW {
            return false;
        }
        for i in bits(mask) {
            self.one::<S>(i, word);
        }
        true
    }
}

struct ClosestTask<'a, K> {
    visit: NearestOfMany<'a, K>,
    far: f64,
    active: u32,
}

impl<K: HitSink> Task for ClosestTask<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { mut visit, far, active } = self;
        if ManyVisit::<S>::few(&mut visit, 0, active) {
            return;
        }
        for i in bits(active) {
            visit.packet.set_limit(i, &visit.best[i]);
        }
        let &Common { tree, place, .. } = &visit.common;
        let lines = place.localize_packet::<S>(visit.packet, far, tree.reach32());
        for i in bits(active & !lines.fits()) {
            visit.one::<S>(i, 0);
        }
        walk_many(&tree.nodes, &lines, active & lines.fits(), &mut visit);
    }
}

struct OccludedTask<'a, K> {
    visit: AnyOfMany<'a, K>,
    far: f64,
}

impl<K: HitSink> Task for OccludedTask<'_, K> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self) -> u32 {
        let Self { mut visit, far } = self;
        let active = visit.open;
        if ManyVisit::<S>::few(&mut visit, 0, active) {
            return active & !visit.open;
        }
        let &Common { tree, place, .. } = &visit.common;
        let lines = place.localize_packet::<S>(visit.packet, far, tree.reach32());
        for i in bits(active & !lines.fits()) {
            visit.one::<S>(i, 0);
        }
        walk_many(&tree.nodes, &lines, visit.open & lines.fits(), &mut visit);
        active & !visit.open
    }
}

impl RigidTree {
    /// [`RigidTree::closest`] for each of the rays of `packet` in `active`; `best` and `sinks` go with them.
    #[inline(always)]
    pub(crate) fn closest_packet<S: Simd, K: HitSink>(
        &self,
        place: &RigidPlace,
        prims: &Triangles<'_>,
        (rays, packet): (&[TravRay], &mut RigidPacket),
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
    ) {
        let common = Common { tree: self, place, prims, rays, sinks };
        let far = packet.far;
        S::call(ClosestTask { visit: NearestOfMany { common, packet: &mut packet.rays, best }, far, active });
    }

    /// [`RigidTree::occluded`] for each of the rays of a new `packet` in `active`: the bits of those that are blocked.
    #[inline(always)]
    pub(crate) fn occluded_packet<S: Simd, K: HitSink>(
        &self,
        place: &RigidPlace,
        prims: &Triangles<'_>,
        (rays, packet): (&[TravRay], &RigidPacket),
        active: u32,
        sinks: &[K],
    ) -> u32 {
        let common = Common { tree: self, place, prims, rays, sinks };
        S::call(OccludedTask { visit: AnyOfMany { common, packet: &packet.rays, open: active }, far: packet.far })
    }
}
