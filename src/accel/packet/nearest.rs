//! The nearest hits of a packet by lane: bounds on their t in f32 and where their triangles are. Numbers are rounded at the end, for all rays at once.
//!
//! A triangle that is surely hit, by volumes farther from 0 than their errors, and surely before the best so far takes its place by that alone; one that
//! surely is neither falls away. What is left is tested in f64, and what that leaves in doubt, by integers.

use super::{
    PACKET, PacketRays, bits,
    leaf::{Spread, narrow3, widely},
};
use crate::{
    accel::{
        HitSink,
        block::{NO_PRIM, TriBlock},
        fast::{Divided, Stored},
        query::round_up,
    },
    geom::{InstanceId, PrimId, exact::TriangleHit},
    glam::Vec3,
    simd::{Lanes, Simd, Task},
};

/// No triangle yet.
pub(super) const NOWHERE: u32 = u32::MAX;

/// A triangle of a structure that was left.
pub(super) const ELSEWHERE: u32 = u32::MAX - 1;

/// A triangle, and the key that orders it among those of equal t.
#[derive(Clone, Copy)]
pub(super) struct Known {
    pub(super) corners: [Vec3; 3],
    pub(super) key: (InstanceId, PrimId),
}

/// The best of each ray of a packet.
#[derive(Clone, Copy)]
pub(in crate::accel) struct Nearest {
    /// At most the exact t of the best, or infinity. [`PacketRays::t_cull`] is at least that t.
    low: [f32; PACKET],
    /// Four times the number of the best's block, and its lane.
    pub(super) place: [u32; PACKET],
    /// u and v where leaves are tested fast; t is [`PacketRays::t_cull`].
    pub(super) fast: [[f32; PACKET]; 2],
    /// The best of structures that were left.
    pub(super) elsewhere: [Known; PACKET],
}

impl Nearest {
    /// Nothing hit yet.
    pub(in crate::accel) const NONE: Self = Self {
        low: [f32::INFINITY; PACKET],
        place: [NOWHERE; PACKET],
        fast: [[0.0; PACKET]; 2],
        elsewhere: [Known { corners: [Vec3::ZERO; 3], key: (InstanceId(0), PrimId(0)) }; PACKET],
    };

    /// Forgets all hits.
    #[inline(always)]
    pub(in crate::accel) fn clear(&mut self) {
        self.low = [f32::INFINITY; PACKET];
        self.place = [NOWHERE; PACKET];
    }

    /// Leaves the structure of `blocks`: what was found in it is kept beside what other structures may hold.
    #[inline(always)]
    pub(in crate::accel) fn leave<K: HitSink>(&mut self, blocks: &[TriBlock], sink: &K) {
        for i in 0..PACKET {
            if self.place[i] < ELSEWHERE {
                self.elsewhere[i] = known(blocks, self.place[i], sink);
                self.place[i] = ELSEWHERE;
            }
        }
    }

    /// The best of a ray that has one.
    #[inline(always)]
    pub(super) fn best<K: HitSink>(&self, blocks: &[TriBlock], i: usize, sink: &K) -> Known {
        if self.place[i] == ELSEWHERE { self.elsewhere[i] } else { known(blocks, self.place[i], sink) }
    }

    /// Offers the triangles of block `number` to the active rays.
    #[inline(always)]
    pub(in crate::accel) fn offer<S: Simd, K: HitSink>(
        &mut self,
        packet: &mut PacketRays,
        (blocks, number): (&[TriBlock], usize),
        active: u32,
        tri: &mut Spread,
        sink: &K,
    ) {
        let block = &blocks[number];
        tri.fill::<S>(block, packet);
        let lines = [narrow3::<S>(&packet.origin32), narrow3::<S>(&packet.dir32)];
        for lane in 0..4 {
            if block.prim(lane) == NO_PRIM {
                break;
            }
            let (volumes, open) = tri.test(lane, lines, packet.common_origin);
            let open = open & active;
            if open == 0 {
                continue;
            }
            #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^28 blocks")]
            let place = (4 * number + lane) as u32;
            let (near, limit) = (S::F::load(&packet.t_near32), S::F::load(&packet.t_cull));
            if packet.fast {
                let divided = Divided::new(volumes, open, near, limit);
                let nearer = divided.mask & divided.t.lt(limit);
                self.keep_fast::<S>(packet, &divided, nearer, place);
                let equal = divided.mask & !nearer;
                if equal != 0 {
                    let mut kept = 0;
                    for i in bits(equal) {
                        kept |= u32::from(self.gives_way(blocks, i % PACKET, place, sink)) << i;
                    }
                    self.keep_fast::<S>(packet, &divided, kept, place);
                }
                continue;
            }
            let bounded = tri.bounded::<S::F>(lane, volumes);
            let beyond = bounded.solid & (limit.lt(bounded.t_low) | bounded.t_high.lt(near));
            let open = open & !beyond;
            if open == 0 {
                continue;
            }
            let low = S::F::load(&self.low);
            let before = bounded.t_high.lt(low) & bounded.t_high.le(S::F::load(&packet.t_far));
            let sure = open & bounded.sure & near.le(bounded.t_low) & before;
            if sure != 0 {
                S::F::select(sure, bounded.t_low, low).store(&mut self.low);
                S::F::select(sure, bounded.t_high, limit).store(&mut packet.t_cull);
                S::write_where(sure, place, &mut self.place);
            }
            let doubtful = open & !sure;
            if doubtful != 0 {
                S::call(Settle { nearest: self, packet, blocks, place, doubtful, sink });
            }
        }
    }

    #[inline(always)]
    fn keep_fast<S: Simd>(&mut self, packet: &mut PacketRays, hit: &Divided<S::F>, kept: u32, place: u32) {
        let [u, v] = &mut self.fast;
        for (row, lanes) in [(&mut packet.t_cull, hit.t), (u, hit.u), (v, hit.v)] {
            S::F::select(kept, lanes, S::F::load(row)).store(row);
        }
        S::write_where(kept, place, &mut self.place);
    }

    /// True when ray i has no best or one whose key is above that of another triangle.
    fn gives_way<K: HitSink>(&self, blocks: &[TriBlock], i: usize, place: u32, sink: &K) -> bool {
        self.place[i] == NOWHERE || known(blocks, place, sink).key < self.best(blocks, i, sink).key
    }

    /// Offers the triangles of block `number` to ray i by itself.
    #[inline(always)]
    pub(in crate::accel) fn offer_one<S: Simd, K: HitSink>(
        &mut self,
        packet: &mut PacketRays,
        (blocks, number): (&[TriBlock], usize),
        i: usize,
        sink: &K,
    ) {
        let block = &blocks[number];
        if packet.fast {
            let divided = block.test_fast::<S>(&packet.range(i), packet.t_cull[i]);
            if divided.mask == 0 {
                return;
            }
            let stored = Stored::<4>::new(&divided);
            for lane in bits(divided.mask) {
                let lane = lane % 4;
                let [t, u, v] = stored.tuv(lane);
                #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^28 blocks")]
                let place = (4 * number + lane) as u32;
                let limit = packet.t_cull[i];
                if block.prim(lane) != NO_PRIM && (t < limit || t <= limit && self.gives_way(blocks, i, place, sink)) {
                    (packet.t_cull[i], self.fast[0][i], self.fast[1][i]) = (t, u, v);
                    self.place[i] = place;
                }
            }
            return;
        }
        let Some(evaluated) = block.weigh::<S>(packet, i) else { return };
        let (mut low, mut high) = ([0.0; 4], [0.0; 4]);
        evaluated.rows[0].store(&mut low);
        evaluated.rows[1].store(&mut high);
        let mut mask = evaluated.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            if block.prim(lane) != NO_PRIM {
                #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^28 blocks")]
                let place = (4 * number + lane) as u32;
                let sure = evaluated.sure >> lane & 1 == 1;
                self.settle(packet, blocks, (i, place), (sure, [low[lane], high[lane]]), sink);
            }
        }
    }

    /// Keeps a triangle that f64 finds hit by ray i, surely or not, if it is the nearest.
    #[inline(always)]
    fn settle<K: HitSink>(
        &mut self,
        packet: &mut PacketRays,
        blocks: &[TriBlock],
        (i, place): (usize, u32),
        (sure, [low, high]): (bool, [f64; 2]),
        sink: &K,
    ) {
        if sure && high < f64::from(self.low[i]) {
            self.keep(packet, i, place, [low, high]);
        } else if !sure || low <= f64::from(packet.t_cull[i]) {
            self.decide(packet, blocks, i, place, sink);
        }
    }

    /// Decides between the best of a ray and another triangle by exact numbers.
    #[cold]
    #[inline(never)]
    fn decide<K: HitSink>(&mut self, packet: &mut PacketRays, blocks: &[TriBlock], i: usize, place: u32, sink: &K) {
        let ray = packet.range(i);
        let Known { corners, key } = known(blocks, place, sink);
        let Some(hit) = TriangleHit::test(&ray, corners) else { return };
        if self.place[i] != NOWHERE {
            let best = self.best(blocks, i, sink);
            if let Some(other) = TriangleHit::test(&ray, best.corners)
                && hit.cmp_t(&other, &ray).then(key.cmp(&best.key)).is_gt()
            {
                return;
            }
        }
        self.keep(packet, i, place, [hit.t_low, hit.t_high]);
    }

    #[inline(always)]
    fn keep(&mut self, packet: &mut PacketRays, i: usize, place: u32, [low, high]: [f64; 2]) {
        self.low[i] = -round_up(-low);
        packet.t_cull[i] = round_up(high);
        self.place[i] = place;
    }
}

/// The triangle at a place.
#[inline(always)]
fn known<K: HitSink>(blocks: &[TriBlock], place: u32, sink: &K) -> Known {
    let (block, lane) = (&blocks[place as usize / 4], place as usize % 4);
    Known { corners: block.corners(lane), key: sink.key(PrimId(block.prim(lane))) }
}

/// Tests one triangle against rays that f32 leaves in doubt.
struct Settle<'a, K> {
    nearest: &'a mut Nearest,
    packet: &'a mut PacketRays,
    blocks: &'a [TriBlock],
    place: u32,
    doubtful: u32,
    sink: &'a K,
}

impl<K: HitSink> Task for Settle<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { nearest, packet, blocks, place, doubtful, sink } = self;
        let (block, lane) = (&blocks[place as usize / 4], place as usize % 4);
        for first in (0..S::F::LEN).step_by(S::D::LEN) {
            let part = doubtful >> first & S::D::ALL;
            if part == 0 {
                continue;
            }
            let evaluated = widely::<S>(block, lane, packet, first, part);
            let (mut low, mut high) = ([0.0; 8], [0.0; 8]);
            evaluated.rows[0].store(&mut low);
            evaluated.rows[1].store(&mut high);
            for bit in bits(evaluated.mask) {
                let (i, bit) = ((first + bit) % PACKET, bit % 8);
                let sure = evaluated.sure >> bit & 1 == 1;
                nearest.settle(packet, blocks, (i, place), (sure, [low[bit], high[bit]]), sink);
            }
        }
    }
}
