//! The nearest hits of a packet by lane: bounds on their t in f32 and where their triangles are. Numbers are rounded at the end, for all rays at once.
//!
//! A triangle that is surely hit, by volumes farther from 0 than their errors, and surely before the best so far takes its place by that alone; one that
//! surely is neither falls away. What is left is tested in f64, and what that leaves in doubt, by integers.

use super::{
    PACKET, PacketRays, bits,
    leaf::{Spread, narrow3, wide3, widely},
};
use crate::{
    accel::{
        HitSink,
        block::{Evaluated, NO_PRIM, TriBlock, Volumes, Weights},
        fast::Divided,
        query::{SLACK, round_up},
    },
    geom::{
        Hit, InstanceId, PrimId,
        exact::{BOUND, RayRange, TriangleHit},
    },
    glam::Vec3,
    simd::{Lanes, Simd, Task},
};

/// No triangle yet.
const NOWHERE: u32 = u32::MAX;

/// A triangle of a structure that was left.
const ELSEWHERE: u32 = u32::MAX - 1;

/// A triangle, and the key that orders it among those of equal t.
#[derive(Clone, Copy)]
struct Known {
    corners: [Vec3; 3],
    key: (InstanceId, PrimId),
}

/// The best of each ray of a packet.
#[derive(Clone, Copy)]
pub(in crate::accel) struct Nearest {
    /// At most the exact t of the best, or infinity. [`PacketRays::t_cull`] is at least that t.
    low: [f32; PACKET],
    /// Four times the number of the best's block, and its lane.
    place: [u32; PACKET],
    /// u and v where leaves are tested fast; t is [`PacketRays::t_cull`].
    fast: [[f32; PACKET]; 2],
    /// The best of structures that were left.
    elsewhere: [Known; PACKET],
}

/// The least f32 above `4 * 2^-23`, what the roundings of t amount to.
const ROUNDING: f32 = 4.0 * f32::EPSILON;

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
    fn best<K: HitSink>(&self, blocks: &[TriBlock], i: usize, sink: &K) -> Known {
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
            for lane in bits(divided.mask) {
                let [t, u, v] = divided.tuv(lane);
                #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^28 blocks")]
                let place = (4 * number + lane) as u32;
                let limit = packet.t_cull[i];
                if block.prim(lane % 4) != NO_PRIM
                    && (t < limit || t <= limit && self.gives_way(blocks, i, place, sink))
                {
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

    /// The bits of the rays that hit something.
    #[inline(always)]
    fn found(&self) -> u32 {
        let mut found = 0;
        for i in 0..PACKET {
            found |= u32::from(self.place[i] != NOWHERE) << i;
        }
        found
    }

    #[inline(always)]
    fn answer_fast<K: HitSink>(
        &self,
        packet: &PacketRays,
        blocks: &[TriBlock],
        found: u32,
        sink: &K,
        out: &mut [Option<Hit>],
    ) {
        for i in 0..out.len().min(PACKET) {
            out[i] = None;
            if found >> i & 1 == 1 {
                let (t, u, v) = (packet.t_cull[i], self.fast[0][i], self.fast[1][i]);
                let (instance, prim) = self.best(blocks, i, sink).key;
                out[i] = Some(Hit { t, u, v, prim, instance });
            }
        }
    }

    /// The hits of all rays, rounded, into `out`; `blocks` and `sink` are those of the structure that was not left, if any.
    #[inline(always)]
    pub(in crate::accel) fn answer<S: Simd, K: HitSink>(
        &self,
        packet: &PacketRays,
        blocks: &[TriBlock],
        sink: &K,
        out: &mut [Option<Hit>],
    ) {
        let found = self.found() & (u32::MAX >> (32 - out.len()));
        if found == 0 {
            out.fill(None);
            return;
        }
        if packet.fast {
            self.answer_fast(packet, blocks, found, sink, out);
            return;
        }
        let mut corners = [[[0.0; PACKET]; 3]; 3];
        let mut keys = [(InstanceId(0), PrimId(0)); PACKET];
        for i in bits(found) {
            let i = i % PACKET;
            if self.place[i] == ELSEWHERE {
                let Known { corners: [a, b, c], key } = &self.elsewhere[i];
                for (rows, corner) in corners.iter_mut().zip([a, b, c]) {
                    (rows[0][i], rows[1][i], rows[2][i]) = (corner.x, corner.y, corner.z);
                }
                keys[i] = *key;
            } else {
                let place = self.place[i] as usize;
                keys[i] = sink.key(blocks[place / 4].spread(place % 4, &mut corners, i));
            }
        }
        let mut tuv = [[0.0; PACKET]; 3];
        let mut rounded = 0;
        for first in (0..S::F::LEN).step_by(S::D::LEN) {
            let part = found >> first & S::D::ALL;
            if part != 0 {
                rounded |= round::<S>(packet, &corners, first, part, &mut tuv) << first;
            }
        }
        let [t, u, v] = &tuv;
        for i in 0..out.len().min(PACKET) {
            let (instance, prim) = keys[i];
            let hit = Hit { t: t[i], u: u[i], v: v[i], prim, instance };
            out[i] = if found >> i & 1 == 1 { Some(hit) } else { None };
        }
        for i in bits(found & !rounded) {
            out[i] = exactly(packet, i, &self.best(blocks, i, sink));
        }
    }
}

/// A number of each axis of ray i in all lanes.
#[inline(always)]
fn splat3<S: Simd>([x, y, z]: &[[f32; PACKET]; 3], i: usize) -> [S::D4; 3] {
    [S::D4::splat(f64::from(x[i])), S::D4::splat(f64::from(y[i])), S::D4::splat(f64::from(z[i]))]
}

/// The triangle at a place.
#[inline(always)]
fn known<K: HitSink>(blocks: &[TriBlock], place: u32, sink: &K) -> Known {
    let (block, lane) = (&blocks[place as usize / 4], place as usize % 4);
    Known { corners: block.corners(lane), key: sink.key(PrimId(block.prim(lane))) }
}

#[cold]
#[inline(never)]
fn exactly(packet: &PacketRays, i: usize, best: &Known) -> Option<Hit> {
    let range = packet.range(i);
    let [t, u, v] = TriangleHit::test(&range, best.corners)?.tuv(&range);
    let (instance, prim) = best.key;
    Some(Hit { t, u, v, prim, instance })
}

/// Rounds t, u and v of the rays in `part`, counted from number `first` on, and their triangles: the rays whose numbers f64 settles.
#[inline(always)]
fn round<S: Simd>(
    packet: &PacketRays,
    corners: &[[[f32; PACKET]; 3]; 3],
    first: usize,
    part: u32,
    tuv: &mut [[f32; PACKET]; 3],
) -> u32 {
    let [a, b, c] = corners;
    let triangles = [wide3::<S>(a, first), wide3::<S>(b, first), wide3::<S>(c, first)];
    let volumes = Volumes::new(triangles, wide3::<S>(&packet.origin32, first), wide3::<S>(&packet.dir32, first));
    let (t_near, t_far) = (S::load_wide(&packet.t_near32[first..]), S::load_wide(&packet.t_far[first..]));
    let scale = S::load_wide(&packet.scale[first..]) * S::D::splat(BOUND);
    let weights = Weights { scale, t_near, t_far, t_limit: t_far };
    let evaluated = Evaluated::new(&volumes, part, &weights);
    let [t_low, t_high, inv_det, u, v, det_error, uv_error] = evaluated.rows;
    let [t_row, u_row, v_row] = tuv;
    let mut agreed = evaluated.sure & S::agreed(t_low, t_high, &mut t_row[first..]);
    let (q, slack) = quotient([u, uv_error], inv_det, det_error);
    agreed &= S::agreed(q - slack, q + slack, &mut u_row[first..]);
    let (q, slack) = quotient([v, uv_error], inv_det, det_error);
    agreed & S::agreed(q - slack, q + slack, &mut v_row[first..])
}

/// As [`Quotients`](crate::geom::exact::Quotients): a volume over D, and a bound on its error.
#[inline(always)]
fn quotient<L: Lanes<Elem = f64>>([volume, error]: [L; 2], inv_det: L, det_error: L) -> (L, L) {
    let q = volume * inv_det;
    let slack = q.abs().mul_add_loose(det_error, error) * inv_det.abs() * L::splat(2.0);
    (q, q.abs().mul_add_loose(L::splat(4.0 * f64::EPSILON), slack))
}

/// What f32 makes of the volumes of a triangle and its rays.
struct Bounded<L> {
    t_low: L,
    t_high: L,
    /// Rays whose t is bounded.
    solid: u32,
    /// Rays that surely meet the triangle and whose t is bounded.
    sure: u32,
}

impl Spread {
    /// As [`Quotients`](crate::geom::exact::Quotients) in f32; [`SLACK`] is above what underflow takes.
    #[inline(always)]
    fn bounded<L: Lanes<Elem = f32>>(&self, lane: usize, [det, u, v, t]: [L; 4]) -> Bounded<L> {
        let [uv_error, det_error, t_error] = self.errors(lane);
        let w = det - u - v;
        let (error, det_error) = (L::splat(uv_error), L::splat(det_error));
        let inside = error.lt(u.min(v).min(w)) | u.max(v).max(w).lt(-error);
        let solid = (det_error * L::splat(4.0)).le(det.abs());
        let inv_det = L::splat(1.0) / det;
        let t = t * inv_det;
        let slack = t.abs().mul_add_loose(det_error, L::splat(t_error)) * inv_det.abs() * L::splat(2.0);
        let slack = t.abs().mul_add_loose(L::splat(ROUNDING), slack) + L::splat(SLACK);
        Bounded { t_low: t - slack, t_high: t + slack, solid, sure: solid & inside }
    }
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

impl PacketRays {
    /// A ray by itself.
    #[inline(always)]
    fn range(&self, i: usize) -> RayRange {
        let [[ox, oy, oz], [dx, dy, dz]] = [&self.origin32, &self.dir32];
        RayRange {
            origin: Vec3::new(ox[i], oy[i], oz[i]),
            t_near: self.t_near32[i],
            dir: Vec3::new(dx[i], dy[i], dz[i]),
            t_far: self.t_far[i],
        }
    }
}

impl TriBlock {
    /// Writes the corners of a triangle to lane i of their rows: its number.
    #[inline(always)]
    fn spread(&self, lane: usize, rows: &mut [[[f32; PACKET]; 3]; 3], i: usize) -> PrimId {
        let corners = self.corners_by_axis();
        for corner in 0..3 {
            for axis in 0..3 {
                rows[corner][axis][i] = corners[corner][axis][lane];
            }
        }
        PrimId(self.prim(lane))
    }
}

impl TriBlock {
    /// Ray i by itself against the triangles of the block, in f64; `None` where it misses all.
    #[inline(always)]
    fn weigh<S: Simd>(&self, packet: &PacketRays, i: usize) -> Option<Evaluated<S::D4>> {
        let (origin, dir) = (splat3::<S>(&packet.origin32, i), splat3::<S>(&packet.dir32, i));
        let volumes = Volumes::<S::D4>::new(self.widened::<S>(), origin, dir);
        let open = volumes.open(S::D4::splat(packet.uv_error[i]));
        if open == 0 {
            return None;
        }
        let weights = Weights {
            scale: S::D4::splat(BOUND * f64::from(packet.scale[i])),
            t_near: S::D4::splat(f64::from(packet.t_near32[i])),
            t_far: S::D4::splat(f64::from(packet.t_far[i])),
            t_limit: S::D4::splat(f64::from(packet.t_cull[i])),
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
