//! Objects as the builders of grids and kd-trees see them: boxes, and the part of an object inside a box.

use arrayvec::ArrayVec;
use glam::{DVec3, Vec3};

use crate::geom::{Aabb, PrimId, Triangles};

/// Numbered objects with boxes.
pub(super) trait Shapes: Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// The least box around an object; empty for one that is never hit. Finite otherwise.
    fn aabb(&self, id: u32) -> Aabb;
    /// A box around the part of the object inside `to`, itself inside `to` and inside `own`, the object's own box. May be empty.
    fn clipped(&self, _id: u32, own: Aabb, to: Aabb) -> Aabb {
        intersection(own, to)
    }
    /// True only when the object surely has no point within `half` of `center`, an axis-aligned box.
    fn surely_misses(&self, _id: u32, _center: DVec3, _half: DVec3) -> bool {
        false
    }
}

/// Plain boxes. Those with a component that is not finite are never met.
impl Shapes for [Aabb] {
    fn count(&self) -> usize {
        self.len()
    }

    fn aabb(&self, id: u32) -> Aabb {
        let aabb = self[id as usize];
        if aabb.min.is_finite() && aabb.max.is_finite() && !aabb.is_empty() { aabb } else { Aabb::EMPTY }
    }
}

impl Shapes for Triangles<'_> {
    fn count(&self) -> usize {
        self.len()
    }

    fn aabb(&self, id: u32) -> Aabb {
        self.finite_aabb(PrimId(id))
    }

    fn clipped(&self, id: u32, own: Aabb, to: Aabb) -> Aabb {
        clip_triangle(self.corners(PrimId(id)), own, to)
    }

    fn surely_misses(&self, id: u32, center: DVec3, half: DVec3) -> bool {
        plane_misses(self.corners(PrimId(id)), center, half)
    }
}

/// The points common to both; empty when there are none.
pub(super) fn intersection(a: Aabb, b: Aabb) -> Aabb {
    let both = Aabb { min: a.min.max(b.min), max: a.max.min(b.max) };
    if both.is_empty() { Aabb::EMPTY } else { both }
}

/// Corners of a triangle cut by six planes.
type Polygon = ArrayVec<DVec3, 12>;

/// A box around the part of a triangle inside `to`.
///
/// # Accuracy
/// Cuts are made in f64 against planes moved outward by 2^-44 of the largest coordinate, which exceeds the sum of the roundings of six
/// cuts (below 2^-48 of it), and the result grows by as much before it is rounded outward: no point of the exact intersection is lost.
///
/// # Source
/// Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974; Havran and Bittner, "On Improving KD-Trees for Ray Shooting", 2002
/// (perfect splits).
fn clip_triangle(corners: [Vec3; 3], own: Aabb, to: Aabb) -> Aabb {
    let both = intersection(own, to);
    if both.is_empty() || to.contains(own) {
        return both;
    }
    let pad = f64::from(own.min.abs().max(own.max.abs()).max_element()) * f64::from_bits((1023 - 44) << 52);
    let mut polygon: Polygon = corners.into_iter().map(Vec3::as_dvec3).collect();
    for axis in 0..3 {
        if own.min[axis] < to.min[axis] {
            polygon = cut(&polygon, axis, f64::from(to.min[axis]) - pad, 1.0);
        }
        if own.max[axis] > to.max[axis] {
            polygon = cut(&polygon, axis, f64::from(to.max[axis]) + pad, -1.0);
        }
    }
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = polygon.iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)));
    if polygon.is_empty() {
        return Aabb::EMPTY;
    }
    let outer = Aabb {
        min: Vec3::from_array((min - pad).to_array().map(round_down)),
        max: Vec3::from_array((max + pad).to_array().map(|x| -round_down(-x))),
    };
    intersection(outer, both)
}

/// The part of a convex polygon where `side * (p[axis] - plane) >= 0`.
fn cut(polygon: &Polygon, axis: usize, plane: f64, side: f64) -> Polygon {
    let mut out = Polygon::new();
    let Some(&last) = polygon.last() else { return out };
    let mut a = last;
    for &b in polygon {
        let (da, db) = (side * (a[axis] - plane), side * (b[axis] - plane));
        if (da < 0.0) != (db < 0.0) {
            let mut p = a + (b - a) * (da / (da - db));
            p[axis] = plane;
            out.push(p);
        }
        if db >= 0.0 {
            out.push(b);
        }
        a = b;
    }
    out
}

/// The greatest f32 that is not above `x`; the least finite one where there is none.
#[expect(clippy::cast_possible_truncation, reason = "the rounding is what is asked for")]
pub(super) fn round_down(x: f64) -> f32 {
    let near = x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// Relative slack of [`plane_misses`], far above the roundings of its few operations.
const SLACK: f64 = 1e-12;

/// True only when the triangle's plane surely passes by the box.
fn plane_misses(corners: [Vec3; 3], center: DVec3, half: DVec3) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (e1, e2, s) = (b - a, c - a, center - a);
    let normal = e1.cross(e2);
    let reach = normal.abs().dot(half);
    let (size1, size2) = (e1.abs().element_sum(), e2.abs().element_sum());
    let error = SLACK * size1 * size2 * (s.abs().element_sum() + half.element_sum());
    normal.dot(s).abs() > reach + error
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Vec3> {
        (-4_i32..=4, -4_i32..=4, -4_i32..=4).prop_map(|(x, y, z)| Vec3::new(x as f32, y as f32, z as f32) * 0.37)
    }

    proptest! {
        #[test]
        fn no_point_of_a_clipped_triangle_is_lost(
            corners in [point(), point(), point()],
            (p, q) in (point(), point()),
            weights in prop::collection::vec((0.0..1.0_f64, 0.0..1.0_f64), 64),
        ) {
            let to = Aabb::from_points([p, q]);
            let own = Aabb::from_points(corners);
            let clipped = clip_triangle(corners, own, to);
            prop_assert!(own.contains(clipped) && to.contains(clipped));
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            for (u, v) in weights {
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let x = a + (b - a) * u + (c - a) * v;
                let inside = |b: Aabb, x: DVec3, slack: f64| {
                    (x + slack).cmpge(b.min.as_dvec3()).all() && (x - slack).cmple(b.max.as_dvec3()).all()
                };
                if inside(to, x, -1e-9) {
                    prop_assert!(inside(clipped, x, 1e-9), "{x} of {corners:?} in {to:?}, clipped {clipped:?}");
                    let (center, half) = ((to.min + to.max).as_dvec3() / 2.0, (to.max - to.min).as_dvec3() / 2.0);
                    prop_assert!(!plane_misses(corners, center, half));
                }
            }
        }
    }
}
