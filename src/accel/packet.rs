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
    query::{GROW, ORDINARY_MAX, SHRINK, SLACK, blocks},
};
use crate::{
    geom::{
        Aabb, PrimId,
        exact::{BOUND, Quotients, TriangleHit},
    },
    simd::{Lanes, Simd},
};

/// Most rays in a packet.
pub const PACKET: usize = 16;

/// A bit for every ray.
const ALL: u32 = u32::MAX >> (32 - PACKET);

/// Up to this many open rays are tested one by one.
const FEW: u32 = 2;

type Row = [f64; PACKET];

/// The rays of a packet by component. Triangle tests widen what they load.
pub(super) struct PacketRays {
    pub(super) origin32: [[f32; PACKET]; 3],
    pub(super) dir32: [[f32; PACKET]; 3],
    pub(super) t_near32: [f32; PACKET],
    /// At least `t_limit`.
    pub(super) t_cull: [f32; PACKET],
    t_far: [f32; PACKET],
    /// `|dir|∞`.
    reach: [f32; PACKET],
    /// Nothing beyond counts any more.
    t_limit: Row,
    common_origin: bool,
}

impl PacketRays {
    /// Spreads up to [`PACKET`] rays, at least one; lanes without a ray repeat the last and must not be active.
    #[inline(always)]
    pub(super) fn new(rays: &[TravRay]) -> Self {
        let row = [0.0; PACKET];
        // Filled in place: a struct of this size made elsewhere would be copied.
        let mut out = Self {
            origin32: [row; 3],
            dir32: [row; 3],
            t_near32: row,
            t_cull: row,
            t_far: row,
            reach: row,
            t_limit: [0.0; PACKET],
            common_origin: false,
        };
        let mut differing = 0;
        let first = rays[0].range().origin;
        for i in 0..PACKET {
            let range = rays[i.min(rays.len() - 1)].range();
            for axis in 0..3 {
                out.origin32[axis][i] = range.origin[axis];
                out.dir32[axis][i] = range.dir[axis];
                differing |= range.origin[axis].to_bits() ^ first[axis].to_bits();
            }
            out.reach[i] = range.dir.abs().max_element();
            out.t_near32[i] = range.t_near;
            out.t_cull[i] = range.t_far;
            out.t_far[i] = range.t_far;
            out.t_limit[i] = f64::from(range.t_far);
        }
        out.common_origin = differing == 0;
        out
    }

    /// Takes over a ray's best hit.
    #[inline(always)]
    pub(super) fn set_limit(&mut self, ray: usize, best: &Closest) {
        self.t_limit[ray] = best.t_high();
        self.t_cull[ray] = best.t_cull();
    }
}

/// The rays of a packet against single boxes, whatever the signs of their directions.
#[derive(Debug)]
pub(crate) struct PacketBoxes {
    origin: [[f32; PACKET]; 3],
    inv: [[f32; PACKET]; 3],
    t_near: [f32; PACKET],
    /// Rays whose misses the f32 test proves: ordinary ones that are parallel to no plane of a box.
    tested: u32,
}

impl PacketBoxes {
    #[inline(always)]
    pub(crate) fn new<S: Simd>(rays: &[TravRay; PACKET]) -> Self {
        let row = [0.0; PACKET];
        let mut out = Self { origin: [row; 3], inv: [row; 3], t_near: row, tested: 0 };
        let mut dir = [row; 3];
        for (i, ray) in rays.iter().enumerate() {
            let range = ray.range();
            for (axis, dir) in dir.iter_mut().enumerate() {
                out.origin[axis][i] = range.origin[axis];
                dir[i] = range.dir[axis];
            }
            out.t_near[i] = range.t_near;
            let slanted = range.dir.x != 0.0 && range.dir.y != 0.0 && range.dir.z != 0.0;
            out.tested |= u32::from(slanted && ray.is_ordinary()) << i;
        }
        for (inv, dir) in out.inv.iter_mut().zip(&dir) {
            for first in (0..PACKET).step_by(S::F::LEN) {
                (S::F::splat(1.0) / S::F::load(&dir[first..])).store(&mut inv[first..]);
            }
        }
        out
    }

    /// The rays that may meet `aabb` at `limits` or before.
    ///
    /// The bounds of [`SHRINK`] and [`GROW`] hold for a factor applied last as for one applied to the reciprocal, and
    /// rounding keeps order, so the lesser product is the entry's.
    #[inline(always)]
    pub(crate) fn meeting<S: Simd>(&self, aabb: &Aabb, limits: &[f32; PACKET]) -> u32 {
        if aabb.is_empty() {
            return 0;
        }
        let reach = aabb.min.abs().max(aabb.max.abs()).max_element();
        if reach.is_nan() || reach > ORDINARY_MAX {
            return ALL;
        }
        let mut mask = ALL & !self.tested;
        for first in (0..PACKET).step_by(S::F::LEN) {
            let (mut near, mut far) = (S::F::load(&self.t_near[first..]), S::F::load(&limits[first..]));
            for axis in 0..3 {
                let (origin, inv) = (S::F::load(&self.origin[axis][first..]), S::F::load(&self.inv[axis][first..]));
                let low = (S::F::splat(aabb.min[axis]) - origin) * inv;
                let high = (S::F::splat(aabb.max[axis]) - origin) * inv;
                near = (low.min(high) * S::F::splat(SHRINK)).max(near);
                far = (low.max(high) * S::F::splat(GROW)).min(far);
            }
            mask |= (near - far).le(S::F::splat(SLACK)) << first;
        }
        mask
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
            let [x, y, z] = &packet.origin32;
            let origin = [S::D4::splat(f64::from(x[0])), S::D4::splat(f64::from(y[0])), S::D4::splat(f64::from(z[0]))];
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
    [S::D::splat(rows[0][lane]), S::D::splat(rows[1][lane]), S::D::splat(rows[2][lane])]
}

#[inline(always)]
fn load3<S: Simd>(rows: &[[f32; PACKET]; 3], first: usize) -> W3<S> {
    [S::load_wide(&rows[0][first..]), S::load_wide(&rows[1][first..]), S::load_wide(&rows[2][first..])]
}

#[inline(always)]
fn wide_dot<S: Simd>(a: W3<S>, b: W3<S>) -> S::D {
    a[0].mul_add_loose(b[0], a[1].mul_add_loose(b[1], a[2] * b[2]))
}

#[inline(always)]
fn wide_cross<S: Simd>(a: W3<S>, b: W3<S>) -> W3<S> {
    [
        a[1].mul_sub_loose(b[2], a[2] * b[1]),
        a[2].mul_sub_loose(b[0], a[0] * b[2]),
        a[0].mul_sub_loose(b[1], a[1] * b[0]),
    ]
}

/// Triangle `lane` against the rays from number `first` on.
#[inline(always)]
fn evaluate<S: Simd>(tri: &Spread, lane: usize, packet: &PacketRays, first: usize) -> Evaluated<S> {
    let dir = load3::<S>(&packet.dir32, first);
    let det = wide_dot::<S>(dir, splat3::<S>(&tri.n, lane));
    let (u, v, t, ns);
    if packet.common_origin {
        u = wide_dot::<S>(dir, splat3::<S>(&tri.cu, lane));
        v = wide_dot::<S>(dir, splat3::<S>(&tri.cv, lane));
        t = S::D::splat(tri.t[lane]);
        ns = S::D::splat(tri.ns[lane]);
    } else {
        let (origin, v0) = (load3::<S>(&packet.origin32, first), splat3::<S>(&tri.v0, lane));
        let s = [origin[0] - v0[0], origin[1] - v0[1], origin[2] - v0[2]];
        let m = wide_cross::<S>(s, dir);
        u = wide_dot::<S>(splat3::<S>(&tri.e2, lane), m);
        v = -wide_dot::<S>(splat3::<S>(&tri.e1, lane), m);
        t = -wide_dot::<S>(s, splat3::<S>(&tri.n, lane));
        ns = s[0].abs() + s[1].abs() + s[2].abs();
    }
    let w = det - u - v;
    let n12 = S::D::splat(tri.n12[lane]);
    let reach = S::load_wide(&packet.reach[first..]) * S::D::splat(BOUND);
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
    let (t_near, t_far) = (S::load_wide(&packet.t_near32[first..]), S::load_wide(&packet.t_far[first..]));
    let t_limit = S::D::load(&packet.t_limit[first..]);
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
        let [t_low, t_high, inv_det, u, v, det_error, uv_error] = &self.0;
        let (t_low, t_high, inv_det) = (t_low[ray], t_high[ray], inv_det[ray]);
        let (u, v, det_error, uv_error) = (u[ray], v[ray], det_error[ray], uv_error[ray]);
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

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        geom::Ray,
        simd::{SimdLevel, Task, dispatch},
    };

    struct Meeting<'a> {
        rays: &'a [TravRay; PACKET],
        aabb: Aabb,
    }

    impl Task for Meeting<'_> {
        type Output = u32;

        #[inline(always)]
        fn run<S: Simd>(self) -> u32 {
            let limits = std::array::from_fn(|i| self.rays[i].range().t_far);
            PacketBoxes::new::<S>(self.rays).meeting::<S>(&self.aabb, &limits)
        }
    }

    fn meeting(level: SimdLevel, rays: &[Ray; PACKET], aabb: Aabb) -> u32 {
        let rays = std::array::from_fn(|i| TravRay::new(&rays[i]).unwrap());
        dispatch(level, Meeting { rays: &rays, aabb })
    }

    #[test]
    fn rays_that_pass_a_box_by_are_left_out() {
        let towards = |i: usize| Ray::new(Vec3::new(0.3, 0.4, 5.0), Vec3::new(i as f32 * 0.05 - 0.01, 0.01, -1.0));
        let short = |i: usize| Ray { t_far: 3.9, ..towards(i) };
        let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        for level in SimdLevel::available() {
            assert_eq!(meeting(level, &std::array::from_fn(towards), unit), 0b1111, "{level}");
            assert_eq!(meeting(level, &std::array::from_fn(short), unit), 0, "{level}");
            assert_eq!(meeting(level, &std::array::from_fn(towards), Aabb::EMPTY), 0, "{level}");
        }
    }

    #[test]
    fn rays_that_the_test_cannot_judge_are_kept() {
        let far = Aabb { min: Vec3::splat(9.0), max: Vec3::splat(10.0) };
        let odd = |i: usize| {
            let dir = [Vec3::X, Vec3::new(1e-30, 1.0, 1.0), Vec3::NEG_Y, Vec3::new(1.0, 1e30, 1.0)][i % 4];
            Ray::new(Vec3::ZERO, dir)
        };
        let huge = Aabb { min: Vec3::splat(1e30), max: Vec3::splat(2e30) };
        for level in SimdLevel::available() {
            assert_eq!(meeting(level, &std::array::from_fn(odd), far), 0xffff, "{level}");
            let plain = |_| Ray::new(Vec3::ZERO, -Vec3::ONE);
            assert_eq!(meeting(level, &std::array::from_fn(plain), huge), 0xffff, "{level}");
        }
    }

    proptest! {
        /// The point is exact, and the ray enters along x where it leaves along y: no slack but the test's own.
        #[test]
        fn a_box_that_a_ray_touches_in_one_point_is_met(
            origin in prop::array::uniform3(-100_i8..100),
            dir in prop::array::uniform3(prop_oneof![-100_i8..0, 1_i8..101]),
            t in 1_u8..64,
            sizes in prop::array::uniform3(1_u8..100),
        ) {
            let (origin, dir) = (Vec3::from(origin.map(f32::from)), Vec3::from(dir.map(f32::from)));
            let touched = origin + dir * f32::from(t);
            let size = Vec3::from(sizes.map(f32::from)) * dir.signum() * Vec3::new(1.0, -1.0, 1.0);
            let aabb = Aabb::from_points([touched, touched + size]);
            let ray = Ray { t_far: f32::from(t), ..Ray::new(origin, dir) };
            for level in SimdLevel::available() {
                prop_assert_eq!(meeting(level, &[ray; PACKET], aabb), 0xffff, "{}", level);
            }
        }

        #[test]
        fn a_box_around_a_point_of_a_ray_is_met(
            origin in prop::array::uniform3(-1e3_f32..1e3),
            dir in prop::array::uniform3(prop_oneof![Just(0.0_f32), -1e3_f32..1e3, -1e-6_f32..1e-6]),
            t in 0_u8..64,
            grow in prop::array::uniform3(0.0_f32..1.0),
        ) {
            let t = f32::from(t) * 0.25;
            let ray = Ray { t_far: t, ..Ray::new(Vec3::from(origin), Vec3::from(dir)) };
            prop_assume!(ray.dir != Vec3::ZERO);
            // t is a multiple of a quarter, so the point is off by one rounding of the sum.
            let near = (ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t)).as_vec3();
            let aabb = Aabb {
                min: Vec3::new(near.x.next_down(), near.y.next_down(), near.z.next_down()),
                max: Vec3::new(near.x.next_up(), near.y.next_up(), near.z.next_up()) + Vec3::from(grow),
            };
            for level in SimdLevel::available() {
                prop_assert_eq!(meeting(level, &[ray; PACKET], aabb), 0xffff, "{}", level);
            }
        }
    }
}
