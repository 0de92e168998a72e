//! Whether a triangle touches a box, a sphere or a capsule.
//!
//! All are closed: touching counts. Triangles without area are the segment or the point that they collapse to. What is not finite touches
//! nothing (infinite bounds of boxes are legal), nor does a negative radius.

use glam::Vec3;

use super::{
    boxes::boxes_meet,
    closest::{Nearest, between_segments, to_triangle},
    predicates::{Projection, Sign, side},
    triangles::triangles_meet,
};
use crate::geom::{
    Aabb,
    exact::{point_within, segments_within},
};

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

/// True when a closed triangle and a closed ball share a point; exact.
///
/// Cost: some 100 ns; where the distance is the radius but for roundings, some microseconds.
pub fn triangle_meets_sphere(corners: &[Vec3; 3], center: Vec3, radius: f32) -> bool {
    let finite = corners.iter().all(|p| p.is_finite()) && center.is_finite() && radius.is_finite();
    if !finite || radius < 0.0 {
        return false;
    }
    let nearest = to_triangle(center.as_dvec3(), &corners.map(Vec3::as_dvec3));
    surely_within(&nearest, &[center], corners, radius).unwrap_or_else(|| point_within(center, corners, radius))
}

/// True when a closed triangle and a closed capsule (all within `radius` of the segment from `from` to `to`) share a point; exact.
///
/// Cost: about a microsecond; where the distance is the radius but for roundings, some more.
pub fn triangle_meets_capsule(corners: &[Vec3; 3], from: Vec3, to: Vec3, radius: f32) -> bool {
    let finite = corners.iter().chain([&from, &to]).all(|p| p.is_finite()) && radius.is_finite();
    if !finite || radius < 0.0 {
        return false;
    }
    if triangles_meet(corners, &[from, to, to]) {
        return true;
    }
    let ([a, b, c], segment) = (corners.map(Vec3::as_dvec3), [from.as_dvec3(), to.as_dvec3()]);
    let mut nearest = to_triangle(segment[0], &[a, b, c]).or(to_triangle(segment[1], &[a, b, c]));
    for edge in [[a, b], [b, c], [c, a]] {
        nearest = nearest.or(between_segments(segment, edge));
    }
    surely_within(&nearest, &[from, to], corners, radius).unwrap_or_else(|| {
        let [a, b, c] = *corners;
        point_within(from, corners, radius)
            || point_within(to, corners, radius)
            || [[a, b], [b, c], [c, a]].into_iter().any(|edge| segments_within([from, to], edge, radius))
    })
}

/// Bound on what roundings move a point or a difference by, over the largest coordinate: 2^-46.
const ROUNDING: f64 = 1.421_085_471_520_200_4e-14;

/// Whether the hulls of `points` and `corners` are within `radius` of each other, as far as two points of theirs, found in f64, tell.
///
/// Those two are convex sums of the corners but for a few roundings, so the hulls are no farther apart than they are. And the way from one to the other parts the hulls by as
/// much as it parts the nearest of their corners.
fn surely_within(nearest: &Nearest, points: &[Vec3], corners: &[Vec3; 3], radius: f32) -> Option<bool> {
    let largest = points.iter().chain(corners).map(|p| p.abs().max_element()).fold(radius, f32::max);
    let (radius, error) = (f64::from(radius), f64::from(largest) * ROUNDING);
    if nearest.distance + error <= radius {
        return Some(true);
    }
    let way = nearest.points[1] - nearest.points[0];
    let along = |p: &Vec3| p.as_dvec3().dot(way);
    let parted = corners.iter().map(along).fold(f64::INFINITY, f64::min)
        - points.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
    // By more than the radius times the way's length, and the roundings of six products.
    let length = way.length();
    (parted > (radius + error) * length).then_some(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles in the plane `2x + 3y + 6z = 0`, and points straight above points of them: 7 away for each (2, 3, 6).
    #[test]
    fn balls_and_capsules_that_just_touch_a_tilted_triangle_do() {
        let (along, across, up) = (Vec3::new(3.0, -2.0, 0.0), Vec3::new(0.0, 2.0, -1.0), Vec3::new(2.0, 3.0, 6.0));
        let mut cases = 0;
        for size in [7.0_f32, 11.0, 13.0, 19.0, 23.0] {
            let corners = [Vec3::ZERO, along * size, across * size].map(|c| c + Vec3::new(4097.0, -8193.0, 2049.0));
            for (i, j) in (1..7_u8).flat_map(|i| (1..7 - i).map(move |j| (f32::from(i), f32::from(j)))) {
                for k in [1.0_f32, 3.0, 5.0, 9.0, 27.0] {
                    let center = corners[0] + along * i + across * j + up * k;
                    let (far, radius) = (center + up + along, 7.0 * k);
                    assert!(triangle_meets_sphere(&corners, center, radius), "{size} {i} {j} {k}");
                    assert!(!triangle_meets_sphere(&corners, center, radius.next_down()), "{size} {i} {j} {k}");
                    assert!(triangle_meets_capsule(&corners, center, far, radius), "{size} {i} {j} {k}");
                    assert!(!triangle_meets_capsule(&corners, center, far, radius.next_down()), "{size} {i} {j} {k}");
                    cases += 1;
                }
            }
        }
        assert_eq!(cases, 375);
    }

    /// Distances that are whole numbers in truth and roundings away from them in f64.
    #[test]
    fn balls_on_a_grid_touch_as_integers_say_where_f64_errs() {
        let mut state = 7_u64;
        let mut below = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % n
        };
        let mut errors = 0;
        for _ in 0..20_000 {
            let mut point = || Vec3::from([0; 3].map(|_| f32::from(u8::try_from(below(5)).expect("below 5"))));
            let (corners, center) = ([point(), point(), point()], point());
            let radius = f32::from(u8::try_from(below(4)).expect("below 4"));
            let due = point_within(center, &corners, radius);
            assert_eq!(triangle_meets_sphere(&corners, center, radius), due, "{corners:?} {center} {radius}");
            let nearest = to_triangle(center.as_dvec3(), &corners.map(Vec3::as_dvec3));
            errors += u32::from((nearest.distance <= f64::from(radius)) != due);
        }
        assert!(errors > 0, "the cases are none that f64 errs in");
    }
}
