//! Brute force in integers of any size.
//!
//! Coordinates are integers times a power of two, so every volume is an integer and t, u, v are quotients of integers. With the normal
//! `n = (b - a) x (c - a)`, t is `n . (a - o) / n . d`, and the point `o + t d` is inside when no edge has it on the outer side.

use std::cmp::Ordering;

use num_bigint::BigInt;
use num_traits::{Float, Signed, ToPrimitive, Zero};

use super::truth::{Accepted, Truth};
use crate::{
    geom::{PrimId, Ray, Triangles},
    glam::Vec3,
};

/// A quotient of two integers times a power of two; the divisor is positive.
#[derive(Clone, Debug)]
pub struct Fraction {
    over: BigInt,
    under: BigInt,
}

impl Fraction {
    /// `over / under * 2^exponent`; `under` must not be 0.
    fn new(over: BigInt, under: BigInt, exponent: i64) -> Self {
        let (mut over, mut under) = if under.is_negative() { (-over, -under) } else { (over, under) };
        if exponent >= 0 {
            over <<= exponent;
        } else {
            under <<= -exponent;
        }
        Self { over, under }
    }

    /// A finite f32.
    fn of(value: f32) -> Self {
        let (mantissa, exponent) = parts(value);
        Self::new(mantissa.into(), BigInt::from(1), exponent)
    }

    /// The nearest f32, ties to even; 0 is +0. The value must be within the range of f32.
    #[expect(clippy::cast_possible_truncation, reason = "a first guess, corrected below")]
    pub fn rounded(&self) -> f32 {
        if self.over.is_zero() {
            return 0.0;
        }
        let guess = (self.to_f64() as f32).clamp(f32::MIN, f32::MAX);
        // In units of 2^-150, in which every f32 is whole; times the divisor.
        let value: BigInt = &self.over << 150;
        let distance = |f: f32| {
            let (mantissa, exponent) = parts(f);
            let whole: BigInt = BigInt::from(mantissa) << (exponent + 150);
            (whole * &self.under - &value).abs()
        };
        let near = [guess.next_down(), guess, guess.next_up()].into_iter().filter(|f| f.is_finite());
        let by_distance =
            |a: &f32, b: &f32| distance(*a).cmp(&distance(*b)).then_with(|| (a.to_bits() & 1).cmp(&(b.to_bits() & 1)));
        near.min_by(by_distance).unwrap_or(guess) + 0.0
    }

    /// The value within a relative error of 2^-50; 0 or infinite beyond the range of f64.
    #[expect(clippy::cast_possible_wrap, reason = "numbers of bits")]
    pub fn to_f64(&self) -> f64 {
        let shift = self.under.bits() as i64 - self.over.bits() as i64 + 64;
        let scaled = if shift >= 0 { &self.over << shift } else { &self.over >> -shift };
        let quotient = (scaled / &self.under).to_f64().unwrap_or(f64::NAN);
        libm::scalbn(quotient, i32::try_from(-shift).unwrap_or(i32::MIN))
    }
}

impl PartialEq for Fraction {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Fraction {}

impl PartialOrd for Fraction {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Fraction {
    fn cmp(&self, other: &Self) -> Ordering {
        (&self.over * &other.under).cmp(&(&other.over * &self.under))
    }
}

/// Where a ray meets a triangle, exactly.
#[derive(Clone, Debug)]
pub struct Meeting {
    /// The ray's parameter.
    pub t: Fraction,
    /// The weight of the second corner.
    pub u: Fraction,
    /// The weight of the third corner.
    pub v: Fraction,
}

/// Where `ray` meets the closed triangle within its range; `None` when it does not, or the triangle has no area.
pub fn meeting(ray: &Ray, corners: &[Vec3; 3]) -> Option<Meeting> {
    let (near, far) = range(ray)?;
    if !corners.iter().all(|c| c.is_finite()) {
        return None;
    }
    let place = least_exponent(corners.iter().chain([&ray.origin]));
    let along = least_exponent([&ray.dir]);
    let [a, b, c] = corners.map(|p| integers(p, place));
    let (o, d) = (integers(ray.origin, place), integers(ray.dir, along));
    let normal = cross(&sub(&b, &a), &sub(&c, &a));
    let slope = dot(&normal, &d);
    if slope.is_zero() {
        return None;
    }
    let height = dot(&normal, &sub(&a, &o));
    let t = Fraction::new(height.clone(), slope.clone(), place - along);
    if t < Fraction::of(near) || t > Fraction::of(far) {
        return None;
    }
    // The point of the plane times the slope, relative to a corner.
    let from =
        |corner: &Integers| -> Integers { std::array::from_fn(|i| (&o[i] - &corner[i]) * &slope + &height * &d[i]) };
    let weight = |start: &Integers, end: &Integers| dot(&cross(&sub(end, start), &from(start)), &normal);
    let [w, u, v] = [weight(&b, &c), weight(&c, &a), weight(&a, &b)];
    let outside = |x: &BigInt| if slope.is_negative() { x.is_positive() } else { x.is_negative() };
    if [&w, &u, &v].into_iter().any(outside) {
        return None;
    }
    let area = dot(&normal, &normal) * &slope;
    Some(Meeting { t, u: Fraction::new(u, area.clone(), 0), v: Fraction::new(v, area, 0) })
}

/// What `ray` meets first, by testing every triangle. Corners that are not finite are never met.
///
/// # Panics
/// When a triangle names a vertex that does not exist.
pub fn closest(ray: &Ray, prims: &Triangles<'_>) -> Option<Truth> {
    let numbers = 0..u32::try_from(prims.len()).unwrap_or(u32::MAX);
    let met = numbers.filter_map(|i| Some((PrimId(i), meeting(ray, &prims.corners(PrimId(i)))?)));
    first(met.collect())
}

/// True when `ray` meets any triangle, by testing every one.
///
/// # Panics
/// When a triangle names a vertex that does not exist.
pub fn blocked(ray: &Ray, prims: &Triangles<'_>) -> bool {
    let numbers = 0..u32::try_from(prims.len()).unwrap_or(u32::MAX);
    numbers.into_iter().any(|i| meeting(ray, &prims.corners(PrimId(i))).is_some())
}

/// The answer from all that was met, in ascending order.
pub(super) fn first(met: Vec<(PrimId, Meeting)>) -> Option<Truth> {
    let least = met.iter().map(|(_, m)| &m.t).min()?.clone();
    let accepted = met.into_iter().filter(|(_, m)| m.t == least).map(|(prim, m)| Accepted {
        prim,
        u: m.u.to_f64(),
        v: m.v.to_f64(),
        rounded: [m.u.rounded(), m.v.rounded()],
    });
    Some(Truth { t: least.to_f64(), t_rounded: least.rounded(), accepted: accepted.collect() })
}

/// The finite range of t that counts; `None` for a ray that meets nothing.
pub(super) fn range(ray: &Ray) -> Option<(f32, f32)> {
    let is_one = ray.origin.is_finite()
        && ray.dir.is_finite()
        && ray.dir != Vec3::ZERO
        && !ray.t_near.is_nan()
        && !ray.t_far.is_nan();
    let (near, far) = (ray.t_near.max(0.0), ray.t_far.min(f32::MAX));
    (is_one && near <= far).then_some((near, far))
}

type Integers = [BigInt; 3];

/// A finite number as `mantissa * 2^exponent`, the mantissa odd or 0.
fn parts(value: f32) -> (i32, i64) {
    let (mantissa, exponent, sign) = Float::integer_decode(value);
    let zeros = if mantissa == 0 { 0 } else { mantissa.trailing_zeros() };
    let mantissa = i32::try_from(mantissa >> zeros).unwrap_or(0) * i32::from(sign);
    (mantissa, i64::from(exponent) + i64::from(zeros))
}

/// The least exponent of any coordinate but 0.
fn least_exponent<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> i64 {
    let parts = points.into_iter().flat_map(Vec3::to_array).map(parts);
    parts.filter(|p| p.0 != 0).map(|p| p.1).min().unwrap_or(0)
}

/// The coordinates in units of `2^exponent`.
fn integers(point: Vec3, exponent: i64) -> Integers {
    point.to_array().map(|c| {
        let (mantissa, own) = parts(c);
        if mantissa == 0 { BigInt::zero() } else { BigInt::from(mantissa) << (own - exponent) }
    })
}

fn sub(a: &Integers, b: &Integers) -> Integers {
    std::array::from_fn(|i| &a[i] - &b[i])
}

fn cross(a: &Integers, b: &Integers) -> Integers {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

fn dot(a: &Integers, b: &Integers) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "answers are compared bit for bit")]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 3] = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(4.0, 0.0, 2.0), Vec3::new(0.0, 4.0, 2.0)];

    #[test]
    fn parts_make_up_their_number() {
        for value in [1.0, -0.5, 3.0, 1e-45, f32::MIN_POSITIVE, f32::MAX, -1e30, 0.1] {
            let (mantissa, exponent) = parts(value);
            assert_eq!(f64::from(mantissa) * libm::exp2(exponent as f64), f64::from(value));
            assert_eq!(Fraction::of(value).rounded(), value);
        }
        assert_eq!(parts(0.0).0, 0);
    }

    #[test]
    fn roundings_go_to_even_at_midpoints_and_down_to_denormals() {
        let fraction = |over: i64, under: i64, e| Fraction::new(over.into(), under.into(), e);
        assert_eq!(fraction((1 << 25) + 1, 1, -25).rounded(), 1.0);
        assert_eq!(fraction((1 << 24) + 1, 1, -24).rounded(), 1.0);
        assert_eq!(fraction((1 << 24) + 3, 1, -24).rounded(), 1.0 + 2.0 * f32::EPSILON);
        assert_eq!(fraction(-1, 3, 0).rounded(), -1.0 / 3.0);
        assert_eq!(fraction(3, 1, -150).rounded(), f32::from_bits(2));
        assert_eq!(fraction(1, 1, -150).rounded().to_bits(), 0);
    }

    #[test]
    fn corners_and_edges_belong_to_a_triangle_and_nothing_beyond_them() {
        let at = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 0.0), Vec3::Z);
        for (x, y, u, v) in [(0.0, 0.0, 0.0, 0.0), (4.0, 0.0, 1.0, 0.0), (2.0, 2.0, 0.5, 0.5), (1.0, 1.0, 0.25, 0.25)] {
            for ray in [at(x, y), Ray { origin: Vec3::new(x, y, 4.0), ..Ray::new(Vec3::ZERO, -Vec3::Z) }] {
                let m = meeting(&ray, &CORNERS).unwrap();
                assert_eq!([m.t.rounded(), m.u.rounded(), m.v.rounded()], [2.0, u, v]);
            }
        }
        for (x, y) in [(-1e-45, 0.0), (0.0, -1e-45), (2.0_f32.next_up(), 2.0), (4.0, 1e-45)] {
            assert!(meeting(&at(x, y), &CORNERS).is_none(), "{x} {y}");
        }
    }

    #[test]
    fn ranges_are_closed_and_malformed_rays_meet_nothing() {
        let ray = Ray { t_near: 2.0, t_far: 2.0, ..Ray::new(Vec3::new(1.0, 1.0, 0.0), Vec3::Z) };
        assert!(meeting(&ray, &CORNERS).is_some());
        for bad in [
            Ray { t_near: 2.0_f32.next_up(), t_far: 9.0, ..ray },
            Ray { t_near: 0.0, t_far: 2.0_f32.next_down(), ..ray },
            Ray { t_near: f32::NAN, ..ray },
            Ray { t_far: f32::NAN, ..ray },
            Ray { dir: Vec3::ZERO, ..ray },
            Ray { dir: Vec3::NAN, ..ray },
            Ray { origin: Vec3::INFINITY, ..ray },
        ] {
            assert!(meeting(&bad, &CORNERS).is_none(), "{bad:?}");
        }
    }

    #[test]
    fn all_triangles_at_the_least_t_are_accepted() {
        let positions = [CORNERS[0], CORNERS[1], CORNERS[2], Vec3::new(4.0, 4.0, 2.0), Vec3::new(0.0, 0.0, 3.0)];
        let indices = [[4, 1, 2], [1, 3, 2], [0, 1, 2], [0, 0, 1]];
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 1 };
        let truth = closest(&Ray::new(Vec3::new(2.0, 2.0, 0.0), Vec3::Z), &prims).unwrap();
        assert_eq!(truth.accepted.iter().map(|a| a.prim.0).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!((truth.t, truth.t_rounded), (2.0, 2.0));
        let inside = closest(&Ray::new(Vec3::new(1.0, 1.0, 0.0), Vec3::Z), &prims).unwrap();
        assert_eq!(inside.accepted.iter().map(|a| a.prim.0).collect::<Vec<_>>(), [2]);
        assert!(!blocked(&Ray::new(Vec3::new(1.0, 1.0, 4.0), Vec3::Z), &prims));
    }
}
