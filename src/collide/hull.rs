//! Convex hulls of a few points, exact.

#![expect(clippy::cast_possible_truncation, reason = "the number of points is checked")]

use glam::{DAffine3, DVec3, Vec3};

use super::{
    CollideError,
    predicates::{Projection, side},
    triangles_meet,
};
use crate::geom::Aabb;

/// The convex hull of points: a solid, or a polygon, segment or point where they lie in a plane, on a line or in one place.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexHull {
    /// Its boundary, wound counter-clockwise seen from outside; of a polygon a fan, of less a triangle without area.
    faces: Vec<[Vec3; 3]>,
    is_solid: bool,
    bounds: Aabb,
}

/// Most points.
const MAX_POINTS: usize = 4096;

impl ConvexHull {
    /// The hull of at least one point.
    ///
    /// Decided by exact predicates. O(n * faces); at most 4096 points.
    ///
    /// # Errors
    /// Without points, with too many, or when one is not finite.
    pub fn new(points: &[Vec3]) -> Result<Self, CollideError> {
        let (what, actual) = ("points of a hull", points.len());
        if actual == 0 {
            return Err(CollideError::Count { what, actual, expected: 1 });
        }
        if actual > MAX_POINTS {
            return Err(CollideError::TooMany { what, actual, limit: MAX_POINTS });
        }
        if !points.iter().all(|p| p.is_finite()) {
            return Err(CollideError::NotFinite { what });
        }
        let (faces, is_solid) = match Simplex::new(points) {
            Simplex::Point(a) => (vec![[a; 3]], false),
            Simplex::Line => (vec![line(points)], false),
            Simplex::Plane(a, b, c) => (polygon(points, [a, b, c]), false),
            Simplex::Space(corners) => (solid(points, corners), true),
        };
        Ok(Self { faces, is_solid, bounds: Aabb::from_points(points.iter().copied()) })
    }

    /// The hull of a box's eight corners where `world_from_box` takes them, each rounded to f32 once.
    ///
    /// # Errors
    /// When the box is empty, or a corner is beyond f32 or not finite.
    pub fn of_box(aabb: &Aabb, world_from_box: &DAffine3) -> Result<Self, CollideError> {
        if aabb.is_empty() {
            return Err(CollideError::EmptyBox { what: "box" });
        }
        let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { aabb.min[axis] } else { aabb.max[axis] };
        let corner = |i: usize| Vec3::new(pick(i, 0), pick(i, 1), pick(i, 2)).as_dvec3();
        let corners: Vec<Vec3> = (0..8).map(|i| world_from_box.transform_point3(corner(i)).as_vec3()).collect();
        Self::new(&corners)
    }

    /// The triangles of its boundary.
    pub fn faces(&self) -> &[[Vec3; 3]] {
        &self.faces
    }

    /// The least box around it.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Whether it holds a point; its boundary counts. Exact.
    pub fn contains(&self, point: Vec3) -> bool {
        if !self.is_solid {
            return self.faces.iter().any(|face| triangles_meet(face, &[point; 3]));
        }
        point.is_finite() && self.faces.iter().all(|&[a, b, c]| side(a, b, c, point) >= 0)
    }

    /// Whether it shares a point with a closed triangle. Exact.
    ///
    /// Cost: tens of ns a face.
    pub fn meets_triangle(&self, corners: &[Vec3; 3]) -> bool {
        self.faces.iter().any(|face| triangles_meet(face, corners)) || self.contains(corners[0])
    }

    /// The mean of its faces' corners.
    pub fn center(&self) -> DVec3 {
        let sum: DVec3 = self.faces.iter().flatten().map(|p| p.as_dvec3()).sum();
        sum / (3 * self.faces.len()) as f64
    }
}

/// Points that span as much as all do.
enum Simplex {
    Point(Vec3),
    Line,
    Plane(Vec3, Vec3, Vec3),
    /// The fourth lies inside of the first three's plane: [`side`] is positive.
    Space([usize; 4]),
}

impl Simplex {
    fn new(points: &[Vec3]) -> Self {
        let a = points[0];
        let Some(j) = points.iter().position(|&p| p != a) else { return Self::Point(a) };
        let b = points[j];
        let spread = |&c: &Vec3| Projection::ALL.iter().any(|x| x.turn(a, b, c) != 0);
        let Some(k) = points.iter().position(spread) else { return Self::Line };
        let c = points[k];
        match points.iter().position(|&d| side(a, b, c, d) != 0) {
            None => Self::Plane(a, b, c),
            Some(l) if side(a, b, c, points[l]) > 0 => Self::Space([0, j, k, l]),
            Some(l) => Self::Space([0, k, j, l]),
        }
    }
}

/// The ends of points on a line, as a triangle.
fn line(points: &[Vec3]) -> [Vec3; 3] {
    // Any order that follows the line will do.
    let before = |a: &Vec3, b: &Vec3| a.to_array() < b.to_array();
    let first = points.iter().copied().reduce(|a, b| if before(&b, &a) { b } else { a }).unwrap_or_default();
    let last = points.iter().copied().reduce(|a, b| if before(&a, &b) { b } else { a }).unwrap_or_default();
    [first, last, last]
}

/// The hull of points in a plane, as a fan. Andrew's monotone chain in a projection in which `spread` has an area.
fn polygon(points: &[Vec3], [a, b, c]: [Vec3; 3]) -> Vec<[Vec3; 3]> {
    let projection = Projection::ALL.into_iter().find(|x| x.turn(a, b, c) != 0).unwrap_or(Projection::ALL[0]);
    let mut sorted = points.to_vec();
    let key = |p: &Vec3| [p[projection.x], p[projection.y]];
    sorted.sort_by(|p, q| key(p).partial_cmp(&key(q)).unwrap_or(std::cmp::Ordering::Equal));
    sorted.dedup();
    let chain = |points: &mut dyn Iterator<Item = Vec3>| {
        let mut chain: Vec<Vec3> = Vec::new();
        for p in points {
            while chain.len() > 1 && projection.turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut ring = chain(&mut sorted.iter().copied());
    ring.extend(chain(&mut sorted.iter().rev().copied()));
    (2..ring.len()).map(|i| [ring[0], ring[i - 1], ring[i]]).collect()
}

/// The hull of points that span a solid: point by point, the faces that see the point give way to a cone from it.
///
/// Only strict sides count, so points in a face's plane are taken up by the faces next to it.
fn solid(points: &[Vec3], [a, b, c, d]: [usize; 4]) -> Vec<[Vec3; 3]> {
    let mut faces: Vec<[u32; 3]> =
        [[a, b, c], [a, d, b], [b, d, c], [c, d, a]].iter().map(|f| f.map(|i| i as u32)).collect();
    for number in 0..points.len() as u32 {
        let p = points[number as usize];
        let sees = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|i| points[i as usize]);
            side(a, b, c, p) < 0
        };
        let (seen, kept): (Vec<_>, Vec<_>) = faces.iter().partition(|&f| sees(f));
        if seen.is_empty() {
            continue;
        }
        let edges = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let rim: Vec<[u32; 2]> = seen
            .iter()
            .flat_map(|f: &[u32; 3]| edges(f))
            .filter(|&[from, to]| !seen.iter().any(|f| edges(f).contains(&[to, from])))
            .collect();
        faces = kept;
        faces.extend(rim.into_iter().map(|[from, to]| [from, to, number]));
    }
    faces.iter().map(|f| f.map(|i| points[i as usize])).collect()
}

#[cfg(test)]
mod tests {
    use proptest::{collection::vec, prelude::*};

    use super::*;
    use crate::collide::triangle_meets_box;

    fn point(n: i8) -> impl Strategy<Value = Vec3> {
        [-n..=n, -n..=n, -n..=n].prop_map(|p| Vec3::from(p.map(f32::from)))
    }

    proptest! {
        #[test]
        fn a_hull_holds_its_points_and_their_means_and_is_convex(points in vec(point(3), 1..24), at in (0.0_f32..1.0, 0_usize..24, 0_usize..24)) {
            let hull = ConvexHull::new(&points).unwrap();
            for &p in &points {
                prop_assert!(hull.contains(p), "{p}");
                if hull.is_solid {
                    prop_assert!(hull.faces.iter().all(|&[a, b, c]| side(a, b, c, p) >= 0));
                }
            }
            for face in &hull.faces {
                prop_assert!(face.iter().all(|corner| points.contains(corner)));
            }
            // Halves of small integers are exact.
            let (p, q) = (points[at.1 % points.len()], points[at.2 % points.len()]);
            prop_assert!(hull.contains((p + q) * 0.5));
        }

        #[test]
        fn the_hull_of_a_box_meets_what_the_box_meets(
            min in point(3), size in [0_u8..4, 0_u8..4, 0_u8..4], t in [point(4), point(4), point(4)],
        ) {
            let aabb = Aabb { min, max: min + Vec3::from(size.map(f32::from)) };
            let hull = ConvexHull::of_box(&aabb, &DAffine3::IDENTITY).unwrap();
            prop_assert_eq!(hull.meets_triangle(&t), triangle_meets_box(&t, &aabb));
        }
    }

    #[test]
    fn hulls_of_bad_points_are_errors() {
        assert!(matches!(ConvexHull::new(&[]), Err(CollideError::Count { .. })));
        assert!(matches!(ConvexHull::new(&[Vec3::NAN]), Err(CollideError::NotFinite { .. })));
        assert!(matches!(ConvexHull::new(&vec![Vec3::ZERO; 5000]), Err(CollideError::TooMany { .. })));
        assert!(matches!(ConvexHull::of_box(&Aabb::EMPTY, &DAffine3::IDENTITY), Err(CollideError::EmptyBox { .. })));
    }
}
