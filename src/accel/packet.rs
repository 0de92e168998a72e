//! Blocks of triangles against packets of rays, one ray to a lane.
//!
//! The four volumes of [`crate::geom::exact`] are taken in an order that shares work between the rays of a packet. With
//! `n = e2 x e1` and `m = s x d`:
//!
//! ```text
//! D = d . n    U = e2 . m    V = -e1 . m    T = -s . n
//! ```
//!
//! and for rays from one origin `U = d . (e2 x s)`, `V = d . (s x e1)`, where all but d belongs to the triangle. Every term has the
//! same factors and no more roundings than in the order that [`BOUND`] is derived for, so the bound holds.

use super::{
    Closest, Counter, HitSink, TravRay,
    block::{BlockRay, D3, NO_PRIM, TriBlock, cross, dot, norm1, sub},
    query::blocks,
};
use crate::{
    geom::{
        PrimId,
        exact::{BOUND, Quotients, TriangleHit},
    },
    simd::{Lanes, Simd},
};

/// Most rays in a packet.
pub const PACKET: usize = 16;

/// Up to this many open rays are tested one by one.
const FEW: u32 = 2;

type Row = [f64; PACKET];

/// The rays of a packet by component, for node tests in f32 and triangles in f64.
pub(super) struct PacketRays {
    pub(super) origin32: [[f32; PACKET]; 3],
    pub(super) dir32: [[f32; PACKET]; 3],
    pub(super) t_near32: [f32; PACKET],
    /// At least `t_limit`.
    pub(super) t_cull: [f32; PACKET],
    origin: [Row; 3],
    dir: [Row; 3],
    reach: Row,
    t_near: Row,
    t_far: Row,
    /// Nothing beyond counts any more.
    t_limit: Row,
    common_origin: bool,
}

#[inline(always)]
fn widen(to: &mut Row, from: &[f32; PACKET]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to = f64::from(from);
    }
}

/// True when all numbers have the same bits.
#[inline(always)]
fn is_uniform(row: &[f32; PACKET]) -> bool {
    row.iter().fold(0, |bits, x| bits | (x.to_bits() ^ row[0].to_bits())) == 0
}

impl PacketRays {
    /// Spreads up to [`PACKET`] rays, at least one; lanes without a ray repeat the last and must not be active.
    #[inline(always)]
    pub(super) fn new(rays: &[TravRay]) -> Self {
        let (narrow, wide) = ([0.0; PACKET], [0.0; PACKET]);
        // Filled in place: a struct of this size made elsewhere would be copied.
        let mut out = Self {
            origin32: [narrow; 3],
            dir32: [narrow; 3],
            t_near32: narrow,
            t_cull: narrow,
            origin: [wide; 3],
            dir: [wide; 3],
            reach: wide,
            t_near: wide,
            t_far: wide,
            t_limit: wide,
            common_origin: false,
        };
        for i in 0..PACKET {
            let range = rays[i.min(rays.len() - 1)].range();
            for axis in 0..3 {
                out.origin32[axis][i] = range.origin[axis];
                out.dir32[axis][i] = range.dir[axis];
            }
            out.t_near32[i] = range.t_near;
            out.t_cull[i] = range.t_far;
        }
        for axis in 0..3 {
            widen(&mut out.origin[axis], &out.origin32[axis]);
            widen(&mut out.dir[axis], &out.dir32[axis]);
        }
        widen(&mut out.t_near, &out.t_near32);
        widen(&mut out.t_far, &out.t_cull);
        widen(&mut out.t_limit, &out.t_cull);
        let [x, y, z] = &out.dir32;
        for i in 0..PACKET {
            out.reach[i] = BOUND * f64::from(x[i].abs().max(y[i].abs()).max(z[i].abs()));
        }
        out.common_origin = out.origin32.iter().all(is_uniform);
        out
    }

    /// Takes over a ray's best hit.
    #[inline(always)]
    pub(super) fn set_limit(&mut self, ray: usize, best: &Closest) {
        self.t_limit[ray] = best.t_high();
        self.t_cull[ray] = best.t_cull();
    }
}

type Rows3 = [[f64; 4]; 3];

/// What the four triangles of a block have for every ray of a packet.
struct Spread {
    v0: Rows3,
    e1: Rows3,
    e2: Rows3,
    n: Rows3,
    /// `|e1|₁ |e2|₁` and `|e1|₁ + |e2|₁`.
    n12: [f64; 4],
    sum: [f64; 4],
    /// For a common origin: `e2 x s`, `s x e1`, T and `|s|₁`.
    cu: Rows3,
    cv: Rows3,
    t: [f64; 4],
    ns: [f64; 4],
}

#[inline(always)]
fn stored<S: Simd>(lanes: D3<S>) -> Rows3 {
    let mut rows = [[0.0; 4]; 3];
    for (row, lane) in rows.iter_mut().zip(lanes) {
        lane.store(row);
    }
    rows
}

#[inline(always)]
fn stored1<S: Simd>(lane: S::D4) -> [f64; 4] {
    let mut row = [0.0; 4];
    lane.store(&mut row);
    row
}

impl Spread {
    #[inline(always)]
    fn new<S: Simd>(block: &TriBlock, packet: &PacketRays) -> Self {
        let [v0, v1, v2] = block.widened::<S>();
        let (e1, e2) = (sub::<S>(v1, v0), sub::<S>(v2, v0));
        let n = cross::<S>(e2, e1);
        let (n1, n2) = (norm1::<S>(e1), norm1::<S>(e2));
        let mut out = Self {
            v0: stored::<S>(v0),
            e1: stored::<S>(e1),
            e2: stored::<S>(e2),
            n: stored::<S>(n),
            n12: stored1::<S>(n1 * n2),
            sum: stored1::<S>(n1 + n2),
            cu: [[0.0; 4]; 3],
            cv: [[0.0; 4]; 3],
            t: [0.0; 4],
            ns: [0.0; 4],
        };
        if packet.common_origin {
            let origin = packet.origin.map(|row| S::D4::splat(row[0]));
            let s = sub::<S>(origin, v0);
            out.cu = stored::<S>(cross::<S>(e2, s));
            out.cv = stored::<S>(cross::<S>(s, e1));
            out.t = stored1::<S>(-dot::<S>(s, n));
            out.ns = stored1::<S>(norm1::<S>(s));
        }
        out
    }
}

/// One triangle against as many rays as `S::D` has lanes.
struct Evaluated<S: Simd> {
    /// Rays that may hit.
    mask: u32,
    /// Rays that surely hit, within their range.
    sure: u32,
    rows: [S::D; 7],
}

type W3<S> = [<S as Simd>::D; 3];

#[inline(always)]
fn splat3<S: Simd>(rows: &Rows3, lane: usize) -> W3<S> {
    rows.map(|row| S::D::splat(row[lane]))
}

#[inline(always)]
fn load3<S: Simd>(rows: &[Row; 3], first: usize) -> W3<S> {
    [S::D::load(&rows[0][first..]), S::D::load(&rows[1][first..]), S::D::load(&rows[2][first..])]
}

#[inline(always)]
fn wide_dot<S: Simd>(a: W3<S>, b: W3<S>) -> S::D {
    a[0].mul_add_loose(b[0], a[1].mul_add_loose(b[1], a[2] * b[2]))
}

#[inline(always)]
fn wide_cross<S: Simd>(a: W3<S>, b: W3<S>) -> W3<S> {
    let minor = |i: usize, j: usize| a[i].mul_sub_loose(b[j], a[j] * b[i]);
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Triangle `lane` against the rays from number `first` on.
#[inline(always)]
fn evaluate<S: Simd>(tri: &Spread, lane: usize, packet: &PacketRays, first: usize) -> Evaluated<S> {
    let dir = load3::<S>(&packet.dir, first);
    let det = wide_dot::<S>(dir, splat3::<S>(&tri.n, lane));
    let (u, v, t, ns);
    if packet.common_origin {
        u = wide_dot::<S>(dir, splat3::<S>(&tri.cu, lane));
        v = wide_dot::<S>(dir, splat3::<S>(&tri.cv, lane));
        t = S::D::splat(tri.t[lane]);
        ns = S::D::splat(tri.ns[lane]);
    } else {
        let (origin, v0) = (load3::<S>(&packet.origin, first), splat3::<S>(&tri.v0, lane));
        let s = [origin[0] - v0[0], origin[1] - v0[1], origin[2] - v0[2]];
        let m = wide_cross::<S>(s, dir);
        u = wide_dot::<S>(splat3::<S>(&tri.e2, lane), m);
        v = -wide_dot::<S>(splat3::<S>(&tri.e1, lane), m);
        t = -wide_dot::<S>(s, splat3::<S>(&tri.n, lane));
        ns = s[0].abs() + s[1].abs() + s[2].abs();
    }
    let w = det - u - v;
    let (n12, reach) = (S::D::splat(tri.n12[lane]), S::D::load(&packet.reach[first..]));
    let det_error = reach * n12;
    let uv_error = reach * ns.mul_add_loose(S::D::splat(tri.sum[lane]), n12);
    let (low, high) = (u.min(v).min(w), u.max(v).max(w));
    let mask = S::D::splat(0.0).lt(det_error) & !(low.lt(-uv_error) & uv_error.lt(high));
    if mask == 0 {
        return Evaluated { mask, sure: 0, rows: [det; 7] };
    }
    // As `Quotients::bounded`.
    let t_error = n12 * ns * S::D::splat(BOUND);
    let inv_det = S::D::splat(1.0) / det;
    let t = t * inv_det;
    let slack = t.abs().mul_add_loose(det_error, t_error) * inv_det.abs() * S::D::splat(2.0);
    let slack = t.abs().mul_add_loose(S::D::splat(4.0 * f64::EPSILON), slack);
    let (t_low, t_high) = (t - slack, t + slack);
    let [t_near, t_far, t_limit] = [&packet.t_near, &packet.t_far, &packet.t_limit].map(|r| S::D::load(&r[first..]));
    let solid = (det_error * S::D::splat(4.0)).le(det.abs());
    let beyond = solid & (t_limit.lt(t_low) | t_high.lt(t_near));
    let inside = uv_error.lt(low) | high.lt(-uv_error);
    let sure = solid & inside & t_near.le(t_low) & t_high.le(t_far);
    Evaluated { mask: mask & !beyond, sure, rows: [t_low, t_high, inv_det, u, v, det_error, uv_error] }
}

/// The rows of an [`Evaluated`] in memory, for access by ray.
struct Spilled([[f64; 8]; 7]);

impl Spilled {
    #[inline(always)]
    fn new<S: Simd>(evaluated: &Evaluated<S>) -> Self {
        let mut rows = [[0.0; 8]; 7];
        for (row, lanes) in rows.iter_mut().zip(evaluated.rows) {
            lanes.store(row);
        }
        Self(rows)
    }

    #[inline(always)]
    fn hit(&self, block: &TriBlock, lane: usize, ray: usize) -> TriangleHit {
        let [t_low, t_high, inv_det, u, v, det_error, uv_error] = self.0.map(|row| row[ray]);
        let quotients = Quotients { inv_det, u, v, det_error, uv_error };
        TriangleHit { corners: block.corners(lane), t_low, t_high, quotients }
    }
}

/// Numbers of the set bits.
#[inline(always)]
pub(super) fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

impl TriBlock {
    /// Offers every triangle of the block to the active rays that it may beat the best of.
    #[inline(always)]
    pub(super) fn closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        packet: &mut PacketRays,
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        if active.count_ones() <= FEW {
            for i in bits(active) {
                self.closest::<S, C, K>(&rays[i], &BlockRay::new(&rays[i]), &mut best[i], &sinks[i], count);
                packet.set_limit(i, &best[i]);
            }
            return;
        }
        count.block();
        let tri = Spread::new::<S>(self, packet);
        for lane in 0..4 {
            let prim = PrimId(self.prim(lane));
            if prim.0 == NO_PRIM {
                break;
            }
            for first in (0..S::F::LEN).step_by(S::D::LEN) {
                let open = (active >> first) & S::D::ALL;
                if open == 0 {
                    continue;
                }
                let evaluated = evaluate::<S>(&tri, lane, packet, first);
                if evaluated.mask & open == 0 {
                    continue;
                }
                let spilled = Spilled::new(&evaluated);
                for bit in bits(evaluated.mask & open) {
                    let i = first + bit;
                    if (evaluated.sure >> bit) & 1 == 1 {
                        best[i].keep(spilled.hit(self, lane, bit), &rays[i], prim, &sinks[i]);
                    } else {
                        best[i].offer_exactly(&rays[i], self.corners(lane), prim, &sinks[i]);
                    }
                    packet.set_limit(i, &best[i]);
                }
            }
        }
    }

    /// The active rays that a triangle of the block blocks.
    #[inline(always)]
    pub(super) fn occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        packet: &PacketRays,
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        let mut blocked = 0;
        if active.count_ones() <= FEW {
            for i in bits(active) {
                let hit = self.occluded::<S, C, K>(&rays[i], &BlockRay::new(&rays[i]), &sinks[i], count);
                blocked |= u32::from(hit) << i;
            }
            return blocked;
        }
        count.block();
        let tri = Spread::new::<S>(self, packet);
        for lane in 0..4 {
            let prim = PrimId(self.prim(lane));
            if prim.0 == NO_PRIM {
                break;
            }
            for first in (0..S::F::LEN).step_by(S::D::LEN) {
                let open = ((active & !blocked) >> first) & S::D::ALL;
                if open == 0 {
                    continue;
                }
                let evaluated = evaluate::<S>(&tri, lane, packet, first);
                let hits = evaluated.mask & open;
                if K::ACCEPTS_ALL {
                    blocked |= (hits & evaluated.sure) << first;
                    for bit in bits(hits & !evaluated.sure) {
                        blocked |= u32::from(self.blocks_exactly(&rays[first + bit], lane, &sinks[first + bit]))
                            << (first + bit);
                    }
                    continue;
                }
                if hits == 0 {
                    continue;
                }
                let spilled = Spilled::new(&evaluated);
                for bit in bits(hits) {
                    let i = first + bit;
                    let hit = if (evaluated.sure >> bit) & 1 == 1 {
                        blocks(&spilled.hit(self, lane, bit), &rays[i], prim, &sinks[i])
                    } else {
                        self.blocks_exactly(&rays[i], lane, &sinks[i])
                    };
                    blocked |= u32::from(hit) << i;
                }
            }
        }
        blocked
    }
}
