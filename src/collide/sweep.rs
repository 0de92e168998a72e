//! Swept spheres, capsules and boxes: when a moving shape first touches the world.

use glam::{DVec3, Vec3};

use super::{
    CollideError, PartId, Snapshot, Surface,
    closest::{Nearest, between_segments, to_triangle},
    overlapping::grown,
    surface::unit,
    tree::{Along, Tree},
    triangle_meets_box, triangle_meets_capsule,
    world::PartFrame,
};
use crate::{geom::Aabb, simd::check_float_mode};

/// A shape that moves along a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mover {
    /// A ball.
    Sphere {
        /// Its centre at the start.
        center: Vec3,
        /// Its radius, not negative.
        radius: f32,
    },
    /// All within a distance of a segment.
    Capsule {
        /// One end of the segment at the start.
        from: Vec3,
        /// The other.
        to: Vec3,
        /// The distance, not negative.
        radius: f32,
    },
    /// An axis-aligned box, as it is at the start; finite.
    Box(Aabb),
}

/// Where a moving shape first touches a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepHit {
    /// The share of the motion done until then, in [0, 1]; 0 for shapes that touch at the start.
    pub time: f64,
    /// The point touched.
    pub surface: Surface,
    /// Unit direction from the part to the shape at that time; none where they touch at the start.
    pub normal: Option<DVec3>,
}

impl Snapshot {
    /// What a shape that moves by `motion` touches first on one of `layers`; of equal times the lower (part, triangle).
    ///
    /// No contact is missed and none reported late: `time` is at most the true one, and earlier by at most some 2^-40 of the largest coordinate
    /// over the length of the motion (more where the shape grazes: there it is that near to the surface). `None` proves that
    /// the shape stays clear of everything. Cost: a walk, and a microsecond or less for each triangle that it comes upon.
    ///
    /// # Errors
    /// When a number is not finite, a radius negative, the box empty, or foreign code changed how this thread computes.
    pub fn sweep(&self, mover: &Mover, motion: Vec3, layers: u32) -> Result<Option<SweepHit>, CollideError> {
        check_float_mode()?;
        if !motion.is_finite() {
            return Err(CollideError::NotFinite { what: "motion" });
        }
        let body = Body::new(mover, motion)?;
        let mut best = First { time: 1.0, found: None };
        let around = body.around;
        let mut parts = Parts { snapshot: self, layers, body: &body, best: &mut best };
        self.part_tree().along(&around, motion, &mut parts);
        Ok(best.found.map(|(part, triangle)| self.touched(&body, best.time, part, triangle)))
    }

    fn touched(&self, body: &Body, time: f64, part: PartId, triangle: u32) -> SweepHit {
        let frame = &*self.frames()[part.index()];
        let corners = frame.corners(triangle).map(Vec3::as_dvec3);
        let near = body.nearest(&corners, time);
        let surface = self.surface_near(frame, part, triangle, near.points[1]);
        let normal = if time > 0.0 { unit(near.points[0] - near.points[1]).or(surface.n_geom) } else { None };
        SweepHit { time, surface, normal }
    }
}

/// The first contact so far.
struct First {
    time: f64,
    found: Option<(PartId, u32)>,
}

struct Parts<'a> {
    snapshot: &'a Snapshot,
    layers: u32,
    body: &'a Body,
    best: &'a mut First,
}

impl Along for Parts<'_> {
    fn limit(&self) -> f64 {
        self.best.time
    }

    fn visit(&mut self, number: u32) {
        let part = PartId(number);
        let frame = &*self.snapshot.frames()[part.index()];
        if frame.layers.on & self.layers != 0 {
            let tree: &Tree = self.snapshot.tree_of(frame);
            tree.along(
                &self.body.around,
                self.body.step,
                &mut Triangles { frame, part, body: self.body, best: self.best },
            );
        }
    }
}

struct Triangles<'a> {
    frame: &'a PartFrame,
    part: PartId,
    body: &'a Body,
    best: &'a mut First,
}

impl Along for Triangles<'_> {
    fn limit(&self) -> f64 {
        self.best.time
    }

    fn visit(&mut self, triangle: u32) {
        let Some(time) = self.body.first_touch(&self.frame.corners(triangle), self.best.time) else { return };
        let place = (self.part, triangle);
        if time < self.best.time || self.best.found.is_none_or(|found| time <= self.best.time && place < found) {
            *self.best = First { time, found: Some(place) };
        }
    }
}

/// A moving shape in f64.
struct Body {
    mover: Mover,
    step: Vec3,
    motion: DVec3,
    /// The segment at the core of a capsule; for a sphere a point twice, for a box its corners.
    core: [DVec3; 2],
    radius: f64,
    /// Around it at the start.
    around: Aabb,
    /// Largest coordinate of it anywhere on its way.
    reach: f64,
}

/// What distances may be off by, for coordinates of size 1; and what counts as touching.
const SLACK: f64 = 1.0 / (1_u64 << 42) as f64;

/// Newton's steps; each at least halves what is left except where the shape grazes.
const STEPS: u32 = 64;

impl Body {
    fn new(mover: &Mover, step: Vec3) -> Result<Self, CollideError> {
        let (core, radius) = match *mover {
            Mover::Sphere { center, radius } => ([center; 2], radius),
            Mover::Capsule { from, to, radius } => ([from, to], radius),
            Mover::Box(aabb) => ([aabb.min, aabb.max], 0.0),
        };
        if !(core[0].is_finite() && core[1].is_finite() && radius.is_finite()) {
            return Err(CollideError::NotFinite { what: "shape" });
        }
        if radius < 0.0 {
            return Err(CollideError::OutOfRange { what: "radius", value: f64::from(radius) });
        }
        let around = match mover {
            Mover::Box(aabb) if aabb.is_empty() => return Err(CollideError::EmptyBox { what: "shape" }),
            Mover::Box(aabb) => *aabb,
            _ => grown(Aabb::from_points(core), radius),
        };
        let motion = step.as_dvec3();
        let core = core.map(Vec3::as_dvec3);
        let reach = core.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let reach = reach + motion.abs().max_element() + f64::from(radius);
        Ok(Self { mover: *mover, step, motion, core, radius: f64::from(radius), around, reach })
    }

    /// At most the time of first contact with a closed triangle; `None` if there is none up to `limit`.
    fn first_touch(&self, corners: &[Vec3; 3], limit: f64) -> Option<f64> {
        let touches = match self.mover {
            Mover::Sphere { center, radius } => triangle_meets_capsule(corners, center, center, radius),
            Mover::Capsule { from, to, radius } => triangle_meets_capsule(corners, from, to, radius),
            Mover::Box(aabb) => triangle_meets_box(corners, &aabb),
        };
        if touches {
            return Some(0.0);
        }
        let wide = corners.map(Vec3::as_dvec3);
        match self.mover {
            Mover::Box(_) => self.box_touch(&wide, limit),
            _ => self.round_touch(&wide, limit),
        }
    }

    /// The distance of two convex solids is a convex function of the time while they move along straight lines. Newton's steps stay before its first zero.
    fn round_touch(&self, corners: &[DVec3; 3], limit: f64) -> Option<f64> {
        let reach = corners.iter().map(|p| p.abs().max_element()).fold(self.reach, f64::max);
        let slack = SLACK * reach;
        let mut time = 0.0;
        for _ in 0..STEPS {
            let near = self.nearest(corners, time);
            let gap = near.distance - self.radius - slack;
            if gap <= 0.0 {
                return Some(time);
            }
            let apart = near.points[0] - near.points[1];
            // How fast the gap closes; no faster than this later on.
            let speed = -self.motion.dot(apart) / near.distance;
            let next = time + gap / speed;
            if !(speed > 0.0 && next <= limit) {
                return None;
            }
            if next <= time {
                return Some(time);
            }
            time = next;
        }
        Some(time)
    }

    /// Nearest points of the shape's core, moved, and of a triangle; of a box itself and a triangle that it comes near to.
    fn nearest(&self, corners: &[DVec3; 3], time: f64) -> Nearest {
        let core = self.core.map(|p| p + self.motion * time);
        match self.mover {
            Mover::Sphere { .. } => to_triangle(core[0], corners),
            Mover::Capsule { .. } => segment_to_triangle(core, corners),
            Mover::Box(_) => box_to_triangle(core, corners),
        }
    }

    /// The times at which both overlap along each of a few axes; the latest of their starts is that of contact.
    ///
    /// # Source
    /// Separating axes of moving convex solids: Ericson, "Real-Time Collision Detection", 2005, section 5.5.8.
    fn box_touch(&self, corners: &[DVec3; 3], limit: f64) -> Option<f64> {
        let reach = corners.iter().map(|p| p.abs().max_element()).fold(self.reach, f64::max);
        let (center, half) = ((self.core[0] + self.core[1]) * 0.5, (self.core[1] - self.core[0]) * 0.5);
        let [a, b, c] = *corners;
        let edges = [b - a, c - b, a - c];
        let units = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut axes = arrayvec::ArrayVec::<DVec3, 13>::new();
        axes.extend(units);
        axes.push(edges[0].cross(edges[1]));
        axes.extend(units.iter().flat_map(|u| edges.iter().map(|e| u.cross(*e))));
        let (mut enter, mut exit) = (0.0_f64, limit);
        for axis in axes {
            // Roundings of the products below, and of the axis.
            let slack = SLACK * reach * (axis.x.abs() + axis.y.abs() + axis.z.abs());
            let size = half.dot(axis.abs()) + slack;
            let [p, q, r] = corners.map(|p| (p - center).dot(axis));
            let (low, high) = (p.min(q).min(r) - size, p.max(q).max(r) + size);
            let speed = self.motion.dot(axis);
            if low <= 0.0 && high >= 0.0 && speed.abs() <= slack {
                continue;
            }
            let (first, last) = if speed > 0.0 { (low / speed, high / speed) } else { (high / speed, low / speed) };
            if speed == 0.0 || first.is_nan() || last.is_nan() {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            enter = enter.max(first);
            exit = exit.min(last);
            if enter > exit {
                return None;
            }
        }
        Some(enter)
    }
}

/// Nearest points of a segment and a triangle that do not meet, or nearly do not.
fn segment_to_triangle([p, q]: [DVec3; 2], t: &[DVec3; 3]) -> Nearest {
    let mut best = to_triangle(p, t).or(to_triangle(q, t));
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        best = best.or(between_segments([p, q], [t[i], t[j]]));
    }
    best
}

/// Points of a box and a triangle that touch or nearly do, by projection to the one and the other in turn.
fn box_to_triangle([min, max]: [DVec3; 2], t: &[DVec3; 3]) -> Nearest {
    let mut near = to_triangle((min + max) * 0.5, t);
    for _ in 0..STEPS {
        let inside = near.points[1].clamp(min, max);
        let next = to_triangle(inside, t);
        let settled = next.distance >= near.distance && next.points[0] == near.points[0];
        near = next;
        if settled {
            break;
        }
    }
    near
}
