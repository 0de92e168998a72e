//! Rays against triangles and triangles against triangles in integers, by other formulas than the library's.
#![allow(dead_code, reason = "each user takes its share")]

use std::cmp::Ordering;

use kinora::{
    geom::{Hit, InstanceId, PrimId, Ray},
    glam::Vec3,
};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, Zero};

use crate::trace::{Mesh, round};

pub(crate) type Z3 = [BigInt; 3];

/// A finite number times 2^149: an integer.
fn integer(value: f32) -> BigInt {
    let bits = value.to_bits();
    let (exponent, fraction) = ((bits >> 23) & 0xff, bits & 0x7f_ffff);
    let magnitude = match exponent {
        0 => BigInt::from(fraction),
        _ => BigInt::from(fraction | 0x80_0000) << (exponent - 1),
    };
    if value.is_sign_negative() { -magnitude } else { magnitude }
}

pub(crate) fn z3(v: Vec3) -> Z3 {
    v.to_array().map(integer)
}

pub(crate) fn sub(a: &Z3, b: &Z3) -> Z3 {
    std::array::from_fn(|i| &a[i] - &b[i])
}

fn add(a: &Z3, b: &Z3) -> Z3 {
    std::array::from_fn(|i| &a[i] + &b[i])
}

fn times(a: &Z3, factor: &BigInt) -> Z3 {
    std::array::from_fn(|i| &a[i] * factor)
}

pub(crate) fn cross(a: &Z3, b: &Z3) -> Z3 {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

pub(crate) fn dot(a: &Z3, b: &Z3) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn is_zero(a: &Z3) -> bool {
    a.iter().all(Zero::is_zero)
}

/// Where a ray meets a triangle's plane inside the triangle: t, u, v as fractions of a positive denominator.
struct Meeting {
    t: BigInt,
    slope: BigInt,
    u: BigInt,
    v: BigInt,
    area_slope: BigInt,
}

fn meeting(ray: &Ray, corners: &[Vec3; 3]) -> Option<Meeting> {
    let finite = ray.origin.is_finite() && ray.dir.is_finite() && corners.iter().all(|c| c.is_finite());
    if !finite || ray.t_near.is_nan() || ray.t_far.is_nan() {
        return None;
    }
    let [a, b, c] = corners.map(z3);
    let (o, d) = (z3(ray.origin), z3(ray.dir));
    let mut normal = cross(&sub(&b, &a), &sub(&c, &a));
    let area = dot(&normal, &normal);
    if dot(&normal, &d).is_negative() {
        normal = normal.map(|x| -x);
    }
    let slope = dot(&normal, &d);
    if slope.is_zero() {
        return None;
    }
    let t = dot(&normal, &sub(&a, &o));
    // The point times the slope.
    let point = add(&times(&o, &slope), &times(&d, &t));
    let facing = dot(&cross(&sub(&b, &a), &sub(&c, &a)), &normal).signum();
    let weight =
        |from: &Z3, to: &Z3| dot(&cross(&sub(to, from), &sub(&point, &times(from, &slope))), &normal) * &facing;
    let (w, u, v) = (weight(&b, &c), weight(&c, &a), weight(&a, &b));
    if w.is_negative() || u.is_negative() || v.is_negative() {
        return None;
    }
    // t >= near and t <= far, times the slope and 2^149.
    let scaled = &t << 149;
    let inside = scaled >= integer(ray.t_near.max(0.0)) * &slope && scaled <= integer(ray.t_far.min(f32::MAX)) * &slope;
    let area_slope = &area * &slope;
    inside.then_some(Meeting { t, slope, u, v, area_slope })
}

fn rounded(numerator: &BigInt, denominator: &BigInt) -> f32 {
    round(&BigRational::new(numerator.clone(), denominator.clone()))
}

/// Closest hit over a whole mesh: least t, then least number.
pub(crate) fn closest_by_integers(ray: &Ray, mesh: &Mesh) -> Option<Hit> {
    let mut best: Option<(usize, Meeting)> = None;
    for prim in 0..mesh.indices.len() {
        if let Some(found) = meeting(ray, &mesh.corners(prim))
            && best.as_ref().is_none_or(|(_, b)| (&found.t * &b.slope).cmp(&(&b.t * &found.slope)) == Ordering::Less)
        {
            best = Some((prim, found));
        }
    }
    best.map(|(prim, m)| Hit {
        t: rounded(&m.t, &m.slope),
        u: rounded(&m.u, &m.area_slope),
        v: rounded(&m.v, &m.area_slope),
        prim: PrimId(u32::try_from(prim).expect("a small mesh")),
        instance: InstanceId(0),
    })
}

/// Whether two closed triangles share a point; a triangle with a corner that is not finite shares none.
///
/// They do when 0 lies in the hull of the nine differences of corners (Minkowski). It does not when some d has `d . p > 0` for every
/// difference p. The d with `d . p >= 0` form a cone; the sum of its edges lies inside, if it has an inside at all, and its edges are
/// among the cross products of two differences (for differences in one plane: of that plane's normal and a difference; on one
/// line: the differences themselves).
pub(crate) fn triangles_meet(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    if !a.iter().chain(b).all(|c| c.is_finite()) {
        return false;
    }
    let (a, b) = (a.map(z3), b.map(z3));
    let points: Vec<Z3> = a.iter().flat_map(|p| b.iter().map(move |q| sub(p, q))).collect();
    if points.iter().any(is_zero) {
        return true;
    }
    let mut crosses = Vec::new();
    for i in 0..points.len() {
        crosses.extend((0..i).map(|j| cross(&points[i], &points[j])).filter(|c| !is_zero(c)));
    }
    let edges = match crosses.first() {
        None => points.clone(),
        Some(normal) if points.iter().all(|p| dot(normal, p).is_zero()) => {
            points.iter().map(|p| cross(normal, p)).collect()
        }
        Some(_) => crosses,
    };
    let mut inside = [BigInt::ZERO, BigInt::ZERO, BigInt::ZERO];
    for edge in edges {
        for edge in [edge.clone().map(|x| -x), edge] {
            if points.iter().all(|p| !dot(&edge, p).is_negative()) {
                inside = add(&inside, &edge);
            }
        }
    }
    !points.iter().all(|p| dot(&inside, p).is_positive())
}
