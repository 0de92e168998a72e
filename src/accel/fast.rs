//! The triangle test of [`Precision::Fast`](crate::geom::Precision): Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle
//! Intersection", 1997, in f32, four triangles to a vector, one division a block that is hit.
//!
//! Nothing bounds its roundings and nothing decides what they leave in doubt: rays may slip through edges that triangles share, hit
//! what they pass by, and find the farther of two triangles. `t`, `u` and `v` are what comes out; equal `t` goes to the lower key.
//! Volumes that overflow miss. Levels with fused multiplication round less often than the portable one, and packets order their
//! products in another way than single rays, so answers agree only to within these errors.

use super::{
    Closest, HitSink, TravRay,
    block::{NO_PRIM, TriBlock, Volumes, dot, splat3},
};
use crate::{
    geom::{Hit, PrimId, exact::RayRange},
    glam::Vec3,
    simd::{Array, Lanes, Simd},
};

/// What lanes hold after the division.
pub(super) struct Divided<L> {
    /// Lanes that are hit between `t_near` and the limit.
    pub(super) mask: u32,
    pub(super) t: L,
    pub(super) u: L,
    pub(super) v: L,
}

impl<L: Lanes<Elem = f32>> Divided<L> {
    /// Divides the volumes D, U, V and T of the lanes in `open`, which have U, V and W of one sign, or one that is not a number.
    ///
    /// A finite t means that D is no zero or denormal, and a reciprocal other than 0 that it is finite. u and v are looked at again, because
    /// volumes that overflow come this far.
    #[inline(always)]
    pub(super) fn new([det, u, v, t]: [L; 4], open: u32, t_near: L, t_limit: L) -> Self {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let inv = one / det;
        let (t, u, v) = (t * inv, u * inv, v * inv);
        let inside = zero.le(u) & zero.le(v) & (u + v).le(L::splat(1.0 + 1.0 / 1_048_576.0));
        let mask = open & inside & t_near.le(t) & t.le(t_limit) & zero.lt(inv.abs());
        // Adding +0 turns -0 into +0.
        Self { mask, t: t + zero, u: u.min(one) + zero, v: v.min(one) + zero }
    }
}

/// t, u and v of up to N lanes in memory.
pub(super) struct Stored<const N: usize>([[f32; N]; 3]);

impl<const N: usize> Stored<N> {
    #[inline(always)]
    pub(super) fn new<L: Lanes<Elem = f32>>(divided: &Divided<L>) -> Self {
        let mut rows = [[0.0; N]; 3];
        divided.t.store(&mut rows[0]);
        divided.u.store(&mut rows[1]);
        divided.v.store(&mut rows[2]);
        Self(rows)
    }

    #[inline(always)]
    pub(super) fn tuv(&self, lane: usize) -> [f32; 3] {
        let [t, u, v] = &self.0;
        [t[lane], u[lane], v[lane]]
    }
}

impl TriBlock {
    #[inline(always)]
    pub(super) fn test_fast<S: Simd>(&self, range: &RayRange, t_limit: f32) -> Divided<S::F4> {
        let (origin, dir) = (splat3(&range.origin.to_array()), splat3(&range.dir.to_array()));
        let volumes = Volumes::<S::F4>::new(self.narrow::<S>(), origin, dir);
        let open = volumes.open(S::F4::splat(0.0));
        if open == 0 {
            return Divided { mask: 0, t: volumes.det, u: volumes.u, v: volumes.v };
        }
        let t = dot(volumes.e2, volumes.q);
        let (t_near, t_limit) = (S::F4::splat(range.t_near), S::F4::splat(t_limit));
        Divided::new([volumes.det, volumes.u, volumes.v, t], open, t_near, t_limit)
    }

    /// As [`TriBlock::closest`], in f32.
    #[inline(always)]
    pub(super) fn closest_fast<S: Simd, K: HitSink>(&self, ray: &TravRay, best: &mut Closest, sink: &K) {
        let divided = self.test_fast::<S>(ray.range(), best.t_cull());
        if divided.mask == 0 {
            return;
        }
        let stored = Stored::<4>::new(&divided);
        let mut mask = divided.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            let prim = PrimId(self.prim(lane));
            if prim.0 != NO_PRIM {
                best.keep_fast(stored.tuv(lane), prim, sink);
            }
        }
    }

    /// As [`TriBlock::occluded`], in f32.
    #[inline(always)]
    pub(super) fn occluded_fast<S: Simd, K: HitSink>(&self, ray: &TravRay, sink: &K) -> bool {
        let divided = self.test_fast::<S>(ray.range(), ray.range().t_far);
        if divided.mask == 0 || K::ACCEPTS_ALL {
            return divided.mask != 0;
        }
        let stored = Stored::<4>::new(&divided);
        let mut mask = divided.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            let prim = PrimId(self.prim(lane));
            if prim.0 != NO_PRIM && accepts(stored.tuv(lane), prim, sink) {
                return true;
            }
        }
        false
    }
}

/// Whether a hit counts for an occlusion query.
#[inline(always)]
pub(super) fn accepts<K: HitSink>([t, u, v]: [f32; 3], prim: PrimId, sink: &K) -> bool {
    let (instance, prim) = sink.key(prim);
    K::ACCEPTS_ALL || sink.accept(&Hit { t, u, v, prim, instance })
}

/// t, u and v of one triangle by itself, by the portable form; `None` where it is missed up to `t_limit`.
pub(super) fn test_one(range: &RayRange, corners: [Vec3; 3], t_limit: f32) -> Option<[f32; 3]> {
    type One = Array<f32, 1>;
    let [a, b, c] = corners.map(|p| splat3::<One>(&p.to_array()));
    let (origin, dir) = (splat3(&range.origin.to_array()), splat3(&range.dir.to_array()));
    let volumes = Volumes::new([a, b, c], origin, dir);
    let open = volumes.open(One::splat(0.0));
    let t = dot(volumes.e2, volumes.q);
    let (t_near, t_limit) = (One::splat(range.t_near), One::splat(t_limit));
    let Divided { mask, t, u, v } = Divided::new([volumes.det, volumes.u, volumes.v, t], open, t_near, t_limit);
    let mut out = [0.0; 3];
    t.store(&mut out);
    u.store(&mut out[1..]);
    v.store(&mut out[2..]);
    (mask != 0).then_some(out)
}
