//! Where secondary rays of a block start: [`leave`] for all lanes at once.

use glam::Vec3;

use super::{
    patch::Patch,
    wide::{Bits, Floats, Row, V3, put3, row},
};
use crate::geom::{INWARD, leave};

/// Least share that an axis has of the largest error: on a coordinate plane the error is 0, and a ray that starts a
/// denormal number above the plane could be decided by integers only.
const LEAST_ERROR: f32 = 1.0 / 256.0;

/// Twice the bound of the relative rounding error of `a w + b u + c v`, three roundings in each term, and one more.
const POINT_ERROR: f32 = 7.0 * 0.5 * f32::EPSILON / (1.0 - 7.0 * 0.5 * f32::EPSILON);

/// Twice the bound of the error of `w = 1 - u - v`, two roundings of numbers up to 1, and a quarter more.
const WEIGHT_ERROR: f32 = 2.5 * 0.5 * f32::EPSILON;

/// Least squared sine of the angle between two edges of a triangle whose normal f32 knows well enough.
const LEAST_SIN2: f32 = 1.0 / 4096.0;

/// Least squared cross product of two edges that lost nothing to underflow.
const LEAST_CROSS2: f32 = 1e-30;

/// Where rays leave points of triangles, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Departure<'p, F> {
    patch: &'p Patch<F>,
    /// The point, drawn inwards near edges.
    start: V3<F>,
    /// More than twice the bound of the distance of `start` from the triangle's plane along each axis.
    error: V3<F>,
    /// Lanes whose starts need more than f32.
    thin: u32,
}

impl<'p, F: Floats> Departure<'p, F> {
    /// Of `point` on `patch`, in the lanes of `mask`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new(patch: &'p Patch<F>, point: V3<F>, mask: u32) -> Self {
        let [w, u, v] = patch.weights;
        let [a, b, c] = patch.corners;
        let size = (a * w).abs() + (b * u).abs() + (c * v).abs();
        let error = size * F::splat(POINT_ERROR) + a.abs() * F::splat(WEIGHT_ERROR);
        let error = error.max(V3::all(error.max_element() * F::splat(LEAST_ERROR)));

        let (e1, e2) = (b - a, c - a);
        let [ab2, bc2, ac2] = [e1.length_squared(), (c - b).length_squared(), e2.length_squared()];
        let cross2 = patch.cross.length_squared();
        let known = (ab2 * ac2 * F::splat(LEAST_SIN2)).le(cross2)
            & F::splat(LEAST_CROSS2).le(cross2)
            & cross2.lt(F::splat(f32::INFINITY));

        let wanted = (error.x + error.y + error.z) * F::splat(INWARD);
        let wanted2 = wanted * wanted;
        let near = (w * w * cross2).lt(wanted2 * bc2)
            | (u * u * cross2).lt(wanted2 * ac2)
            | (v * v * cross2).lt(wanted2 * ab2);
        let near = near & known & mask;
        let start =
            if near == 0 { point } else { V3::select(near, inward(patch, wanted, [ab2, bc2, ac2], cross2), point) };
        Self { patch, start, error, thin: mask & !known }
    }

    /// Where rays that leave along `dir` start: past the error of the point, on the side that they leave to, as [`leave`]
    /// says, in f32 where that is proven to do. `n_geom` is the unit normal of either side.
    ///
    /// The proof: the start as computed is off the plane by at most half of `error` along each axis. With unit normals n,
    /// exact, and m, computed, `|m - n| < 2.3e-5` (edges, products and their difference are off by 5.7 * 2^-24 of the
    /// product of the edges' lengths, which is at most 64 times that of the cross product). The offset is `d = |m| . error`
    /// along m. So the start comes to lie above the plane by at least `(1 - 2.3e-5) d - |n| . error / 2`, and
    /// that is positive, since no axis' error is below 1/256 of the largest. The rounding of the sum is paid by [`past`].
    ///
    /// # Source
    /// Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, section 6.8.6.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn origin(&self, n_geom: V3<F>, dir: V3<F>) -> V3<F> {
        let away = V3::select(dir.dot(n_geom).lt(F::splat(0.0)), -n_geom, n_geom);
        let offset = away * away.abs().dot(self.error);
        let start = self.start + offset;
        let start = V3 { x: past(start.x, away.x), y: past(start.y, away.y), z: past(start.z, away.z) };
        if self.thin == 0 { start } else { self.left_exactly(start, dir) }
    }

    /// `start`, with [`leave`] asked for the lanes that need it.
    #[cold]
    fn left_exactly(&self, start: V3<F>, dir: V3<F>) -> V3<F> {
        let at = |[x, y, z]: [Row; 3], lane: usize| Vec3::new(x[lane], y[lane], z[lane]);
        let corners = self.patch.corners.map(V3::rows);
        let [_, u, v] = self.patch.weights.map(row);
        let (dirs, mut starts) = (dir.rows(), start.rows());
        for lane in Bits(self.thin) {
            let corners = corners.map(|rows| at(rows, lane));
            put3(&mut starts, lane, leave(&corners, u[lane], v[lane], at(dirs, lane)));
        }
        V3::load(&starts)
    }
}

/// The points drawn towards the middle of their triangles until the nearest edge is `wanted` away, or they are there.
/// `squares` are those of the edges ab, bc, ac.
#[cfg_attr(not(debug_assertions), inline(always))]
fn inward<F: Floats>(patch: &Patch<F>, wanted: F, squares: [F; 3], cross2: F) -> V3<F> {
    let (one, third) = (F::splat(1.0), F::splat(1.0 / 3.0));
    let [w, u, v] = patch.weights;
    let area = cross2.sqrt();
    let [ab2, bc2, ac2] = squares;
    let (ab, bc, ac) = (area / ab2.sqrt(), area / bc2.sqrt(), area / ac2.sqrt());
    let distance = (w * bc).min(u * ac).min(v * ab);
    let most = ab.min(bc).min(ac) * third;
    let share = F::select(wanted.lt(most), (wanted - distance) / (most - distance), one).max(F::splat(0.0)).min(one);
    let (u, v) = (u + (third - u) * share, v + (third - v) * share);
    let [a, b, c] = patch.corners;
    a * (one - u - v) + b * u + c * v
}

/// The next float in the direction of `away`: a point with error zero, as on a coordinate plane, must leave it too.
#[inline(always)]
fn past<F: Floats>(x: F, away: F) -> F {
    let (mut x, away) = (row(x), row(away));
    for i in 0..F::LEN {
        x[i] = past_one(x[i], away[i]);
    }
    F::load(&x)
}

#[inline(always)]
fn past_one(x: f32, away: f32) -> f32 {
    if away > 0.0 {
        x.next_up()
    } else if away < 0.0 {
        x.next_down()
    } else {
        x
    }
}

#[cfg(test)]
mod tests;
