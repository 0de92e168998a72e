//! Triangles, segments and points in one plane; segments and points anywhere.

use glam::Vec3;

use super::{Found, Place, shape::Shape};
use crate::collide::predicates::{Projection, side};

/// Finds every extreme point of what two shapes share. They lie in one plane, or neither has an area.
pub(super) fn search(a: &Shape, b: &Shape, found: &mut Found) {
    if is_skew(a, b) {
        return;
    }
    let Some(projection) = a.projection().or_else(|| b.projection()).or_else(|| faithful(a, b)) else { return };
    for (one, other) in [(a, b), (b, a)] {
        for &(_, corner) in &one.corners {
            if holds(projection, other, corner) {
                found.add(Place::Corner(corner));
            }
        }
    }
    for &of_a in a.edges() {
        for &of_b in b.edges() {
            if !found.is_enough() && cross(projection, a, of_a, b, of_b) {
                found.add(Place::Edges(a.names(of_a), b.names(of_b)));
            }
        }
    }
}

/// Two segments that lie in no plane.
fn is_skew(a: &Shape, b: &Shape) -> bool {
    let ([(_, p), (_, q)], [(_, r), (_, s)]) = (&a.corners[..], &b.corners[..]) else { return false };
    side(*p, *q, *r, *s) != 0
}

/// A projection that maps no two points of the shapes' common plane or line to one.
fn faithful(a: &Shape, b: &Shape) -> Option<Projection> {
    let points: arrayvec::ArrayVec<Vec3, 6> = a.corners.iter().chain(&b.corners).map(|c| c.1).collect();
    for (i, &p) in points.iter().enumerate() {
        for (j, &q) in points.iter().enumerate().skip(i + 1) {
            for &r in &points[j + 1..] {
                let [x, y, z] = [p, q, r].map(Vec3::as_dvec3);
                if let Some(found) = Projection::spreading(p, q, r, (y - x).cross(z - x)) {
                    return Some(found);
                }
            }
        }
    }
    // On one line: keep an axis along which it runs.
    let first = *points.first()?;
    let spread = |axis: usize| points.iter().any(|p| p.cmpne(first).test(axis));
    Some(Projection::ALL.into_iter().find(|p| spread(p.x)).unwrap_or(Projection::ALL[0]))
}

/// Whether a shape holds a point of the common plane.
fn holds(projection: Projection, shape: &Shape, point: Vec3) -> bool {
    match shape.corners[..] {
        [(_, a), (_, b), (_, c)] => {
            let turns = [projection.turn(a, b, point), projection.turn(b, c, point), projection.turn(c, a, point)];
            !(turns.contains(&1) && turns.contains(&-1))
        }
        [(_, a), (_, b)] => {
            let between = |axis: usize| a[axis].min(b[axis]) <= point[axis] && point[axis] <= a[axis].max(b[axis]);
            between(0) && between(1) && between(2) && projection.turn(a, b, point) == 0
        }
        [(_, a)] => a == point,
        _ => false,
    }
}

/// Whether two edges cross in a point that is an end of neither.
fn cross(projection: Projection, a: &Shape, of_a: [usize; 2], b: &Shape, of_b: [usize; 2]) -> bool {
    let [p, q] = of_a.map(|i| a.place(i));
    let [r, s] = of_b.map(|i| b.place(i));
    projection.turn(p, q, r) * projection.turn(p, q, s) < 0 && projection.turn(r, s, p) * projection.turn(r, s, q) < 0
}
