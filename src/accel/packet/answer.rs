//! The hits of a packet, rounded all at once.

use super::{
    PACKET, PacketRays, bits,
    leaf::wide3,
    nearest::{ELSEWHERE, Known, NOWHERE, Nearest},
};
use crate::{
    accel::{
        HitSink,
        block::{Evaluated, TriBlock, Volumes, Weights},
    },
    geom::{
        Hit, InstanceId, PrimId,
        exact::{BOUND, TriangleHit},
    },
    simd::{Lanes, Simd},
};

impl Nearest {
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
