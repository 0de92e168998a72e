//! Rays of a packet each by itself against blocks, in f64, and whether a block stops them.

use super::{
    PACKET, PacketRays, bits,
    leaf::{Spread, narrow3, widely},
};
use crate::{
    accel::{
        block::{Evaluated, NO_PRIM, TriBlock, Volumes, Weights},
        fast::Divided,
    },
    geom::exact::{BOUND, RayRange, TriangleHit},
    glam::Vec3,
    simd::{Lanes, Simd, Task},
};

impl PacketRays {
    /// A ray by itself.
    #[inline(always)]
    pub(super) fn range(&self, i: usize) -> RayRange {
        let [[ox, oy, oz], [dx, dy, dz]] = [&self.origin32, &self.dir32];
        RayRange {
            origin: Vec3::new(ox[i], oy[i], oz[i]),
            t_near: self.t_near32[i],
            dir: Vec3::new(dx[i], dy[i], dz[i]),
            t_far: self.t_far[i],
        }
    }
}

/// A number of each axis of ray i in all lanes.
#[inline(always)]
fn splat3<S: Simd>([x, y, z]: &[[f32; PACKET]; 3], i: usize) -> [S::D4; 3] {
    [spread::<S>(x[i]), spread::<S>(y[i]), spread::<S>(z[i])]
}

/// A number in all lanes: one instruction where it is spread before it is widened.
#[inline(always)]
fn spread<S: Simd>(number: f32) -> S::D4 {
    S::widen(S::F4::splat(number))
}

impl TriBlock {
    /// Ray i by itself against the triangles of the block, in f64; `None` where it misses all.
    #[inline(always)]
    pub(super) fn weigh<S: Simd>(&self, packet: &PacketRays, i: usize) -> Option<Evaluated<S::D4>> {
        let (origin, dir) = (splat3::<S>(&packet.origin32, i), splat3::<S>(&packet.dir32, i));
        let volumes = Volumes::<S::D4>::new(self.widened::<S>(), origin, dir);
        let open = volumes.open(S::D4::splat(packet.uv_error[i]));
        if open == 0 {
            return None;
        }
        let weights = Weights {
            scale: spread::<S>(packet.scale[i]) * S::D4::splat(BOUND),
            t_near: spread::<S>(packet.t_near32[i]),
            t_far: spread::<S>(packet.t_far[i]),
            t_limit: spread::<S>(packet.t_cull[i]),
        };
        let evaluated = Evaluated::new(&volumes, open, &weights);
        (evaluated.mask != 0).then_some(evaluated)
    }

    /// Whether a triangle of the block blocks ray i.
    #[inline(always)]
    pub(in crate::accel) fn blocks_one<S: Simd>(&self, packet: &PacketRays, i: usize) -> bool {
        if packet.fast {
            return self.test_fast::<S>(&packet.range(i), packet.t_far[i]).mask != 0;
        }
        let Some(evaluated) = self.weigh::<S>(packet, i) else { return false };
        let mut mask = evaluated.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            if self.prim(lane) != NO_PRIM && (evaluated.sure >> lane & 1 == 1 || self.stops_exactly(packet, i, lane)) {
                return true;
            }
        }
        false
    }

    #[cold]
    #[inline(never)]
    fn stops_exactly(&self, packet: &PacketRays, i: usize, lane: usize) -> bool {
        TriangleHit::exactly(&packet.range(i), self.corners(lane)).is_some()
    }

    /// The active rays that a triangle of the block blocks.
    #[inline(always)]
    pub(in crate::accel) fn blocked<S: Simd>(&self, packet: &PacketRays, active: u32, tri: &mut Spread) -> u32 {
        tri.fill::<S>(self, packet);
        let lines = [narrow3::<S>(&packet.origin32), narrow3::<S>(&packet.dir32)];
        let mut left = active;
        for lane in 0..4 {
            if self.prim(lane) == NO_PRIM {
                break;
            }
            let (volumes, open) = tri.test(lane, lines, packet.common_origin);
            let open = open & left;
            if open == 0 {
                continue;
            }
            let (near, far) = (S::F::load(&packet.t_near32), S::F::load(&packet.t_far));
            if packet.fast {
                left &= !Divided::new(volumes, open, near, far).mask;
                continue;
            }
            let bounded = tri.bounded::<S::F>(lane, volumes);
            let sure = open & bounded.sure & near.le(bounded.t_low) & bounded.t_high.le(far);
            left &= !sure;
            let beyond = bounded.solid & (far.lt(bounded.t_low) | bounded.t_high.lt(near));
            let doubtful = open & !(sure | beyond);
            if doubtful != 0 {
                left &= !S::call(Doubt { block: self, lane, packet, doubtful });
            }
            if left == 0 {
                break;
            }
        }
        active & !left
    }
}

/// Tests one triangle against rays that f32 leaves in doubt: those that it blocks.
struct Doubt<'a> {
    block: &'a TriBlock,
    lane: usize,
    packet: &'a PacketRays,
    doubtful: u32,
}

impl Task for Doubt<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self) -> u32 {
        let Self { block, lane, packet, doubtful } = self;
        let mut blocked = 0;
        for first in (0..S::F::LEN).step_by(S::D::LEN) {
            let part = doubtful >> first & S::D::ALL;
            if part == 0 {
                continue;
            }
            let evaluated = widely::<S>(block, lane, packet, first, part);
            blocked |= (evaluated.mask & evaluated.sure) << first;
            for bit in bits(evaluated.mask & !evaluated.sure) {
                let i = (first + bit) % PACKET;
                blocked |= u32::from(block.stops_exactly(packet, i, lane)) << i;
            }
        }
        blocked
    }
}
