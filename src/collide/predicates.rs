//! Signs of areas and volumes of f32 points, exact; and their values.
//!
//! A filter in f64 decides nearly all of them, Shewchuk's adaptive expansions (crate `robust`) the rest. The expansions are exact for
//! every finite f32: coordinates are multiples of 2^-149 below 2^128, so that every part of an expansion is a multiple of 2^-447 below
//! 2^393, and f64 holds all of these without overflow or underflow.
//!
//! # Source
//! Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997.

use glam::{DVec3, Vec3};
use robust::{Coord, Coord3D};

use crate::geom::exact::{BOUND, area, volume};

/// -1, 0 or 1.
pub(super) type Sign = i8;

#[inline(always)]
pub(super) fn sign(value: f64) -> Sign {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

/// The sign of `(a - d) . ((b - d) x (c - d))`: on which side of the plane through a, b, c the point d lies. 0 on it, and for a, b, c on one line.
#[inline(always)]
pub(super) fn side(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> Sign {
    // Written out: `map` over an array often stays a call.
    let d64 = d.as_dvec3();
    let (p, q, r) = (a.as_dvec3() - d64, b.as_dvec3() - d64, c.as_dvec3() - d64);
    let volume = p.dot(q.cross(r));
    // The bound of `Plane::height` with the roles of the points turned round.
    if volume.abs() > BOUND * p.abs().max_element() * norm1(q) * norm1(r) {
        return sign(volume);
    }
    side_exactly(a, b, c, d)
}

#[inline(always)]
fn norm1(e: DVec3) -> f64 {
    e.x.abs() + e.y.abs() + e.z.abs()
}

/// Four points that share a coordinate, or two of which are one, lie in a plane: meshes are full of them.
fn plainly_flat(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> bool {
    let flat = d.cmpeq(a) & d.cmpeq(b) & d.cmpeq(c);
    flat.any() || d == a || d == b || d == c
}

#[cold]
#[inline(never)]
fn side_exactly(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> Sign {
    if plainly_flat(a, b, c, d) {
        return 0;
    }
    let coord = |p: Vec3| Coord3D { x: f64::from(p.x), y: f64::from(p.y), z: f64::from(p.z) };
    sign(robust::orient3d(coord(a), coord(b), coord(c), coord(d)))
}

/// A plane through three corners, ready to tell the sides of many points.
pub(super) struct Plane {
    corners: [Vec3; 3],
    /// (c - a) x (b - a) in f64.
    normal: DVec3,
    /// The error of a volume is at most this times the largest component of the point's distance from the first corner.
    reach: f64,
}

impl Plane {
    #[inline(always)]
    pub(super) fn new(corners: [Vec3; 3]) -> Self {
        let a = corners[0].as_dvec3();
        let (e1, e2) = (corners[1].as_dvec3() - a, corners[2].as_dvec3() - a);
        Self { corners, normal: e2.cross(e1), reach: BOUND * norm1(e1) * norm1(e2) }
    }

    pub(super) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The volume that [`side`] takes the sign of, in f64, and a bound on its error.
    ///
    /// A term is a product of three differences; the differences (3 ε with ε = 2^-53), two products, the subtraction inside of the
    /// cross product and two sums put it off by at most 8 ε of its size, and the sizes sum up to at most `|d - a|∞ |e1|₁ |e2|₁`.
    #[inline(always)]
    pub(super) fn height(&self, d: Vec3) -> (f64, f64) {
        let from = d.as_dvec3() - self.corners[0].as_dvec3();
        (self.normal.dot(from), self.reach * from.abs().max_element())
    }

    /// As [`side`] of the corners and `d`.
    #[inline(always)]
    pub(super) fn side(&self, d: Vec3) -> Sign {
        let (height, error) = self.height(d);
        if height.abs() > error {
            return sign(height);
        }
        let [a, b, c] = self.corners;
        side_exactly(a, b, c, d)
    }

    /// Where the segment from `p` to `q`, which lie strictly on opposite sides, crosses the plane: 0 at `p`, 1 at `q`; within 2^-32.
    pub(super) fn crossing(&self, p: Vec3, q: Vec3) -> f64 {
        let ((hp, ep), (hq, eq)) = (self.height(p), self.height(q));
        if (ep + eq) * TWO_34 <= (hp - hq).abs() {
            return hp / (hp - hq);
        }
        let (hp, hq) = (volume(self.corners, p), volume(self.corners, q));
        hp / (hp - hq)
    }
}

/// 2^34.
const TWO_34: f64 = 17_179_869_184.0;

/// A projection along an axis: 2D coordinates are the other two components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Projection {
    pub(super) x: usize,
    pub(super) y: usize,
}

impl Projection {
    pub(super) const ALL: [Self; 3] = [Self { x: 1, y: 2 }, Self { x: 2, y: 0 }, Self { x: 0, y: 1 }];

    /// Twice the signed area of the projected triangle: its sign.
    pub(super) fn turn(self, a: Vec3, b: Vec3, c: Vec3) -> Sign {
        let coord = |p: Vec3| Coord { x: f64::from(p[self.x]), y: f64::from(p[self.y]) };
        sign(robust::orient2d(coord(a), coord(b), coord(c)))
    }

    /// Where the segment from `p` to `q`, which lie strictly on opposite sides, crosses the line through `a` and `b`: within 2^-32.
    pub(super) fn crossing(self, a: Vec3, b: Vec3, p: Vec3, q: Vec3) -> f64 {
        let ((ap, ep), (aq, eq)) = (self.area(a, b, p), self.area(a, b, q));
        if (ep + eq) * TWO_34 <= (ap - aq).abs() {
            return ap / (ap - aq);
        }
        let exactly = |c: Vec3| area([a, b, c].map(|p| [p[self.x], p[self.y]]));
        let (ap, aq) = (exactly(p), exactly(q));
        ap / (ap - aq)
    }

    /// Twice the signed area, and a bound on its error: differences, products and their difference make 4 ε of the products' size.
    fn area(self, a: Vec3, b: Vec3, c: Vec3) -> (f64, f64) {
        let (ab, ac) = (b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3());
        let (left, right) = (ab[self.x] * ac[self.y], ab[self.y] * ac[self.x]);
        (left - right, BOUND * (left.abs() + right.abs()))
    }

    /// The projection in which a, b, c have an area, the best one by `normal` first; `None` for points on one line.
    pub(super) fn spreading(a: Vec3, b: Vec3, c: Vec3, normal: DVec3) -> Option<Self> {
        let size = normal.abs();
        let first = if size.x >= size.y && size.x >= size.z { 0 } else { 2 - usize::from(size.y >= size.z) };
        [first, (first + 1) % 3, (first + 2) % 3].map(|i| Self::ALL[i]).into_iter().find(|p| p.turn(a, b, c) != 0)
    }
}
