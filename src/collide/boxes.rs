//! Closed axis-aligned boxes: against each other, moving against resting, against rays.
//!
//! A box with NaN, or with `min > max` on an axis, is empty and meets nothing. Infinite bounds are legal: such a box has no end there.

#![expect(clippy::cast_possible_truncation, reason = "the number of boxes is checked")]

use std::cmp::Ordering;

use glam::Vec3;

use crate::geom::{Aabb, Ray, exact::Ratio};

/// True when two closed boxes share a point; exact.
#[inline(always)]
pub fn boxes_meet(a: &Aabb, b: &Aabb) -> bool {
    // Written so that a NaN in either box makes a comparison fail.
    let within = a.min.cmple(b.max) & b.min.cmple(a.max) & a.min.cmple(a.max) & b.min.cmple(b.max);
    within.all()
}

/// Every pair `[i, j]`, `i < j`, of closed boxes that share a point, in ascending order.
///
/// Sorts along the axis on which the boxes' centres spread most and sweeps: O(n log n + k), k the pairs that overlap on that axis.
/// Allocates; one thread.
///
/// # Panics
/// With more than 2^32 boxes.
pub fn box_pairs(boxes: &[Aabb]) -> Vec<[u32; 2]> {
    assert!(u32::try_from(boxes.len()).is_ok(), "{} boxes", boxes.len());
    let axis = widest_axis(boxes);
    let mut order: Vec<u32> = (0..boxes.len() as u32).filter(|&i| !boxes[i as usize].is_empty()).collect();
    // Empty boxes and with them NaN are gone; -0 and 0 are equal.
    order.sort_by(|&i, &j| {
        let least = |i: u32| boxes[i as usize].min[axis];
        least(i).partial_cmp(&least(j)).unwrap_or(Ordering::Equal)
    });
    let mut pairs = Vec::new();
    for (at, &i) in order.iter().enumerate() {
        let a = &boxes[i as usize];
        let near = order[at + 1..].iter().take_while(|&&j| boxes[j as usize].min[axis] <= a.max[axis]);
        pairs.extend(near.filter(|&&j| boxes_meet(a, &boxes[j as usize])).map(|&j| [i.min(j), i.max(j)]));
    }
    pairs.sort_unstable();
    pairs
}

/// The axis on which finite centres spread most.
fn widest_axis(boxes: &[Aabb]) -> usize {
    let centers = boxes.iter().map(|b| b.center()).filter(|c| c.is_finite());
    let spread = Aabb::from_points(centers).extent();
    (0..3).fold(0, |best, axis| if spread[axis] > spread[best] { axis } else { best })
}

/// A closed range of time or of a ray's parameter in which something is inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// The first moment, within 2^-51 of its size.
    pub enter: f64,
    /// The last one, likewise; not before `enter`.
    pub exit: f64,
}

/// When box `a`, moving by `motion` while s goes from 0 to 1, touches box `b` at rest: the first and the last such s.
///
/// Exactly decided on the real path `a + s * motion`; both boxes are closed, and boxes that share a point at the start have `enter` 0.
/// `None` without contact, for an empty box, and for a motion that is not finite.
pub fn sweep_box(a: &Aabb, motion: Vec3, b: &Aabb) -> Option<Passage> {
    if a.is_empty() || b.is_empty() || !motion.is_finite() {
        return None;
    }
    let mut span = Span::new(0.0, 1.0);
    for axis in 0..3 {
        span.narrow([b.min[axis], a.max[axis]], [b.max[axis], a.min[axis]], motion[axis])?;
    }
    span.passage()
}

/// Where a ray runs inside of a closed box: the first and the last t in its range.
///
/// Exactly decided: in f32 a traversal may be conservative, this is not. A direction component of 0 (of either sign) needs the origin
/// between the box's planes. `None` for a miss, an empty box, and a ray that can hit nothing ([`Ray`]); a `t_far` of infinity stays one
/// in `exit` where the box has no end.
pub fn ray_box(ray: &Ray, aabb: &Aabb) -> Option<Passage> {
    let (near, far) = (ray.t_near.max(0.0), ray.t_far);
    let usable = ray.origin.is_finite() && ray.dir.is_finite() && ray.dir != Vec3::ZERO && ray.t_near <= far;
    if aabb.is_empty() || !usable || far < 0.0 || near.is_infinite() {
        return None;
    }
    let mut span = Span::new(near, far);
    for axis in 0..3 {
        let o = ray.origin[axis];
        span.narrow([aabb.min[axis], o], [aabb.max[axis], o], ray.dir[axis])?;
    }
    span.passage()
}

/// A moment: a ratio, or one of the ends that are given.
#[derive(Clone, Copy)]
enum Moment {
    At(Ratio),
    Never,
}

impl Moment {
    fn given(value: f32) -> Self {
        if value.is_finite() { Self::At(Ratio { to: value, from: 0.0, speed: 1.0 }) } else { Self::Never }
    }

    fn value(self) -> f64 {
        match self {
            Self::At(ratio) => ratio.value(),
            Self::Never => f64::INFINITY,
        }
    }
}

/// A range of moments, narrowed axis by axis.
struct Span {
    enter: Moment,
    exit: Moment,
}

impl Span {
    fn new(enter: f32, exit: f32) -> Self {
        Self { enter: Moment::given(enter), exit: Moment::given(exit) }
    }

    /// Keeps the moments s with `lower[0] - lower[1] <= s * speed <= upper[0] - upper[1]`; `None` when a constant rules all out.
    fn narrow(&mut self, lower: [f32; 2], upper: [f32; 2], speed: f32) -> Option<()> {
        if is_out_of_reach(lower) || is_out_of_reach(upper.map(|x| -x)) {
            return None;
        }
        if speed == 0.0 {
            return (lower[0] <= lower[1] && upper[0] >= upper[1]).then_some(());
        }
        let bound = |[to, from]: [f32; 2]| (to.is_finite() && from.is_finite()).then_some(Ratio { to, from, speed });
        let (low, high) = (bound(lower), bound(upper));
        let (enter, exit) = if speed > 0.0 { (low, high) } else { (high, low) };
        if let Some(enter) = enter {
            self.enter = later(self.enter, enter);
        }
        if let Some(exit) = exit {
            self.exit = earlier(self.exit, exit);
        }
        Some(())
    }

    fn passage(&self) -> Option<Passage> {
        let (enter, exit) = (self.enter.value(), self.exit.value());
        let open = match (self.enter, self.exit) {
            (Moment::At(enter), Moment::At(exit)) => enter.compare(exit) != Ordering::Greater,
            (Moment::At(_), Moment::Never) => true,
            (Moment::Never, _) => false,
        };
        // Equal in truth, the roundings may be in the wrong order.
        open.then(|| Passage { enter, exit: exit.max(enter) })
    }
}

/// Whether `to - from` is a lower bound that nothing finite reaches; an infinite one the other way bounds nothing.
fn is_out_of_reach([to, from]: [f32; 2]) -> bool {
    let unbounded = to == f32::NEG_INFINITY || from == f32::INFINITY;
    !unbounded && (to == f32::INFINITY || from == f32::NEG_INFINITY)
}

fn later(a: Moment, b: Ratio) -> Moment {
    match a {
        Moment::At(a) if a.compare(b) != Ordering::Less => Moment::At(a),
        _ => Moment::At(b),
    }
}

fn earlier(a: Moment, b: Ratio) -> Moment {
    match a {
        Moment::At(a) if a.compare(b) != Ordering::Greater => Moment::At(a),
        _ => Moment::At(b),
    }
}
