//! Whether a triangle touches a box, a sphere or a capsule.
//!
//! All are closed: touching counts. Triangles without area are the segment or the point that they collapse to. What is not finite touches
//! nothing (infinite bounds of boxes are legal), nor does a negative radius.

use glam::Vec3;

use super::{
    boxes::boxes_meet,
    closest::{between_segments, to_segment, to_triangle},
    predicates::{Projection, Sign, side},
    triangles::triangles_meet,
};
use crate::geom::Aabb;

/// True when a closed triangle and a closed box share a point; exact.
///
/// Two convex solids are apart when they are so along one of a few axes: the box's, the triangle's normal, and the cross products of
/// their edges. Along those the signs of areas and volumes of corners decide, which are exact. Cost: some 50 ns. No allocation.
///
/// # Source
/// The axes are those of Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", 2001.
pub fn triangle_meets_box(corners: &[Vec3; 3], aabb: &Aabb) -> bool {
    let [a, b, c] = *corners;
    let around = Aabb { min: a.min(b).min(c), max: a.max(b).max(c) };
    let finite = corners.iter().all(|p| p.is_finite());
    if !finite || !boxes_meet(&around, aabb) {
        return false;
    }
    // Beyond the largest number there is no triangle.
    let whole = Vec3::splat(f32::MAX);
    let aabb = Aabb { min: aabb.min.max(-whole), max: aabb.max.min(whole) };
    let all = (0..8).map(|i| corner(&aabb, i));
    !one_side(all.map(|p| side(a, b, c, p))) && Projection::ALL.into_iter().all(|p| !parted_along(p, corners, &aabb))
}

/// A box's corner by number.
fn corner(aabb: &Aabb, i: usize) -> Vec3 {
    let pick = |axis: usize| if i >> axis & 1 == 0 { aabb.min[axis] } else { aabb.max[axis] };
    Vec3::new(pick(0), pick(1), pick(2))
}

/// All strictly on one side.
fn one_side(sides: impl Iterator<Item = Sign>) -> bool {
    let (mut above, mut below) = (true, true);
    for side in sides {
        above &= side > 0;
        below &= side < 0;
    }
    above || below
}

/// Whether, seen along an axis, an edge's line parts the box from the triangle.
fn parted_along(projection: Projection, &[a, b, c]: &[Vec3; 3], aabb: &Aabb) -> bool {
    let at = |x: f32, y: f32| {
        let mut p = Vec3::ZERO;
        p[projection.x] = x;
        p[projection.y] = y;
        p
    };
    let ([x0, x1], [y0, y1]) =
        ([aabb.min, aabb.max].map(|p| p[projection.x]), [aabb.min, aabb.max].map(|p| p[projection.y]));
    let square = [at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1)];
    [(a, b, c), (b, c, a), (c, a, b)].into_iter().any(|(p, q, r)| {
        let turns = square.map(|s| projection.turn(p, q, s));
        let own = projection.turn(p, q, r);
        one_side(turns.into_iter()) && own != turns[0]
    })
}

/// True when a closed triangle and a closed ball share a point, decided in f64: right unless the radius is nearer to the distance than
/// that is accurate ([`super::closest_on_triangle`]).
pub fn triangle_meets_sphere(corners: &[Vec3; 3], center: Vec3, radius: f32) -> bool {
    let finite = corners.iter().all(|p| p.is_finite()) && center.is_finite() && radius.is_finite();
    finite && to_triangle(center.as_dvec3(), &corners.map(Vec3::as_dvec3)).distance <= f64::from(radius)
}

/// True when a closed triangle and a closed capsule (all within `radius` of the segment from `from` to `to`) share a point.
///
/// Decided in f64, as [`triangle_meets_sphere`]; where the segment itself meets the triangle, exactly.
pub fn triangle_meets_capsule(corners: &[Vec3; 3], from: Vec3, to: Vec3, radius: f32) -> bool {
    let finite = corners.iter().chain([&from, &to]).all(|p| p.is_finite()) && radius.is_finite();
    if !finite || radius < 0.0 {
        return false;
    }
    if triangles_meet(corners, &[from, to, to]) {
        return true;
    }
    let (triangle, segment) = (corners.map(Vec3::as_dvec3), [from.as_dvec3(), to.as_dvec3()]);
    let [a, b, c] = triangle;
    let near = |distance: f64| distance <= f64::from(radius);
    near(to_triangle(segment[0], &triangle).distance)
        || near(to_triangle(segment[1], &triangle).distance)
        || [[a, b], [b, c], [c, a]].into_iter().any(|edge| near(between_segments(edge, segment).distance))
        || [a, b, c].into_iter().any(|p| near(to_segment(p, segment).distance))
}
