//! Triangle against triangle: whether they meet, and where.
//!
//! Triangles are closed point sets: touching in one point counts. A triangle without area is the segment or the point that it
//! collapses to. Every decision is exact.
//!
//! Every extreme point of what two triangles have in common is a corner of one that lies in the other, or a point where an edge of one
//! crosses the other, or its edge. Signs of volumes tell them all, and tell them apart: a corner, an edge through a face, or two
//! edges, never compared by coordinates. Triangles in one plane are looked at along an axis.
//!
//! # Source
//! The decision by signs of volumes alone follows Guigue and Devillers, "Fast and Robust Triangle-Triangle Overlap Test Using
//! Orientation Predicates", 2003; degenerate triangles and the points are added here.

mod crossing;
mod flat;
mod shape;

use arrayvec::ArrayVec;
use glam::{DVec3, Vec3};

use super::predicates::{Plane, Sign};
use shape::Shape;

/// What two triangles have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleContact {
    /// 0 for a point, 1 for a segment, 2 for an area.
    pub dim: u8,
    /// The extreme points: one, two, or three to six, in no particular order.
    ///
    /// Corners are exact; another point lies on an edge, along which it is off by at most 2^-32 of the edge's length (as a rule 2^-48), and
    /// by 2^-50 of its coordinates.
    pub points: ArrayVec<DVec3, 6>,
}

/// True when two closed triangles share a point; exact. Corners that are not finite share none.
///
/// Symmetric, and independent of the order of corners. Cost: tens of ns where a plane of theirs parts them, some 100 ns else, 1 to 2 µs
/// in one plane. No allocation.
pub fn triangles_meet(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let Some(stance) = Stance::new(a, b) else { return false };
    if !stance.of_a.contains(&0) && !stance.of_b.contains(&0) {
        return crossing::overlap_on_line(alone_first(a, stance.of_a), alone_first(b, stance.of_b));
    }
    let mut found = Found { first_only: true, places: ArrayVec::new() };
    stance.search(a, b, &mut found);
    !found.places.is_empty()
}

/// What two closed triangles share, `None` when that is nothing; decided exactly. Corners that are not finite share nothing.
///
/// Cost: as [`triangles_meet`], and up to six divisions. No allocation.
pub fn triangle_contact(a: &[Vec3; 3], b: &[Vec3; 3]) -> Option<TriangleContact> {
    let mut found = Found { first_only: false, places: ArrayVec::new() };
    Stance::new(a, b)?.search(a, b, &mut found);
    let dim = match found.places.len() {
        0 => return None,
        1 => 0,
        2 => 1,
        _ => 2,
    };
    Some(TriangleContact { dim, points: found.places.iter().map(|place| place.point(a, b)).collect() })
}

/// Which of two triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Of {
    A,
    B,
}

/// An extreme point by what it is made of, so that equal ones are recognised exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// A corner.
    Corner(Vec3),
    /// An edge of the one triangle (corner numbers, the lower first) through the other's inside.
    Face(Of, [u8; 2]),
    /// An edge of A across an edge of B, in one point that is a corner of neither.
    Edges([u8; 2], [u8; 2]),
}

impl Place {
    fn point(self, a: &[Vec3; 3], b: &[Vec3; 3]) -> DVec3 {
        let edge = |of: &[Vec3; 3], [i, j]: [u8; 2]| [of[usize::from(i)], of[usize::from(j)]];
        match self {
            Self::Corner(corner) => corner.as_dvec3(),
            Self::Face(Of::A, ends) => crossing::through(edge(a, ends), b),
            Self::Face(Of::B, ends) => crossing::through(edge(b, ends), a),
            Self::Edges(of_a, of_b) => crossing::across(edge(a, of_a), edge(b, of_b), a, b),
        }
    }
}

/// The places found so far.
struct Found {
    first_only: bool,
    places: ArrayVec<Place, 6>,
}

impl Found {
    fn add(&mut self, place: Place) {
        if !self.places.contains(&place) {
            self.places.push(place);
        }
    }

    fn is_enough(&self) -> bool {
        self.first_only && !self.places.is_empty()
    }
}

#[inline(always)]
fn sides(plane: &Plane, corners: &[Vec3; 3]) -> [Sign; 3] {
    [plane.side(corners[0]), plane.side(corners[1]), plane.side(corners[2])]
}

#[inline(always)]
fn parted(sides: [Sign; 3]) -> bool {
    sides == [1; 3] || sides == [-1; 3]
}

/// The corners, turned so that the first is alone on its side of the other's plane; no side is 0.
fn alone_first(corners: &[Vec3; 3], sides: [Sign; 3]) -> [Vec3; 3] {
    let [a, b, c] = *corners;
    match sides {
        [x, y, _] if x == y => [c, a, b],
        [x, _, z] if x == z => [b, c, a],
        _ => [a, b, c],
    }
}

/// Two triangles that no plane of theirs parts, and on which side of the other's plane their corners lie.
struct Stance {
    plane_a: Plane,
    plane_b: Plane,
    of_a: [Sign; 3],
    of_b: [Sign; 3],
}

impl Stance {
    #[inline(always)]
    fn new(a: &[Vec3; 3], b: &[Vec3; 3]) -> Option<Self> {
        if !a.iter().chain(b).all(|c| c.is_finite()) {
            return None;
        }
        let plane_b = Plane::new(*b);
        let of_a = sides(&plane_b, a);
        if parted(of_a) {
            return None;
        }
        let plane_a = Plane::new(*a);
        let of_b = sides(&plane_a, b);
        (!parted(of_b)).then_some(Self { plane_a, plane_b, of_a, of_b })
    }

    fn search(&self, a: &[Vec3; 3], b: &[Vec3; 3], found: &mut Found) {
        let (flat_a, flat_b) = (self.of_a == [0; 3], self.of_b == [0; 3]);
        if flat_a && flat_b {
            // In one plane, or neither has an area.
            flat::search(&Shape::new(*a), &Shape::new(*b), found);
            return;
        }
        // A triangle without area has every corner of the other in its "plane": it takes part by its own corners and edges only.
        if !flat_a {
            crossing::search(Of::A, &Shape::of(a, flat_b), self.of_a, b, &self.plane_b, found);
        }
        if !flat_b && !found.is_enough() {
            crossing::search(Of::B, &Shape::of(b, flat_a), self.of_b, a, &self.plane_a, found);
        }
    }
}
