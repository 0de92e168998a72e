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

use super::{
    Closest, Counter, HitSink, TravRay,
    block::{BlockRay, Evaluated, NO_PRIM, Spilled, TriBlock, Volumes, Weights, cross, dot, norm1, splat3, sub},
    fast::{Divided, accepts},
    query::{GROW, ORDINARY_MAX, SHRINK, SLACK, blocks},
};
use crate::{
    geom::{Aabb, Precision, PrimId, exact::BOUND},
    simd::{Lanes, Simd},
};

/// Most rays in a packet.
pub const PACKET: usize = 16;

/// A bit for every ray.
const ALL: u32 = u32::MAX >> (32 - PACKET);

/// Up to this many open rays are tested one by one.
const FEW: u32 = 2;

type Row = [f64; PACKET];

/// The rays of a packet by component. Triangle tests in f64 widen what they load.
pub(super) struct PacketRays {
    pub(super) origin32: [[f32; PACKET]; 3],
    pub(super) dir32: [[f32; PACKET]; 3],
    pub(super) t_near32: [f32; PACKET],
    /// At least `t_limit`.
    pub(super) t_cull: [f32; PACKET],
    t_far: [f32; PACKET],
    /// `|dir|∞`.
    scale: [f32; PACKET],
    /// Nothing beyond counts any more.
    t_limit: Row,
    common_origin: bool,
    /// The greatest `|dir|∞`.
    longest: f32,
    /// Bound on `|origin - first origin|₁`.
    spread: f32,
    /// Greatest coordinate of the triangles to come, as in [`BlockRay::new`].
    reach: f32,
    /// Products of what the rays and the triangles hold neither overflow in f32 nor lose more than [`TINY`] by underflow.
    moderate: bool,
    /// Triangles are tested as [`Forms::leaves`](crate::geom::Forms) names it.
    fast: bool,
}

/// Magnitudes of coordinates and directions up to which volumes in f32 do not overflow: 2^30.
const MODERATE: f32 = 1_073_741_824.0;

/// [`BOUND`] for f32, with room for the roundings of the bound itself, which is evaluated in f32.
const BOUND32: f32 = 20.0 / 16_777_216.0;

/// Above what volumes of moderate numbers lose by underflow: products off by 2^-150, a few of them, times factors below 2^32.
const TINY: f32 = f32::from_bits((127 - 110) << 23);

impl PacketRays {
    /// Spreads up to [`PACKET`] rays, at least one; lanes without a ray repeat the last and must not be active. The blocks that they are
    /// tested with stay within `reach` of 0.
    #[inline(always)]
    pub(super) fn new(rays: &[TravRay], reach: f32) -> Self {
        let row = [0.0; PACKET];
        // Filled in place: a struct of this size made elsewhere would be copied.
        let mut out = Self {
            origin32: [row; 3],
            dir32: [row; 3],
            t_near32: row,
            t_cull: row,
            t_far: row,
            scale: row,
            t_limit: [0.0; PACKET],
            common_origin: false,
            longest: 0.0,
            spread: 0.0,
            reach,
            moderate: false,
            fast: rays[0].forms().leaves == Precision::Fast,
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
            let scale = range.dir.abs().max_element();
            out.scale[i] = scale;
            out.longest = if scale > out.longest { scale } else { out.longest };
            out.t_near32[i] = range.t_near;
            out.t_cull[i] = range.t_far;
            out.t_far[i] = range.t_far;
            out.t_limit[i] = f64::from(range.t_far);
        }
        out.common_origin = differing == 0;
        let (mut low, mut high) = (first, first);
        if !out.common_origin {
            for ray in rays {
                (low, high) = (ray.range().origin.min(low), ray.range().origin.max(high));
            }
            out.spread = (high - low).element_sum();
        }
        let far = low.abs().max(high.abs()).max_element().max(reach).max(out.longest);
        out.moderate = far <= MODERATE;
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

type Rows3 = [[f32; 4]; 3];

/// What the four triangles of a block have for every ray of a packet, in f32.
struct Spread {
    n: Rows3,
    /// For a common origin `e2 x s` and `s x e1`, else e2 and e1.
    to_u: Rows3,
    to_v: Rows3,
    /// For a common origin; else `v0`.
    t: [f32; 4],
    v0: Rows3,
    /// What U, V and W may be off by: 0 where nobody asks, infinite where nothing bounds it.
    errors: [f32; 4],
}

#[inline(always)]
fn store3<L: Lanes<Elem = f32>>(lanes: [L; 3], rows: &mut Rows3) {
    lanes[0].store(&mut rows[0]);
    lanes[1].store(&mut rows[1]);
    lanes[2].store(&mut rows[2]);
}

impl Spread {
    /// Filled in place by [`Spread::fill`]: a struct of this size made elsewhere would be copied.
    const EMPTY: Self = Self {
        n: [[0.0; 4]; 3],
        to_u: [[0.0; 4]; 3],
        to_v: [[0.0; 4]; 3],
        t: [0.0; 4],
        v0: [[0.0; 4]; 3],
        errors: [0.0; 4],
    };

    #[inline(always)]
    fn fill<S: Simd>(&mut self, block: &TriBlock, packet: &PacketRays) {
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
            let size = ns.mul_add_loose(n1 + n2, n1 * n2);
            let errors = size.mul_add_loose(S::F4::splat(BOUND32 * packet.longest), S::F4::splat(TINY));
            errors.store(&mut self.errors);
        } else {
            self.errors = [f32::INFINITY; 4];
        }
    }

    /// D, U, V and T of a triangle for rays from `origin` along `dir`, and the rays that it is not surely missed by.
    #[inline(always)]
    fn test<L: Lanes<Elem = f32>>(
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
fn narrow3<S: Simd>(rows: &[[f32; PACKET]; 3]) -> [S::F; 3] {
    [S::F::load(&rows[0]), S::F::load(&rows[1]), S::F::load(&rows[2])]
}

#[inline(always)]
fn wide3<S: Simd>(rows: &[[f32; PACKET]; 3], first: usize) -> [S::D; 3] {
    [S::load_wide(&rows[0][first..]), S::load_wide(&rows[1][first..]), S::load_wide(&rows[2][first..])]
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

/// Triangle `lane` of a block against the rays in `open`, counted from number `first` on, in f64.
#[inline(always)]
fn widely<S: Simd>(block: &TriBlock, lane: usize, packet: &PacketRays, first: usize, open: u32) -> Evaluated<S::D> {
    let [a, b, c] = block.corners(lane);
    let (a, b, c) = (a.as_dvec3().to_array(), b.as_dvec3().to_array(), c.as_dvec3().to_array());
    let (origin, dir) = (wide3::<S>(&packet.origin32, first), wide3::<S>(&packet.dir32, first));
    let volumes = Volumes::new([splat3(&a), splat3(&b), splat3(&c)], origin, dir);
    let weights = Weights {
        scale: S::load_wide(&packet.scale[first..]) * S::D::splat(BOUND),
        t_near: S::load_wide(&packet.t_near32[first..]),
        t_far: S::load_wide(&packet.t_far[first..]),
        t_limit: S::D::load(&packet.t_limit[first..]),
    };
    Evaluated::new(&volumes, open, &weights)
}

/// t, u and v of a packet's rays in memory.
struct Stored([[f32; PACKET]; 3]);

impl Stored {
    #[inline(always)]
    fn new<L: Lanes<Elem = f32>>(divided: &Divided<L>) -> Self {
        let mut rows = [[0.0; PACKET]; 3];
        divided.t.store(&mut rows[0]);
        divided.u.store(&mut rows[1]);
        divided.v.store(&mut rows[2]);
        Self(rows)
    }

    #[inline(always)]
    fn tuv(&self, ray: usize) -> [f32; 3] {
        let [t, u, v] = &self.0;
        [t[ray], u[ray], v[ray]]
    }
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
                    let stored = Stored::new(&divided);
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
                    let stored = Stored::new(&divided);
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
