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
//!
//! All rays of a packet are tested in f32 first, where the same derivation gives the bound [`BOUND32`] times the same sizes: most triangles
//! of a leaf are missed by most rays, and f32 proves that for twice as many rays at a time. What is left is tested in f64, or, where
//! [`Forms::leaves`](crate::geom::Forms) is fast, divided as it is.

use super::{BOUND32, FEW, PACKET, PacketRays, TINY, bits};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::{BlockRay, Evaluated, NO_PRIM, Spilled, TriBlock, Volumes, Weights, cross, dot, norm1, splat3, sub},
        fast::{Divided, Stored, accepts},
        query::blocks,
    },
    geom::{PrimId, exact::BOUND},
    simd::{Lanes, Simd},
};

type Rows3 = [[f32; 4]; 3];

/// What the four triangles of a block have for every ray of a packet, in f32.
pub(in crate::accel) struct Spread {
    n: Rows3,
    /// For a common origin `e2 x s` and `s x e1`, else e2 and e1.
    to_u: Rows3,
    to_v: Rows3,
    /// For a common origin; else `v0`.
    t: [f32; 4],
    v0: Rows3,
    /// What U, V and W, D, and T may be off by: 0 where nobody asks, infinite where nothing bounds it.
    errors: [f32; 4],
    det_errors: [f32; 4],
    t_errors: [f32; 4],
}

#[inline(always)]
fn store3<L: Lanes<Elem = f32>>(lanes: [L; 3], rows: &mut Rows3) {
    lanes[0].store(&mut rows[0]);
    lanes[1].store(&mut rows[1]);
    lanes[2].store(&mut rows[2]);
}

impl Spread {
    /// Filled in place by [`Spread::fill`]: a struct of this size made elsewhere would be copied.
    pub(in crate::accel) const EMPTY: Self = Self {
        n: [[0.0; 4]; 3],
        to_u: [[0.0; 4]; 3],
        to_v: [[0.0; 4]; 3],
        t: [0.0; 4],
        v0: [[0.0; 4]; 3],
        errors: [0.0; 4],
        det_errors: [0.0; 4],
        t_errors: [0.0; 4],
    };

    #[inline(always)]
    pub(super) fn fill<S: Simd>(&mut self, block: &TriBlock, packet: &PacketRays) {
        let [x, y, z] = &packet.origin32;
        let [v0, v1, v2] = block.narrow::<S>();
        let (e1, e2, s) = (sub(v1, v0), sub(v2, v0), sub(splat3(&[x[0], y[0], z[0]]), v0));
        let n = cross(e2, e1);
        store3(n, &mut self.n);
        if packet.common_origin {
            store3(cross(e2, s), &mut self.to_u);
            store3(cross(s, e1), &mut self.to_v);
            (-dot(s, n)).store(&mut self.t);
        } else {
            store3(e2, &mut self.to_u);
            store3(e1, &mut self.to_v);
            store3(v0, &mut self.v0);
        }
        if packet.fast {
            return;
        }
        if packet.moderate {
            let (n1, n2, ns) = (norm1(e1), norm1(e2), norm1(s) + S::F4::splat(packet.spread));
            let (n12, tiny) = (n1 * n2, S::F4::splat(TINY));
            let scale = S::F4::splat(BOUND32 * packet.longest);
            ns.mul_add_loose(n1 + n2, n12).mul_add_loose(scale, tiny).store(&mut self.errors);
            n12.mul_add_loose(scale, tiny).store(&mut self.det_errors);
            (n12 * ns).mul_add_loose(S::F4::splat(BOUND32), tiny).store(&mut self.t_errors);
        } else {
            self.errors = [f32::INFINITY; 4];
            self.det_errors = [f32::INFINITY; 4];
            self.t_errors = [f32::INFINITY; 4];
        }
    }

    /// What U, V and W, D, and T of a triangle may be off by.
    #[inline(always)]
    pub(super) fn errors(&self, lane: usize) -> [f32; 3] {
        [self.errors[lane], self.det_errors[lane], self.t_errors[lane]]
    }

    /// D, U, V and T of a triangle for rays from `origin` along `dir`, and the rays that it is not surely missed by.
    #[inline(always)]
    pub(super) fn test<L: Lanes<Elem = f32>>(
        &self,
        lane: usize,
        [origin, dir]: [[L; 3]; 2],
        common_origin: bool,
    ) -> ([L; 4], u32) {
        let n = row3(&self.n, lane);
        let det = dot(dir, n);
        let (u, v, t);
        if common_origin {
            u = dot(dir, row3(&self.to_u, lane));
            v = dot(dir, row3(&self.to_v, lane));
            t = L::splat(self.t[lane]);
        } else {
            let s = sub(origin, row3(&self.v0, lane));
            let m = cross(s, dir);
            u = dot(row3(&self.to_u, lane), m);
            v = -dot(row3(&self.to_v, lane), m);
            t = -dot(s, n);
        }
        let w = det - u - v;
        let error = L::splat(self.errors[lane]);
        let outside = u.min(v).min(w).lt(-error) & error.lt(u.max(v).max(w));
        ([det, u, v, t], L::ALL & !outside)
    }
}

#[inline(always)]
fn row3<L: Lanes<Elem = f32>>(rows: &Rows3, lane: usize) -> [L; 3] {
    [L::splat(rows[0][lane]), L::splat(rows[1][lane]), L::splat(rows[2][lane])]
}

#[inline(always)]
pub(super) fn narrow3<S: Simd>(rows: &[[f32; PACKET]; 3]) -> [S::F; 3] {
    [S::F::load(&rows[0]), S::F::load(&rows[1]), S::F::load(&rows[2])]
}

#[inline(always)]
pub(super) fn wide3<S: Simd>(rows: &[[f32; PACKET]; 3], first: usize) -> [S::D; 3] {
    [S::load_wide(&rows[0][first..]), S::load_wide(&rows[1][first..]), S::load_wide(&rows[2][first..])]
}

/// Triangle `lane` of a block against the rays in `open`, counted from number `first` on, in f64.
#[inline(always)]
pub(super) fn widely<S: Simd>(
    block: &TriBlock,
    lane: usize,
    packet: &PacketRays,
    first: usize,
    open: u32,
) -> Evaluated<S::D> {
    let [a, b, c] = block.corners(lane);
    let (a, b, c) = (a.as_dvec3().to_array(), b.as_dvec3().to_array(), c.as_dvec3().to_array());
    let (origin, dir) = (wide3::<S>(&packet.origin32, first), wide3::<S>(&packet.dir32, first));
    let volumes = Volumes::new([splat3(&a), splat3(&b), splat3(&c)], origin, dir);
    let weights = Weights {
        scale: S::load_wide(&packet.scale[first..]) * S::D::splat(BOUND),
        t_near: S::load_wide(&packet.t_near32[first..]),
        t_far: S::load_wide(&packet.t_far[first..]),
        t_limit: S::load_wide(&packet.t_cull[first..]),
    };
    Evaluated::new(&volumes, open, &weights)
}

impl TriBlock {
    /// Offers every triangle of the block to the active rays that it may beat the best of.
    #[inline(always)]
    pub(in crate::accel) fn closest_packet<S: Simd, C: Counter, K: HitSink>(
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
                let block_ray = BlockRay::new(&rays[i], packet.reach);
                self.closest::<S, C, K>(&rays[i], &block_ray, &mut best[i], &sinks[i], count);
                packet.set_limit(i, &best[i]);
            }
            return;
        }
        count.block();
        let mut tri = Spread::EMPTY;
        tri.fill::<S>(self, packet);
        let lines = [narrow3::<S>(&packet.origin32), narrow3::<S>(&packet.dir32)];
        for lane in 0..4 {
            let prim = PrimId(self.prim(lane));
            if prim.0 == NO_PRIM {
                break;
            }
            let (volumes, open) = tri.test(lane, lines, packet.common_origin);
            let open = open & active;
            if open == 0 {
                continue;
            }
            if packet.fast {
                let (near, limit) = (S::F::load(&packet.t_near32), S::F::load(&packet.t_cull));
                let divided = Divided::new(volumes, open, near, limit);
                if divided.mask != 0 {
                    let stored = Stored::<PACKET>::new(&divided);
                    for i in bits(divided.mask) {
                        best[i].keep_fast(stored.tuv(i), prim, &sinks[i]);
                        packet.set_limit(i, &best[i]);
                    }
                }
                continue;
            }
            for first in (0..S::F::LEN).step_by(S::D::LEN) {
                let open = (open >> first) & S::D::ALL;
                if open == 0 {
                    continue;
                }
                let evaluated = widely::<S>(self, lane, packet, first, open);
                if evaluated.mask == 0 {
                    continue;
                }
                let spilled = Spilled::<8>::new(&evaluated);
                for bit in bits(evaluated.mask) {
                    let i = first + bit;
                    if (evaluated.sure >> bit) & 1 == 1 {
                        best[i].keep(spilled.hit(bit, self, lane), &rays[i], prim, &sinks[i]);
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
    pub(in crate::accel) fn occluded_packet<S: Simd, C: Counter, K: HitSink>(
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
                let block_ray = BlockRay::new(&rays[i], packet.reach);
                blocked |= u32::from(self.occluded::<S, C, K>(&rays[i], &block_ray, &sinks[i], count)) << i;
            }
            return blocked;
        }
        count.block();
        let mut tri = Spread::EMPTY;
        tri.fill::<S>(self, packet);
        let lines = [narrow3::<S>(&packet.origin32), narrow3::<S>(&packet.dir32)];
        for lane in 0..4 {
            let prim = PrimId(self.prim(lane));
            if prim.0 == NO_PRIM {
                break;
            }
            let (volumes, open) = tri.test(lane, lines, packet.common_origin);
            let open = open & active & !blocked;
            if open == 0 {
                continue;
            }
            if packet.fast {
                let (near, far) = (S::F::load(&packet.t_near32), S::F::load(&packet.t_far));
                let divided = Divided::new(volumes, open, near, far);
                if K::ACCEPTS_ALL {
                    blocked |= divided.mask;
                } else if divided.mask != 0 {
                    let stored = Stored::<PACKET>::new(&divided);
                    for i in bits(divided.mask) {
                        blocked |= u32::from(accepts(stored.tuv(i), prim, &sinks[i])) << i;
                    }
                }
                continue;
            }
            for first in (0..S::F::LEN).step_by(S::D::LEN) {
                let open = (open >> first) & S::D::ALL;
                if open == 0 {
                    continue;
                }
                let evaluated = widely::<S>(self, lane, packet, first, open);
                let mut hits = evaluated.mask;
                if K::ACCEPTS_ALL {
                    blocked |= (hits & evaluated.sure) << first;
                    hits &= !evaluated.sure;
                }
                if hits == 0 {
                    continue;
                }
                let spilled = Spilled::<8>::new(&evaluated);
                for bit in bits(hits) {
                    let i = first + bit;
                    let hit = if (evaluated.sure >> bit) & 1 == 1 {
                        blocks(&spilled.hit(bit, self, lane), &rays[i], prim, &sinks[i])
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
