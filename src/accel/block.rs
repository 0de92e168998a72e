//! Leaves: blocks of four triangles in structure-of-arrays form, tested against a ray at once.
//!
//! The test evaluates the volumes of [`crate::geom::exact`] in f64, four triangles to a vector. Lanes that surely miss are dropped by
//! one bound for all blocks of a ray; what is left gets bounds of its own: sure hits are kept with their f64 values, and only
//! what is in doubt still goes to integers. f64 costs no more instructions here than f32 would: four f64 fill an AVX register.
//! [`Forms::leaves`](crate::geom::Forms) may ask for f32 without bounds instead: `fast.rs`.

use glam::{Mat4, Vec3, Vec3A, Vec4};

use super::{Closest, Counter, HitSink, TravRay, query::blocks, sah::BLOCK};
use crate::{
    geom::{
        Aabb, Precision, PrimId, Triangles,
        exact::{BOUND, Quotients, TriangleHit},
    },
    simd::{Lanes, Simd, prefetch},
};

/// Marks a lane without a triangle.
pub(super) const NO_PRIM: u32 = u32::MAX;

/// Four triangles: `corners[corner][axis][lane]`.
///
/// Triangles with a corner that is not finite have all corners at one point: no area, no hit. It is a corner of another triangle of the
/// block, so that it widens no box; 0 where there is none. Lanes without a triangle repeat another of the block, so that they are
/// missed as cheaply as it is; who hits one must look at its number.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(super) struct TriBlock {
    corners: [[[f32; 4]; 3]; 3],
    prims: [u32; 4],
}

const _: () = assert!(size_of::<TriBlock>() == 160);

/// The order in which a refit comes upon the blocks of a tree.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sweep {
    Upward,
    Downward,
}

/// By how many blocks vertices are asked for before they are needed, corners twice and blocks four times as many.
const AHEAD: usize = 6;

/// What a refit of a block found.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockBounds {
    pub(super) aabb: Aabb,
    /// Sum of the half areas of the triangles' boxes.
    pub(super) own_area: f64,
}

impl TriBlock {
    /// No triangles.
    pub(super) const EMPTY: Self = Self { corners: [[[0.0; 4]; 3]; 3], prims: [NO_PRIM; 4] };

    /// A block of up to four triangles, from the first lane on, whose corners are still to be set by [`TriBlock::refit`].
    pub(super) fn new(prims: [u32; 4]) -> Self {
        Self { corners: [[[0.0; 4]; 3]; 3], prims }
    }

    /// Blocks that many triangles take.
    pub(super) fn count_for(triangles: usize) -> usize {
        triangles.div_ceil(BLOCK)
    }

    /// The blocks of these triangles, in order; the last may be short.
    pub(super) fn of(prims: &[u32]) -> impl Iterator<Item = Self> + '_ {
        prims.chunks(BLOCK).map(Self::of_up_to_four)
    }

    /// The block of up to four triangles.
    pub(super) fn of_up_to_four(prims: &[u32]) -> Self {
        let mut lanes = [NO_PRIM; BLOCK];
        lanes[..prims.len()].copy_from_slice(prims);
        Self::new(lanes)
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

    /// Corners by axis and lane.
    #[inline(always)]
    pub(super) fn corners_by_axis(&self) -> &[[[f32; 4]; 3]; 3] {
        &self.corners
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

    /// The corners as they are.
    #[inline(always)]
    pub(super) fn narrow<S: Simd>(&self) -> [[S::F4; 3]; 3] {
        let [a, b, c] = &self.corners;
        [
            [S::F4::load(&a[0]), S::F4::load(&a[1]), S::F4::load(&a[2])],
            [S::F4::load(&b[0]), S::F4::load(&b[1]), S::F4::load(&b[2])],
            [S::F4::load(&c[0]), S::F4::load(&c[1]), S::F4::load(&c[2])],
        ]
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

    /// Refits one of the blocks of a tree that is swept through them in this or the other direction: memory that the next ones need is asked
    /// for. Blocks, corners and vertices stand in three orders, so a sweep would wait for each.
    #[inline(always)]
    pub(super) fn refit_in_sweep(blocks: &mut [Self], at: usize, sweep: Sweep, prims: &Triangles<'_>) -> BlockBounds {
        let ahead = |count: usize| match sweep {
            Sweep::Upward => at + count,
            Sweep::Downward => at.wrapping_sub(count),
        };
        let last = prims.indices.len().wrapping_sub(1);
        if let Some(block) = blocks.get(ahead(AHEAD)) {
            for &prim in &block.prims {
                if let Some(corners) = prims.indices.get((prim as usize).min(last)) {
                    prefetch(prims.positions, corners[0] as usize);
                    prefetch(prims.positions, corners[1] as usize);
                    prefetch(prims.positions, corners[2] as usize);
                }
            }
        }
        if let Some(block) = blocks.get(ahead(2 * AHEAD)) {
            for &prim in &block.prims {
                prefetch(prims.indices, (prim as usize).min(last));
            }
        }
        if let Some(block) = blocks.get(ahead(4 * AHEAD)) {
            prefetch(&block.prims, 0);
        }
        blocks[at].refit(prims)
    }

    /// Takes the corners from `prims` and returns the box around them.
    #[inline(always)]
    pub(super) fn refit(&mut self, prims: &Triangles<'_>) -> BlockBounds {
        let first = self.prims[0];
        let mut vertices = [[0; 3]; 4];
        for (vertices, &prim) in vertices.iter_mut().zip(&self.prims) {
            // No branch: it would wait for the block's memory, and what follows with it.
            *vertices = prims.indices[[prim, first][usize::from(prim == NO_PRIM)] as usize];
        }
        let (rows, is_finite) = rows_of(&vertices, prims);
        if !is_finite {
            return self.refit_odd(prims);
        }
        let [a, b, c] = &rows;
        let (mut low, mut high) = ([Vec4::ZERO; 3], [Vec4::ZERO; 3]);
        for axis in 0..3 {
            low[axis] = a[axis].min(b[axis]).min(c[axis]);
            high[axis] = a[axis].max(b[axis]).max(c[axis]);
        }
        let e = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
        let areas = (e[0] * e[1] + e[1] * e[2] + e[2] * e[0]).to_array();
        let mut own_area = 0.0;
        for (area, &prim) in areas.into_iter().zip(&self.prims) {
            own_area += if prim == NO_PRIM { 0.0 } else { f64::from(area) };
        }
        self.set_corners(&rows);
        let least = Mat4::from_cols(low[0], low[1], low[2], low[2]).transpose();
        let most = Mat4::from_cols(high[0], high[1], high[2], high[2]).transpose();
        let min = least.x_axis.min(least.y_axis).min(least.z_axis.min(least.w_axis));
        let max = most.x_axis.max(most.y_axis).max(most.z_axis.max(most.w_axis));
        BlockBounds { aabb: Aabb { min: min.truncate(), max: max.truncate() }, own_area }
    }

    /// Becomes a block of these triangles, whose vertices are named as well; lanes without a triangle name those of another.
    #[inline(always)]
    pub(super) fn gather(&mut self, numbers: [u32; 4], vertices: &[[u32; 3]; 4], prims: &Triangles<'_>) {
        self.prims = numbers;
        let (rows, is_finite) = rows_of(vertices, prims);
        if is_finite {
            self.set_corners(&rows);
        } else {
            self.refit_odd(prims);
        }
    }

    #[inline(always)]
    fn set_corners(&mut self, rows: &[[Vec4; 3]; 3]) {
        for (corner, rows) in self.corners.iter_mut().zip(rows) {
            *corner = [rows[0].to_array(), rows[1].to_array(), rows[2].to_array()];
        }
    }

    /// As [`TriBlock::refit`], where a corner may not be finite.
    #[cold]
    #[inline(never)]
    fn refit_odd(&mut self, prims: &Triangles<'_>) -> BlockBounds {
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
            let first = (!left).trailing_zeros() as usize & 3;
            let point = rows[0][first];
            for lane in (0..4).filter(|lane| left >> lane & 1 == 1) {
                let absent = self.prims[lane] == NO_PRIM;
                for row in &mut rows {
                    row[lane] = if absent { row[first] } else { point };
                }
            }
        }
        for (corner, [a, b, c, d]) in self.corners.iter_mut().zip(rows) {
            let axes = Mat4::from_cols(a, b, c, d).transpose();
            *corner = [axes.x_axis.to_array(), axes.y_axis.to_array(), axes.z_axis.to_array()];
        }
        BlockBounds { aabb: Aabb { min: min.into(), max: max.into() }, own_area }
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
        if block_ray.fast {
            self.closest_fast::<S, K>(ray, best, sink);
            return;
        }
        let volumes = Volumes::<S::D4>::new(self.widened::<S>(), splat3(&block_ray.origin), splat3(&block_ray.dir));
        let open = volumes.open(S::D4::splat(block_ray.uv_error));
        if open == 0 {
            return;
        }
        let evaluated = Evaluated::new(&volumes, open, &block_ray.weights(best.t_high()));
        if evaluated.mask == 0 {
            return;
        }
        let spilled = Spilled::<4>::new(&evaluated);
        let mut mask = evaluated.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            let prim = PrimId(self.prims[lane]);
            if prim.0 == NO_PRIM {
                continue;
            }
            if evaluated.sure >> lane & 1 == 1 {
                best.keep(spilled.hit(lane, self, lane), ray, prim, sink);
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
        if block_ray.fast {
            return self.occluded_fast::<S, K>(ray, sink);
        }
        let volumes = Volumes::<S::D4>::new(self.widened::<S>(), splat3(&block_ray.origin), splat3(&block_ray.dir));
        let open = volumes.open(S::D4::splat(block_ray.uv_error));
        if open == 0 {
            return false;
        }
        let evaluated = Evaluated::new(&volumes, open, &block_ray.weights(block_ray.t_far));
        if evaluated.mask == 0 {
            return false;
        }
        let spilled = Spilled::<4>::new(&evaluated);
        let mut mask = evaluated.mask;
        while mask != 0 {
            let lane = (mask.trailing_zeros() & 3) as usize;
            mask &= mask - 1;
            let prim = PrimId(self.prims[lane]);
            if prim.0 == NO_PRIM {
                continue;
            }
            let blocked = if evaluated.sure >> lane & 1 == 1 {
                K::ACCEPTS_ALL || blocks(&spilled.hit(lane, self, lane), ray, prim, sink)
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
    scale: f64,
    /// Bound on the errors of U, V and W of every triangle within `reach` of 0.
    uv_error: f64,
    t_near: f64,
    t_far: f64,
    /// Triangles are tested as [`Forms::leaves`](crate::geom::Forms) names it.
    fast: bool,
}

impl BlockRay {
    /// For blocks whose coordinates are at most `reach` in size, which is finite.
    ///
    /// Edges are then at most 2 `reach` long on each axis and origins `reach + |origin|∞` away, so `n12 + ns (n1 + n2)` is at most
    /// `36 reach (2 reach + |origin|∞)`: too much by orders of magnitude for most triangles, and still below 2^-30 of the volumes that most
    /// rays have, which is all that matters for lanes that miss.
    #[inline(always)]
    pub(super) fn new(ray: &TravRay, reach: f32) -> Self {
        let range = ray.range();
        let scale = BOUND * f64::from(range.dir.abs().max_element());
        let (reach, far) = (f64::from(reach), f64::from(range.origin.abs().max_element()));
        Self {
            origin: range.origin.as_dvec3().to_array(),
            dir: range.dir.as_dvec3().to_array(),
            scale,
            uv_error: scale * (40.0 * reach) * (2.0 * reach + far),
            t_near: f64::from(range.t_near),
            t_far: f64::from(range.t_far),
            fast: ray.forms().leaves == Precision::Fast,
        }
    }

    #[inline(always)]
    fn weights<L: Lanes<Elem = f64>>(&self, t_limit: f64) -> Weights<L> {
        Weights {
            scale: L::splat(self.scale),
            t_near: L::splat(self.t_near),
            t_far: L::splat(self.t_far),
            t_limit: L::splat(t_limit),
        }
    }
}

/// Edges and volumes of four triangles, before any of it is compared with an error.
pub(super) struct Volumes<L> {
    pub(super) e1: [L; 3],
    pub(super) e2: [L; 3],
    pub(super) s: [L; 3],
    /// `s x e1`.
    pub(super) q: [L; 3],
    pub(super) det: L,
    pub(super) u: L,
    pub(super) v: L,
    /// The least and the greatest of U, V and W.
    pub(super) low: L,
    pub(super) high: L,
}

impl<L: Lanes> Volumes<L> {
    #[inline(always)]
    pub(super) fn new([v0, v1, v2]: [[L; 3]; 3], origin: [L; 3], dir: [L; 3]) -> Self {
        let (e1, e2, s) = (sub(v1, v0), sub(v2, v0), sub(origin, v0));
        let (p, q) = (cross(dir, e2), cross(s, e1));
        let (det, u, v) = (dot(e1, p), dot(s, p), dot(dir, q));
        let w = det - u - v;
        Self { e1, e2, s, q, det, u, v, low: u.min(v).min(w), high: u.max(v).max(w) }
    }

    /// Lanes that do not surely miss when the volumes are off by at most `error`.
    #[inline(always)]
    pub(super) fn open(&self, error: L) -> u32 {
        L::ALL & !(self.low.lt(-error) & error.lt(self.high))
    }
}

/// What a weighing needs to know of the rays, a lane each or the same in all.
pub(super) struct Weights<L> {
    /// `BOUND * |dir|∞`.
    pub(super) scale: L,
    pub(super) t_near: L,
    pub(super) t_far: L,
    /// At most `t_far`.
    pub(super) t_limit: L,
}

/// Triangles and rays after the f64 test, a pair to a lane.
pub(super) struct Evaluated<L> {
    /// Lanes that may hit.
    pub(super) mask: u32,
    /// Lanes that surely hit, within the ray's range.
    pub(super) sure: u32,
    /// Bounds on t, then the fields of [`Quotients`].
    pub(super) rows: [L; 7],
}

impl<L: Lanes<Elem = f64>> Evaluated<L> {
    /// Weighs the volumes of the lanes in `open` against their errors. Lanes of triangles that surely miss, or are surely hit outside of
    /// `[t_near, t_limit]`, are not in the mask.
    #[inline(always)]
    pub(super) fn new(volumes: &Volumes<L>, open: u32, ray: &Weights<L>) -> Self {
        let &Volumes { e1, e2, s, q, det, u, v, low, high } = volumes;
        let (n1, n2, ns) = (norm1(e1), norm1(e2), norm1(s));
        let n12 = n1 * n2;
        let det_error = ray.scale * n12;
        let uv_error = ray.scale * ns.mul_add_loose(n1 + n2, n12);
        let outside = low.lt(-uv_error) & uv_error.lt(high);
        let t_error = n12 * ns * L::splat(BOUND);
        // As `Quotients::bounded`.
        let inv_det = L::splat(1.0) / det;
        let t = dot(e2, q) * inv_det;
        let slack = t.abs().mul_add_loose(det_error, t_error) * inv_det.abs() * L::splat(2.0);
        let slack = t.abs().mul_add_loose(L::splat(4.0 * f64::EPSILON), slack);
        let (t_low, t_high) = (t - slack, t + slack);
        let solid = (det_error * L::splat(4.0)).le(det.abs());
        let beyond = solid & (ray.t_limit.lt(t_low) | t_high.lt(ray.t_near));
        let mask = open & L::splat(0.0).lt(det_error) & !(outside | beyond);
        let inside = uv_error.lt(low) | high.lt(-uv_error);
        let sure = solid & inside & ray.t_near.le(t_low) & t_high.le(ray.t_far);
        Self { mask, sure, rows: [t_low, t_high, inv_det, u, v, det_error, uv_error] }
    }
}

/// The rows in memory, for access by lane; N is at least the number of lanes.
pub(super) struct Spilled<const N: usize>([[f64; N]; 7]);

impl<const N: usize> Spilled<N> {
    #[inline(always)]
    pub(super) fn new<L: Lanes<Elem = f64>>(evaluated: &Evaluated<L>) -> Self {
        // Filled in place: rows of this size made elsewhere would be copied.
        let mut out = Self([[0.0; N]; 7]);
        let [a, b, c, d, e, f, g] = evaluated.rows;
        a.store(&mut out.0[0]);
        b.store(&mut out.0[1]);
        c.store(&mut out.0[2]);
        d.store(&mut out.0[3]);
        e.store(&mut out.0[4]);
        f.store(&mut out.0[5]);
        g.store(&mut out.0[6]);
        out
    }

    /// What `row` found of a triangle of `block`.
    #[inline(always)]
    pub(super) fn hit(&self, row: usize, block: &TriBlock, triangle: usize) -> TriangleHit {
        let [t_low, t_high, inv_det, u, v, det_error, uv_error] = &self.0;
        let (t_low, t_high, inv_det) = (t_low[row], t_high[row], inv_det[row]);
        let (u, v, det_error, uv_error) = (u[row], v[row], det_error[row], uv_error[row]);
        let quotients = Quotients { inv_det, u, v, det_error, uv_error };
        TriangleHit { corners: block.corners(triangle), t_low, t_high, quotients }
    }
}

/// A vertex, with any number in the fourth place: one load where that is another vertex's.
#[inline(always)]
fn extended(positions: &[Vec3], vertex: usize) -> Vec4 {
    let numbers: &[f32] = bytemuck::cast_slice(positions);
    match numbers.get(3 * vertex..3 * vertex + 4) {
        Some(four) => Vec4::from_slice(four),
        None => positions[vertex].extend(0.0),
    }
}

/// The corners of four triangles by axis, and whether they are finite; overflows of their sum aside.
#[inline(always)]
fn rows_of([a, b, c, d]: &[[u32; 3]; 4], prims: &Triangles<'_>) -> ([[Vec4; 3]; 3], bool) {
    let mut rows = [[Vec4::ZERO; 3]; 3];
    let mut sum = Vec4::ZERO;
    for (corner, rows) in rows.iter_mut().enumerate() {
        *rows = transposed([
            extended(prims.positions, a[corner] as usize),
            extended(prims.positions, b[corner] as usize),
            extended(prims.positions, c[corner] as usize),
            extended(prims.positions, d[corner] as usize),
        ]);
        sum += rows[0] + rows[1] + rows[2];
    }
    // A product with 0 is 0 unless the factor is infinite or NaN.
    (rows, sum * 0.0 == Vec4::ZERO)
}

/// The first three rows of a matrix whose columns these are.
#[inline(always)]
fn transposed([a, b, c, d]: [Vec4; 4]) -> [Vec4; 3] {
    let rows = Mat4::from_cols(a, b, c, d).transpose();
    [rows.x_axis, rows.y_axis, rows.z_axis]
}

pub(super) type D3<S> = [<S as Simd>::D4; 3];

// No closures and no `map` here: they do not inherit the features of the function they stand in, and intrinsics become
// calls.

#[inline(always)]
fn widened3<S: Simd>(rows: &[[f32; 4]; 3]) -> D3<S> {
    [S::widen(S::F4::load(&rows[0])), S::widen(S::F4::load(&rows[1])), S::widen(S::F4::load(&rows[2]))]
}

#[inline(always)]
pub(super) fn splat3<L: Lanes>(v: &[L::Elem; 3]) -> [L; 3] {
    [L::splat(v[0]), L::splat(v[1]), L::splat(v[2])]
}

#[inline(always)]
pub(super) fn sub<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn cross<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [
        a[1].mul_sub_loose(b[2], a[2] * b[1]),
        a[2].mul_sub_loose(b[0], a[0] * b[2]),
        a[0].mul_sub_loose(b[1], a[1] * b[0]),
    ]
}

#[inline(always)]
pub(super) fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul_add_loose(b[0], a[1].mul_add_loose(b[1], a[2] * b[2]))
}

#[inline(always)]
pub(super) fn norm1<L: Lanes>(a: [L; 3]) -> L {
    a[0].abs() + a[1].abs() + a[2].abs()
}
