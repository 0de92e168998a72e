//! Where secondary rays start.

use glam::{DVec3, Vec3};

use super::exact::{side, slope};

/// Half units in the last place of a coordinate by which a start leaves the surface: as many as pbrt's bound for points
/// interpolated in f32, so that the steps between the rounded facets of a smooth or tilted surface are cleared too.
const HALF_ULPS: f64 = 8.0;

/// Least share that an axis has of the largest offset, so that a start near a coordinate plane is not decided by
/// denormal numbers.
const LEAST: f64 = 1.0 / 256.0;

/// Share of the largest coordinate of the corners that an offset has at least: a corner at the origin has no units in the
/// last place of its own.
const LEAST_OF_CORNERS: f64 = 1.0 / 1_073_741_824.0;

/// Distance from the edges, in offsets, to which starts are drawn: at walls that meet at more than some 10 degrees, no
/// rounding then takes a start through the other wall.
pub(crate) const INWARD: f32 = 16.0;

/// Where a ray starts that leaves the point with weights `u`, `v` of the second and third corner along `dir`.
///
/// The start lies strictly on the side of the triangle's plane that `dir` leads to, in exact arithmetic (on the side where
/// the corners run counterclockwise when `dir` is parallel to it): with `t` from 0 on, the ray does not meet the triangle
/// again. It lies a few units in the last place from the surface, by the error of the point, whatever the scale; near an
/// edge it is drawn inwards by some 16 times as much, so that it does not start behind a wall that meets the
/// triangle there at more than 10 degrees. Hits are decided on world-space vertices, so `corners` are those of
/// [`crate::world::World::corners`] and nothing depends on how an instance is scaled or sheared.
///
/// Edge cases: a triangle without area, or with a corner that is not finite, has no sides: the start is the point itself,
/// rounded. At the end of f32 the offset ends there too.
///
/// # Source
/// Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, section 6.8.6. Departures: the point and the offset
/// are computed in f64 and rounded once; the side is checked exactly and the offset doubled until it is right; the inward
/// shift.
pub fn leave(corners: &[Vec3; 3], u: f32, v: f32, dir: Vec3) -> Vec3 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (e1, e2) = (b - a, c - a);
    let cross = e1.cross(e2);
    let up = if slope(corners, dir) < 0 { -1 } else { 1 };
    let (u, v) = (f64::from(u).clamp(0.0, 1.0), f64::from(v).clamp(0.0, 1.0));
    let weights = [(1.0 - u - v).max(0.0), u, v];
    let error = error(&[a, b, c], weights);
    let [_, u, v] = inward(weights, &[e1, c - b, e2], cross, error);
    let point = a + e1 * u + e2 * v;

    let normal = (cross * f64::from(up)).normalize_or_zero();
    let mut offset = normal.abs().dot(error);
    while offset > 0.0 {
        let start = rounded_along(point + normal * offset, normal);
        if side(corners, start) == up {
            return start;
        }
        if !start.is_finite() {
            break;
        }
        offset *= 2.0;
    }
    along_an_axis(corners, point, up, error)
}

/// Offset along each axis at a point with these weights.
fn error(corners: &[DVec3; 3], weights: [f64; 3]) -> DVec3 {
    let size = (0..3).fold(DVec3::ZERO, |sum, i| sum + corners[i].abs() * weights[i]);
    let largest = corners.iter().fold(0.0, |most: f64, c| most.max(c.abs().max_element()));
    let error = size * (HALF_ULPS * f64::from(f32::EPSILON) / 2.0);
    error.max(DVec3::splat((error.max_element() * LEAST).max(largest * LEAST_OF_CORNERS)))
}

/// The weights, moved towards the middle of the triangle until the nearest edge is [`INWARD`] errors away, or they are
/// there. `edges` are ab, bc, ac.
fn inward(weights: [f64; 3], edges: &[DVec3; 3], cross: DVec3, error: DVec3) -> [f64; 3] {
    let area = cross.length();
    let [ab, bc, ac] = edges.map(|e| area / e.length());
    let wanted = f64::from(INWARD) * (error.x + error.y + error.z);
    let distance = (weights[0] * bc).min(weights[1] * ac).min(weights[2] * ab);
    // Of the middle.
    let most = ab.min(bc).min(ac) / 3.0;
    // False when NaN is about: nothing is known then.
    let is_near = distance < wanted;
    if !is_near {
        return weights;
    }
    let share = if wanted < most { (wanted - distance) / (most - distance) } else { 1.0 };
    weights.map(|w| w + (1.0 / 3.0 - w) * share)
}

/// Rounded to f32 so that no component falls short along `dir`.
#[expect(clippy::cast_possible_truncation, reason = "the rounding is what is asked for")]
fn rounded_along(point: DVec3, dir: DVec3) -> Vec3 {
    let one = |x: f64, along: f64| {
        let near = x as f32;
        if along > 0.0 && f64::from(near) < x {
            near.next_up()
        } else if along < 0.0 && f64::from(near) > x {
            near.next_down()
        } else {
            near
        }
    };
    Vec3::new(one(point.x, dir.x), one(point.y, dir.y), one(point.z, dir.z))
}

/// A start along the axis that leaves the plane most surely, for needles whose normal f64 does not know.
#[cold]
fn along_an_axis(corners: &[Vec3; 3], point: DVec3, up: i32, error: DVec3) -> Vec3 {
    let start = rounded_along(point, DVec3::ZERO);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let towards = slope(corners, axis.as_vec3()) * up;
        if towards == 0 {
            continue;
        }
        let axis = axis * f64::from(towards);
        let mut offset = error.max_element();
        loop {
            let start = rounded_along(point + axis * offset, axis);
            if !start.is_finite() || offset == 0.0 {
                break;
            }
            if side(corners, start) == up {
                return start;
            }
            offset *= 2.0;
        }
    }
    start
}

#[cfg(test)]
mod tests;
