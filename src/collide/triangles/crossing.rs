//! Triangles that do not lie in one plane.

use glam::{DVec3, Vec3};

use super::{Found, Of, Place, shape::Shape};
use crate::collide::predicates::{Plane, Projection, Sign, side};

/// Finds where corners and edges of `shape` meet `face`, a triangle with area; `sides` are those of the shape's triangle's corners.
pub(super) fn search(of: Of, shape: &Shape, sides: [Sign; 3], face: &[Vec3; 3], plane: &Plane, found: &mut Found) {
    let side_of = |at: usize| sides[usize::from(shape.corners[at].0)];
    for (at, &(_, corner)) in shape.corners.iter().enumerate() {
        if side_of(at) == 0 && holds(face, plane, corner) {
            found.add(Place::Corner(corner));
        }
    }
    for &edge in shape.edges() {
        if found.is_enough() {
            return;
        }
        if side_of(edge[0]) * side_of(edge[1]) < 0 {
            let ends = [shape.place(edge[0]), shape.place(edge[1])];
            if let Some(place) = pierce(of, shape.names(edge), ends, face) {
                found.add(place);
            }
        }
    }
}

/// Whether two triangles meet that reach through each other's plane; the first corner of each is alone on its side.
///
/// Both cut the planes' common line: A from where its edge to the second corner crosses the plane of B to where that to the third
/// does, B likewise. The volume of an edge of A and one of B is 0 where they cross the line in one point, and else its sign is that
/// of the order of both on the line, up to a sign that depends on the first corners' sides alone. So the two stretches are
/// disjoint when all four volumes have one sign.
pub(super) fn overlap_on_line([a, a1, a2]: [Vec3; 3], [b, b1, b2]: [Vec3; 3]) -> bool {
    let first = side(a, a1, b, b1);
    first == 0 || side(a, a1, b, b2) != first || side(a, a2, b, b1) != first || side(a, a2, b, b2) != first
}

/// Whether a face holds a point of its plane.
fn holds(face: &[Vec3; 3], plane: &Plane, point: Vec3) -> bool {
    let [a, b, c] = *face;
    Projection::spreading(a, b, c, plane.normal()).is_some_and(|p| {
        let turns = [p.turn(a, b, point), p.turn(b, c, point), p.turn(c, a, point)];
        !(turns.contains(&1) && turns.contains(&-1))
    })
}

/// Where an edge whose ends lie strictly on opposite sides of a face's plane meets the face.
fn pierce(of: Of, names: [u8; 2], [p, q]: [Vec3; 2], face: &[Vec3; 3]) -> Option<Place> {
    const EDGES: [[u8; 2]; 3] = [[0, 1], [1, 2], [0, 2]];
    let [a, b, c] = *face;
    let first = side(p, q, a, b);
    let second = side(p, q, b, c);
    if first * second < 0 {
        return None;
    }
    let turns = [first, second, side(p, q, c, a)];
    if turns.contains(&1) && turns.contains(&-1) {
        return None;
    }
    let on: (usize, usize) = match turns.map(|t| t == 0) {
        [false, false, false] => return Some(Place::Face(of, names)),
        [true, true, _] => return Some(Place::Corner(b)),
        [_, true, true] => return Some(Place::Corner(c)),
        [true, _, true] => return Some(Place::Corner(a)),
        [true, ..] => (0, 0),
        [_, true, _] => (1, 1),
        [.., true] => (2, 2),
    };
    let of_face = EDGES[on.0];
    Some(match of {
        Of::A => Place::Edges(names, of_face),
        Of::B => Place::Edges(of_face, names),
    })
}

/// Where an edge crosses the plane of a face.
pub(super) fn through([p, q]: [Vec3; 2], face: &[Vec3; 3]) -> DVec3 {
    along(p, q, Plane::new(*face).crossing(p, q))
}

/// Where two edges, of A and of B, cross.
pub(super) fn across(of_a: [Vec3; 2], of_b: [Vec3; 2], a: &[Vec3; 3], b: &[Vec3; 3]) -> DVec3 {
    let [p, q] = of_a;
    let plane = Plane::new(*b);
    if plane.side(p) * plane.side(q) < 0 {
        return through(of_a, b);
    }
    let plane = Plane::new(*a);
    if plane.side(of_b[0]) * plane.side(of_b[1]) < 0 {
        return through(of_b, a);
    }
    // In one plane: there is a projection that keeps the edges apart.
    let crossing = Projection::ALL
        .into_iter()
        .find(|x| x.turn(of_b[0], of_b[1], p) * x.turn(of_b[0], of_b[1], q) < 0)
        .map_or(0.0, |x| x.crossing(of_b[0], of_b[1], p, q));
    along(p, q, crossing)
}

fn along(p: Vec3, q: Vec3, t: f64) -> DVec3 {
    let (p, q) = (p.as_dvec3(), q.as_dvec3());
    // From the nearer end, so that an end is met exactly.
    if t <= 0.5 { p + (q - p) * t } else { q + (p - q) * (1.0 - t) }
}
