//! Leaves: blocks of four triangles in structure-of-arrays form, tested against a ray at once.
//!
//! The test evaluates the volumes of [`crate::geom::exact`] in f64, four triangles to a vector, with their bounds. Lanes that
//! surely miss are dropped; sure hits are kept with their f64 values; only what is left in doubt goes to integers.
//! f64 costs no more instructions here than f32 would: four f64 fill an AVX register.

use glam::{Mat4, Vec3, Vec3A, Vec4};

use super::{Closest, Counter, HitSink, TravRay, query::blocks, sah::BLOCK};
use crate::{
    geom::{
        Aabb, PrimId, Triangles,
        exact::{BOUND, Quotients, TriangleHit},
    },
    simd::{Lanes, Simd},
};

/// Marks a lane without a triangle.
pub(super) const NO_PRIM: u32 = u32::MAX;

/// Four triangles: `corners[corner][axis][lane]`.
///
/// Lanes without a triangle, and triangles with a corner that is not finite, have all corners at one point: no area, no hit. It
/// is a corner of another triangle of the block, so that it widens no box; 0 where there is none.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(super) struct TriBlock {
    corners: [[[f32; 4]; 3]; 3],
    prims: [u32; 4],
}

const _: () = assert!(size_of::<TriBlock>() == 160);

/// What a refit of a block found.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockBounds {
    pub(super) aabb: Aabb,
    /// Sum of the half areas of the triangles' boxes.
    pub(super) own_area: f64,
}

impl TriBlock {
    /// A block of up to four triangles whose corners are still to be set by [`TriBlock::refit`].
    pub(super) fn new(prims: [u32; 4]) -> Self {
        Self { corners: [[[0.0; 4]; 3]; 3], prims }
    }

    /// Blocks that many triangles take.
    pub(super) fn count_for(triangles: usize) -> usize {
        triangles.div_ceil(BLOCK)
    }

    /// The blocks of these triangles, in order; the last may be short.
    pub(super) fn of(prims: &[u32]) -> impl Iterator<Item = Self> + '_ {
        prims.chunks(BLOCK).map(|chunk| {
            let mut lanes = [NO_PRIM; BLOCK];
            lanes[..chunk.len()].copy_from_slice(chunk);
            Self::new(lanes)
        })
    }

    /// Triangles of the block, in lane order.
    pub(super) fn prims(&self) -> impl Iterator<Item = PrimId> + '_ {
        self.prims.iter().filter(|&&p| p != NO_PRIM).map(|&p| PrimId(p))
    }

    /// Corners of the triangle in a lane.
    #[inline(always)]
    pub(super) fn corners(&self, lane: usize) -> [Vec3; 3] {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = &self.corners;
        [
            Vec3::new(ax[lane], ay[lane], az[lane]),
            Vec3::new(bx[lane], by[lane], bz[lane]),
            Vec3::new(cx[lane], cy[lane], cz[lane]),
        ]
    }

    /// Number of the triangle in a lane, or [`NO_PRIM`].
    #[inline(always)]
    pub(super) fn prim(&self, lane: usize) -> u32 {
        self.prims[lane]
    }

    /// The corners in f64.
    #[inline(always)]
    pub(super) fn widened<S: Simd>(&self) -> [D3<S>; 3] {
        let [a, b, c] = &self.corners;
        [widened3::<S>(a), widened3::<S>(b), widened3::<S>(c)]
    }

    /// The boxes of the four triangles: lower and upper planes of each axis. Those of lanes that are never hit are points.
    #[inline(always)]
    pub(super) fn boxes<S: Simd>(&self) -> [[S::F4; 2]; 3] {
        let [a, b, c] = &self.corners;
        let axis = |i: usize| {
            let (a, b, c) = (S::F4::load(&a[i]), S::F4::load(&b[i]), S::F4::load(&c[i]));
            [a.min(b).min(c), a.max(b).max(c)]
        };
        [axis(0), axis(1), axis(2)]
    }

    /// Takes the corners from `prims` and returns the box around them.
    #[inline(always)]
    pub(super) fn refit(&mut self, prims: &Triangles<'_>) -> BlockBounds {
        let mut min = Vec3A::INFINITY;
        let mut max = Vec3A::NEG_INFINITY;
        let mut own_area = 0.0;
        let mut rows = [[Vec4::ZERO; 4]; 3];
        let mut left = 15_u32;
        for (lane, &prim) in self.prims.iter().enumerate() {
            if prim == NO_PRIM {
                continue;
            }
            let [a, b, c] = prims.corners(PrimId(prim)).map(Vec3A::from);
            // A product with 0 is 0 unless the factor is infinite or NaN.
            let zero = (a * 0.0 + b * 0.0) + c * 0.0;
            if zero == Vec3A::ZERO {
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                min = min.min(low);
                max = max.max(high);
                let e = high - low;
                own_area += f64::from(e.x * e.y + e.y * e.z + e.z * e.x);
                left &= !(1 << lane);
                rows[0][lane] = a.extend(0.0);
                rows[1][lane] = b.extend(0.0);
                rows[2][lane] = c.extend(0.0);
            }
        }
        if left != 0 {
            let point = rows[0][(!left).trailing_zeros() as usize & 3];
            for lane in (0..4).filter(|lane| left >> lane & 1 == 1) {
                for row in &mut rows {
                    row[lane] = point;
                }
            }
        }
        for (corner, [a, b, c, d]) in self.corners.iter_mut().zip(rows) {
            let axes = Mat4::from_cols(a, b, c, d).transpose();
            *corner = [axes.x_axis.to_array(), axes.y_axis.to_array(), axes.z_axis.to_array()];
        }
        BlockBounds { aabb: Aabb { min: min.into(), max: max.into() }, own_area }
    }

    /// Evaluates all four triangles. Lanes of triangles that surely miss, or are surely hit outside of
    /// `[t_near, t_limit]`, are not in the mask; `t_limit` is at most the ray's end.
    #[inline(always)]
    fn evaluate<S: Simd>(&self, ray: &BlockRay, t_limit: f64) -> Evaluated<S> {
        let [v0, v1, v2] = self.widened::<S>();
        let (origin, dir) = (splat3::<S>(&ray.origin), splat3::<S>(&ray.dir));
        let (e1, e2, s) = (sub::<S>(v1, v0), sub::<S>(v2, v0), sub::<S>(origin, v0));
        let (p, q) = (cross::<S>(dir, e2), cross::<S>(s, e1));
        let (det, u, v) = (dot::<S>(e1, p), dot::<S>(s, p), dot::<S>(dir, q));
        let w = det - u - v;
        let (n1, n2, ns) = (norm1::<S>(e1), norm1::<S>(e2), norm1::<S>(s));
        let n12 = n1 * n2;
        let reach = S::D4::splat(ray.reach);
        let det_error = reach * n12;
        let uv_error = reach * ns.mul_add_loose(n1 + n2, n12);
        let (low, high) = (u.min(v).min(w), u.max(v).max(w));
        let outside = low.lt(-uv_error) & uv_error.lt(high);
        let t_error = n12 * ns * S::D4::splat(BOUND);
        // As `Quotients::bounded`.
        let inv_det = S::D4::splat(1.0) / det;
        let t = dot::<S>(e2, q) * inv_det;
        let slack = t.abs().mul_add_loose(det_error, t_error) * inv_det.abs() * S::D4::splat(2.0);
        let slack = t.abs().mul_add_loose(S::D4::splat(4.0 * f64::EPSILON), slack);
        let (t_low, t_high) = (t - slack, t + slack);
        let solid = (det_error * S::D4::splat(4.0)).le(det.abs());
        let (t_near, t_far) = (S::D4::splat(ray.t_near), S::D4::splat(ray.t_far));
        let beyond = solid & (S::D4::splat(t_limit).lt(t_low) | t_high.lt(t_near));
        let mask = S::D4::splat(0.0).lt(det_error) & !(outside | beyond);
        let inside = uv_error.lt(low) | high.lt(-uv_error);
        let sure = solid & inside & t_near.le(t_low) & t_high.le(t_far);
        Evaluated { mask, sure, rows: [t_low, t_high, inv_det, u, v, det_error, uv_error] }
    }

    /// Offers every triangle of the block that may beat the best.
    #[inline(always)]
    pub(super) fn closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        block_ray: &BlockRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        count.block();
        let evaluated = self.evaluate::<S>(block_ray, best.t_high());
        if evaluated.mask == 0 {
            return;
        }
        let spilled = Spilled::new(&evaluated);
        let mut mask = evaluated.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            let prim = PrimId(self.prims[lane]);
            if evaluated.sure >> lane & 1 == 1 {
                best.keep(spilled.hit(self, lane), ray, prim, sink);
            } else {
                best.offer_exactly(ray, self.corners(lane), prim, sink);
            }
        }
    }

    /// True when a triangle of the block is hit and `sink` accepts it.
    #[inline(always)]
    pub(super) fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        ray: &TravRay,
        block_ray: &BlockRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        count.block();
        let evaluated = self.evaluate::<S>(block_ray, f64::from(ray.range().t_far));
        if evaluated.mask == 0 {
            return false;
        }
        let spilled = Spilled::new(&evaluated);
        let mut mask = evaluated.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            let prim = PrimId(self.prims[lane]);
            let blocked = if evaluated.sure >> lane & 1 == 1 {
                K::ACCEPTS_ALL || blocks(&spilled.hit(self, lane), ray, prim, sink)
            } else {
                self.blocks_exactly(ray, lane, sink)
            };
            if blocked {
                return true;
            }
        }
        false
    }

    #[cold]
    #[inline(never)]
    pub(super) fn blocks_exactly<K: HitSink>(&self, ray: &TravRay, lane: usize, sink: &K) -> bool {
        let hit = TriangleHit::exactly(ray.range(), self.corners(lane));
        hit.is_some_and(|hit| blocks(&hit, ray, PrimId(self.prims[lane]), sink))
    }
}

/// A ray in f64. Numbers are spread over lanes where they are used: that is a load, and most rays test few blocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockRay {
    origin: [f64; 3],
    dir: [f64; 3],
    /// `BOUND * |dir|∞`.
    reach: f64,
    t_near: f64,
    t_far: f64,
}

impl BlockRay {
    #[inline(always)]
    pub(super) fn new(ray: &TravRay) -> Self {
        let range = ray.range();
        Self {
            origin: range.origin.as_dvec3().to_array(),
            dir: range.dir.as_dvec3().to_array(),
            reach: BOUND * f64::from(range.dir.abs().max_element()),
            t_near: f64::from(range.t_near),
            t_far: f64::from(range.t_far),
        }
    }
}

/// Four triangles after the f64 test.
struct Evaluated<S: Simd> {
    /// Lanes that may hit.
    mask: u32,
    /// Lanes that surely hit, within the ray's range.
    sure: u32,
    /// Bounds on t, then the fields of [`Quotients`].
    rows: [S::D4; 7],
}

/// The rows in memory, for access by lane.
struct Spilled([[f64; 4]; 7]);

impl Spilled {
    #[inline(always)]
    fn new<S: Simd>(evaluated: &Evaluated<S>) -> Self {
        let mut rows = [[0.0; 4]; 7];
        for (row, lanes) in rows.iter_mut().zip(evaluated.rows) {
            lanes.store(row);
        }
        Self(rows)
    }

    #[inline(always)]
    fn hit(&self, block: &TriBlock, lane: usize) -> TriangleHit {
        let [t_low, t_high, inv_det, u, v, det_error, uv_error] = &self.0;
        let (t_low, t_high, inv_det) = (t_low[lane], t_high[lane], inv_det[lane]);
        let (u, v, det_error, uv_error) = (u[lane], v[lane], det_error[lane], uv_error[lane]);
        let quotients = Quotients { inv_det, u, v, det_error, uv_error };
        TriangleHit { corners: block.corners(lane), t_low, t_high, quotients }
    }
}

pub(super) type D3<S> = [<S as Simd>::D4; 3];

// No closures and no `map` here: they do not inherit the features of the function they stand in, and intrinsics become
// calls.

#[inline(always)]
fn widened3<S: Simd>(rows: &[[f32; 4]; 3]) -> D3<S> {
    [S::widen(S::F4::load(&rows[0])), S::widen(S::F4::load(&rows[1])), S::widen(S::F4::load(&rows[2]))]
}

#[inline(always)]
fn splat3<S: Simd>(v: &[f64; 3]) -> D3<S> {
    [S::D4::splat(v[0]), S::D4::splat(v[1]), S::D4::splat(v[2])]
}

#[inline(always)]
pub(super) fn sub<S: Simd>(a: D3<S>, b: D3<S>) -> D3<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn cross<S: Simd>(a: D3<S>, b: D3<S>) -> D3<S> {
    [
        a[1].mul_sub_loose(b[2], a[2] * b[1]),
        a[2].mul_sub_loose(b[0], a[0] * b[2]),
        a[0].mul_sub_loose(b[1], a[1] * b[0]),
    ]
}

#[inline(always)]
pub(super) fn dot<S: Simd>(a: D3<S>, b: D3<S>) -> S::D4 {
    a[0].mul_add_loose(b[0], a[1].mul_add_loose(b[1], a[2] * b[2]))
}

#[inline(always)]
pub(super) fn norm1<S: Simd>(a: D3<S>) -> S::D4 {
    a[0].abs() + a[1].abs() + a[2].abs()
}
