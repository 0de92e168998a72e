//! How far: from a point to a part or the world, and from part to part.

use glam::{DVec3, Vec3};

use super::{
    CollideError, PartId, Side, Snapshot, Surface,
    closest::to_triangle,
    tree::{Near, NearPairs, Tree},
    triangle_distance,
    world::PartFrame,
};
use crate::simd::{Simd, SimdLevel, Task, check_float_mode, dispatch};

/// The point of a surface that is nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// How far it is.
    pub distance: f64,
    /// What is there.
    pub surface: Surface,
    /// The side that is seen from the point asked about; at edges and corners that of the triangle alone.
    pub side: Side,
}

/// Where two parts come nearest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartDistance {
    /// How far apart; 0 exactly for parts whose surfaces meet.
    pub distance: f64,
    /// The point of each.
    pub surfaces: [Surface; 2],
}

impl Snapshot {
    /// The point nearest to `point` on any part on one of `layers`, at most `within` away; of equally near triangles the lower (part, triangle).
    ///
    /// Accuracy: as [`super::closest_on_triangle`]. Cost: a few microseconds on 100,000 triangles. Infinite `within` is legal.
    ///
    /// # Errors
    /// When a number is NaN, `point` is not finite, `within` is negative, or foreign code changed how this thread computes.
    pub fn closest_point(&self, point: Vec3, within: f64, layers: u32) -> Result<Option<ClosestPoint>, CollideError> {
        let mut best = Best::new(point, within)?;
        let tree = self.part_tree();
        dispatch(SimdLevel::best(), NearParts { snapshot: self, tree, layers, best: &mut best });
        Ok(self.answer(&best))
    }

    /// As [`Snapshot::closest_point`], on one part, whatever its layers.
    ///
    /// # Errors
    /// As there, and when there is no such part.
    pub fn closest_point_on(
        &self,
        part: PartId,
        point: Vec3,
        within: f64,
    ) -> Result<Option<ClosestPoint>, CollideError> {
        let mut best = Best::new(point, within)?;
        let frame = self.frame(part)?;
        dispatch(SimdLevel::best(), NearTriangles { tree: self.tree_of(frame), frame, part, best: &mut best });
        Ok(self.answer(&best))
    }

    /// Where two parts come nearest to each other, at most `within`; of equally near pairs of triangles the lowest.
    ///
    /// Accuracy: as [`super::triangle_distance`]. Cost: some 0.3 µs for each pair of triangles whose boxes are nearer than the answer, so least where the parts
    /// meet or `within` is small. Layers are not looked at. One thread.
    ///
    /// # Errors
    /// When there is no such part, `within` is NaN or negative, or foreign code changed how this thread computes.
    pub fn distance_between(&self, a: PartId, b: PartId, within: f64) -> Result<Option<PartDistance>, CollideError> {
        check_float_mode()?;
        let (one, other) = (self.frame(a)?, self.frame(b)?);
        let reach = checked_within(within)?;
        let mut best = BestPair { one, other, reach, square: reach * reach, found: None };
        self.tree_of(one).near_pairs(self.tree_of(other), &mut best);
        Ok(best.found.map(|(distance, [x, y], points)| PartDistance {
            distance,
            surfaces: [self.surface_near(one, a, x, points[0]), self.surface_near(other, b, y, points[1])],
        }))
    }

    fn answer(&self, best: &Best) -> Option<ClosestPoint> {
        let (distance, part, triangle, point) = best.found?;
        let surface = self.surface_near(&self.frames()[part.index()], part, triangle, point);
        Some(ClosestPoint { distance, side: surface.side_seen_from(best.point.as_dvec3()), surface })
    }
}

fn checked_within(within: f64) -> Result<f64, CollideError> {
    if within.is_nan() {
        return Err(CollideError::NotFinite { what: "distance" });
    }
    if within < 0.0 {
        return Err(CollideError::OutOfRange { what: "distance", value: within });
    }
    Ok(within)
}

/// The nearest triangle so far.
struct Best {
    point: Vec3,
    wide: DVec3,
    /// Nothing further away counts.
    reach: f64,
    square: f64,
    found: Option<(f64, PartId, u32, DVec3)>,
}

impl Best {
    fn new(point: Vec3, within: f64) -> Result<Self, CollideError> {
        check_float_mode()?;
        if !point.is_finite() {
            return Err(CollideError::NotFinite { what: "point" });
        }
        let reach = checked_within(within)?;
        Ok(Self { point, wide: point.as_dvec3(), reach, square: reach * reach, found: None })
    }

    #[inline(always)]
    fn offer(&mut self, corners: &[Vec3; 3], part: PartId, triangle: u32) {
        let [a, b, c] = corners;
        let corners = [a.as_dvec3(), b.as_dvec3(), c.as_dvec3()];
        if let Some((.., nearest)) = self.found
            && lies_beyond(self.wide, nearest, &corners)
        {
            return;
        }
        let near = to_triangle(self.wide, &corners);
        let better = match self.found {
            Some((distance, p, t, _)) => {
                near.distance < distance || (near.distance <= distance && (part, triangle) < (p, t))
            }
            None => near.distance <= self.reach,
        };
        if better {
            self.found = Some((near.distance, part, triangle, near.points[1]));
            self.reach = near.distance;
            // The product may round down.
            self.square = near.distance * near.distance * (1.0 + 4.0 * f64::EPSILON);
        }
    }
}

/// Whether a triangle surely lies further from `p` than the point `nearest`: beyond the plane through it across the way there.
#[inline(always)]
fn lies_beyond(p: DVec3, nearest: DVec3, &[a, b, c]: &[DVec3; 3]) -> bool {
    let way = nearest - p;
    let square = way.length_squared();
    let [a, b, c] = [(a - p).dot(way), (b - p).dot(way), (c - p).dot(way)];
    let least = if a < b { a } else { b };
    // The margin is far above the roundings of points of the same size as the way; nearer ones are not told apart.
    (if least < c { least } else { c })
        > square * (1.0 + 1e-9) + 1e-13 * p.abs().max_element() * way.abs().max_element()
}

struct NearTriangles<'a> {
    tree: &'a Tree,
    frame: &'a PartFrame,
    part: PartId,
    best: &'a mut Best,
}

impl Near for NearTriangles<'_> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        self.best.square
    }

    #[inline(always)]
    fn visit(&mut self, triangle: u32) {
        self.best.offer(&self.frame.corners(triangle), self.part, triangle);
    }
}

impl Task for NearTriangles<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        let (tree, point) = (self.tree, self.best.point);
        tree.near::<S, _>(point, &mut Vec::with_capacity(64), &mut self);
    }
}

struct NearParts<'a> {
    snapshot: &'a Snapshot,
    tree: &'a Tree,
    layers: u32,
    best: &'a mut Best,
}

impl Near for NearParts<'_> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        self.best.square
    }

    fn visit(&mut self, number: u32) {
        let part = PartId(number);
        let frame = &*self.snapshot.frames()[part.index()];
        if frame.layers.on & self.layers != 0 {
            let tree = self.snapshot.tree_of(frame);
            dispatch(SimdLevel::best(), NearTriangles { tree, frame, part, best: self.best });
        }
    }
}

impl Task for NearParts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        let (tree, point) = (self.tree, self.best.point);
        tree.near::<S, _>(point, &mut Vec::with_capacity(64), &mut self);
    }
}

/// The nearest pair of triangles so far.
struct BestPair<'a> {
    one: &'a PartFrame,
    other: &'a PartFrame,
    reach: f64,
    square: f64,
    found: Option<(f64, [u32; 2], [DVec3; 2])>,
}

impl NearPairs for BestPair<'_> {
    fn limit(&self) -> f64 {
        self.square
    }

    fn visit(&mut self, a: u32, b: u32) {
        let known = self.found.as_ref().map(|found| (found.0, found.1));
        // Nothing is nearer than 0, and later pairs do not count.
        if known.is_some_and(|(distance, pair)| distance <= 0.0 && pair < [a, b]) {
            return;
        }
        let Some(near) = triangle_distance(&self.one.corners(a), &self.other.corners(b)) else { return };
        let better = match known {
            Some((distance, pair)) => near.distance < distance || (near.distance <= distance && [a, b] < pair),
            None => near.distance <= self.reach,
        };
        if better {
            self.found = Some((near.distance, [a, b], near.points));
            self.square = near.distance * near.distance * (1.0 + 4.0 * f64::EPSILON);
        }
    }
}
