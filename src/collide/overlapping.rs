//! What a shape touches: triangles of parts that share a point with it.

use std::ops::ControlFlow;

use glam::{DAffine3, DVec3, Vec3};

use super::{
    CollideError, ConvexHull, PartId, Snapshot, Surface, boxes_meet, closest::to_triangle, triangle_meets_box,
    triangle_meets_capsule, triangle_meets_sphere, triangles_meet, world::PartFrame,
};
use crate::{
    geom::Aabb,
    simd::{Simd, SimdLevel, Task, check_float_mode, dispatch},
};

/// A closed solid, or a surface, in world space.
#[derive(Clone, Copy, Debug)]
pub enum Shape<'a> {
    /// An axis-aligned box; infinite bounds are legal. Exact.
    Box(Aabb),
    /// A ball. Exact.
    Sphere {
        /// Its centre.
        center: Vec3,
        /// Its radius, not negative.
        radius: f32,
    },
    /// All within a distance of a segment. Exact.
    Capsule {
        /// One end of the segment.
        from: Vec3,
        /// The other.
        to: Vec3,
        /// The distance, not negative.
        radius: f32,
    },
    /// A triangle. Exact.
    Triangle([Vec3; 3]),
    /// A convex hull, as [`ConvexHull::of_box`] of an oriented box. Exact.
    Hull(&'a ConvexHull),
    /// The surface of a part of the same snapshot, which then does not count itself. Exact.
    Part(PartId),
}

/// A triangle that touches a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// What it is, at its point nearest to the shape's centre.
    pub surface: Surface,
}

impl Snapshot {
    /// Every triangle on one of `layers` that shares a point with `shape`, in ascending order of part and triangle.
    ///
    /// Cost: a walk, some 50 ns for each triangle whose box meets that of the shape (for a hull, for each of its faces), and 100 ns for each one found.
    /// For [`Shape::Part`] as [`Snapshot::pairs_between`]. One thread; allocates.
    ///
    /// # Errors
    /// When the shape has NaN or (but for boxes) an infinite number, an empty box, a negative radius or no such part, or foreign code
    /// changed how this thread computes.
    pub fn overlaps(&self, shape: &Shape<'_>, layers: u32) -> Result<Vec<Overlap>, CollideError> {
        let mut all = Vec::new();
        self.each_overlap(shape, layers, |overlap| {
            all.push(overlap);
            ControlFlow::Continue(())
        })?;
        Ok(all)
    }

    /// The first of [`Snapshot::overlaps`].
    ///
    /// Cost: as there, for the parts up to that of the first one.
    ///
    /// # Errors
    /// As there.
    pub fn first_overlap(&self, shape: &Shape<'_>, layers: u32) -> Result<Option<Overlap>, CollideError> {
        let mut first = None;
        self.each_overlap(shape, layers, |overlap| {
            first = Some(overlap);
            ControlFlow::Break(())
        })?;
        Ok(first)
    }

    /// Calls `visit` with each of [`Snapshot::overlaps`], in their order, until it breaks.
    ///
    /// A part is looked at when those before it are done.
    ///
    /// # Errors
    /// As there.
    pub fn each_overlap(
        &self,
        shape: &Shape<'_>,
        layers: u32,
        mut visit: impl FnMut(Overlap) -> ControlFlow<()>,
    ) -> Result<(), CollideError> {
        check_float_mode()?;
        let bounds = self.checked_bounds(shape)?;
        let center = self.center(shape)?;
        for number in self.parts_meeting(&bounds, layers) {
            let id = PartId(number);
            let frame = &*self.frames()[id.index()];
            let mut found = Vec::new();
            self.each_triangle(frame, id, shape, &bounds, &mut |triangle| {
                found.push(triangle);
                ControlFlow::Continue(())
            })?;
            found.sort_unstable();
            for triangle in found {
                let point = to_triangle(center, &frame.corners(triangle).map(Vec3::as_dvec3)).points[1];
                let surface = self.surface_near(frame, id, triangle, point);
                if visit(Overlap { surface }).is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Whether any triangle on one of `layers` shares a point with `shape`.
    ///
    /// Cost: as [`Snapshot::overlaps`], up to the first one found.
    ///
    /// # Errors
    /// As [`Snapshot::overlaps`].
    pub fn any_overlap(&self, shape: &Shape<'_>, layers: u32) -> Result<bool, CollideError> {
        check_float_mode()?;
        let bounds = self.checked_bounds(shape)?;
        let mut any = false;
        for number in self.parts_meeting(&bounds, layers) {
            let id = PartId(number);
            self.each_triangle(&self.frames()[id.index()], id, shape, &bounds, &mut |_| {
                any = true;
                ControlFlow::Break(())
            })?;
            if any {
                break;
            }
        }
        Ok(any)
    }

    /// The triangles of a part that touch a shape, in no particular order.
    fn each_triangle(
        &self,
        frame: &PartFrame,
        id: PartId,
        shape: &Shape<'_>,
        bounds: &Aabb,
        visit: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<(), CollideError> {
        if let Shape::Part(other) = *shape {
            if other == id {
                return Ok(());
            }
            let whole = self.frame(other)?;
            let mut last = None;
            let mut seen = std::collections::HashSet::new();
            self.tree_of(frame).pairs_with(self.tree_of(whole), &mut |a: u32, b: u32| {
                let known = last == Some(a) || seen.contains(&a);
                if known || !triangles_meet(&frame.corners(a), &whole.corners(b)) {
                    return ControlFlow::Continue(());
                }
                last = Some(a);
                seen.insert(a);
                visit(a)
            });
            return Ok(());
        }
        let tree = self.tree_of(frame);
        let meets = |triangle: u32| {
            let corners = frame.corners(triangle);
            match shape {
                Shape::Box(aabb) => triangle_meets_box(&corners, aabb),
                Shape::Sphere { center, radius } => triangle_meets_sphere(&corners, *center, *radius),
                Shape::Capsule { from, to, radius } => triangle_meets_capsule(&corners, *from, *to, *radius),
                Shape::Triangle(other) => triangles_meet(other, &corners),
                Shape::Hull(hull) => hull.meets_triangle(&corners),
                Shape::Part(_) => false,
            }
        };
        dispatch(
            SimdLevel::best(),
            Meeting {
                tree,
                bounds,
                visit: &mut |triangle| {
                    if meets(triangle) { visit(triangle) } else { ControlFlow::Continue(()) }
                },
            },
        );
        Ok(())
    }

    /// The least box around a shape, grown past its roundings.
    fn checked_bounds(&self, shape: &Shape<'_>) -> Result<Aabb, CollideError> {
        let around = |points: &[Vec3], radius: f32| {
            if !points.iter().all(|p| p.is_finite()) || radius.is_nan() || radius.is_infinite() {
                return Err(CollideError::NotFinite { what: "shape" });
            }
            if radius < 0.0 {
                return Err(CollideError::OutOfRange { what: "radius", value: f64::from(radius) });
            }
            Ok(grown(Aabb::from_points(points.iter().copied()), radius))
        };
        match shape {
            Shape::Box(aabb) if aabb.is_empty() => Err(CollideError::EmptyBox { what: "shape" }),
            Shape::Box(aabb) => Ok(*aabb),
            Shape::Sphere { center, radius } => around(&[*center], *radius),
            Shape::Capsule { from, to, radius } => around(&[*from, *to], *radius),
            Shape::Triangle(corners) => around(corners, 0.0),
            Shape::Hull(hull) => Ok(hull.bounds()),
            Shape::Part(part) => Ok(self.frame(*part)?.bounds),
        }
    }

    fn center(&self, shape: &Shape<'_>) -> Result<DVec3, CollideError> {
        let of_box = |aabb: &Aabb| {
            let whole = Vec3::splat(f32::MAX);
            (aabb.min.max(-whole).as_dvec3() + aabb.max.min(whole).as_dvec3()) * 0.5
        };
        Ok(match shape {
            Shape::Box(aabb) => of_box(aabb),
            Shape::Sphere { center, .. } => center.as_dvec3(),
            Shape::Capsule { from, to, .. } => (from.as_dvec3() + to.as_dvec3()) * 0.5,
            Shape::Triangle(corners) => corners.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / 3.0,
            Shape::Hull(hull) => hull.center(),
            Shape::Part(part) => of_box(&self.frame(*part)?.bounds),
        })
    }
}

/// A box grown by a distance, outwards where that rounds.
pub(super) fn grown(aabb: Aabb, by: f32) -> Aabb {
    let (min, max) = (aabb.min - by, aabb.max + by);
    let down = |v: Vec3| Vec3::from(v.to_array().map(f32::next_down));
    let up = |v: Vec3| Vec3::from(v.to_array().map(f32::next_up));
    // A half of the least step covers the rounding of f64 tests against f32 radii.
    Aabb { min: down(min), max: up(max) }
}

struct Meeting<'a, F> {
    tree: &'a super::tree::Tree,
    bounds: &'a Aabb,
    visit: &'a mut F,
}

impl<F: FnMut(u32) -> ControlFlow<()>> Task for Meeting<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        if boxes_meet(&self.tree.bounds(), self.bounds) {
            // A visitor that breaks has what it wanted.
            let _ = self.tree.meeting::<S>(self.bounds, &mut Vec::with_capacity(64), self.visit);
        }
    }
}

/// The hull of an oriented box: `half` extents along the axes of a rotation, around a centre.
///
/// # Errors
/// When a number is not finite or a half extent negative.
pub fn oriented_box(center: DVec3, half: DVec3, rotation: glam::DQuat) -> Result<ConvexHull, CollideError> {
    if !(center.is_finite() && half.is_finite() && rotation.is_finite()) {
        return Err(CollideError::NotFinite { what: "oriented box" });
    }
    if let Some(value) = half.to_array().into_iter().find(|h| *h < 0.0) {
        return Err(CollideError::OutOfRange { what: "half extent", value });
    }
    let unit = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };
    let world_from_box = DAffine3::from_scale_rotation_translation(half, rotation, center);
    ConvexHull::of_box(&unit, &world_from_box)
}
