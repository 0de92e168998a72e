//! Rays against structures, and the answers in rational arithmetic.
#![allow(dead_code, reason = "each test file uses its share")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

use kinora::{
    accel::{AnyAccel, PACKET},
    geom::{Forms, Hit, PrimId, Ray, Triangles},
    glam::Vec3,
    simd::SimdLevel,
};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, Zero};

/// Of a batch that fails.
const MODE: &str = "nothing changed the floating point mode";

/// An owned mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// Triangles without shared vertices.
    pub(crate) fn soup(corners: &[[Vec3; 3]]) -> Self {
        let positions = corners.iter().flatten().copied().collect();
        let indices = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Self { positions, indices }
    }

    pub(crate) fn prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.positions, indices: &self.indices, topology_epoch: 1 }
    }

    pub(crate) fn corners(&self, prim: usize) -> [Vec3; 3] {
        self.prims().corners(PrimId(prim as u32))
    }
}

/// The closest hit of every ray.
pub(crate) fn closest(accel: &AnyAccel, prims: &Triangles<'_>, rays: &[Ray], level: SimdLevel) -> Vec<Option<Hit>> {
    closest_as(accel, prims, rays, level, Forms::EXACT)
}

/// The closest hit of every ray, in these forms.
pub(crate) fn closest_as(
    accel: &AnyAccel,
    prims: &Triangles<'_>,
    rays: &[Ray],
    level: SimdLevel,
    forms: Forms,
) -> Vec<Option<Hit>> {
    let mut hits = vec![None; rays.len()];
    accel.closest_hits_as(prims, rays, 1, level, forms, &mut hits).expect(MODE);
    hits
}

/// Whether every ray is blocked.
pub(crate) fn occluded(accel: &AnyAccel, prims: &Triangles<'_>, rays: &[Ray], level: SimdLevel) -> Vec<bool> {
    let mut blocked = vec![false; rays.len()];
    accel.blocked(prims, rays, 1, level, &mut blocked).expect(MODE);
    blocked
}

/// Closest hits and occlusion of rays taken in packets of every length up to the longest.
pub(crate) fn in_packets(
    accel: &AnyAccel,
    prims: &Triangles<'_>,
    rays: &[Ray],
    level: SimdLevel,
) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    let (mut start, mut len) = (0, 2);
    while start < rays.len() {
        let end = rays.len().min(start + len);
        accel.closest_hits(prims, &rays[start..end], len, level, &mut hits[start..end]).expect(MODE);
        accel.blocked(prims, &rays[start..end], len, level, &mut blocked[start..end]).expect(MODE);
        start = end;
        len = if len == PACKET { 2 } else { len + 1 };
    }
    (hits, blocked)
}

/// A finite f32 as a rational.
pub(crate) fn rational(value: f32) -> BigRational {
    BigRational::from_float(value).expect("finite")
}

type Q3 = [BigRational; 3];

fn q3(v: Vec3) -> Q3 {
    v.to_array().map(rational)
}

fn sub(a: &Q3, b: &Q3) -> Q3 {
    std::array::from_fn(|i| &a[i] - &b[i])
}

fn cross(a: &Q3, b: &Q3) -> Q3 {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

fn dot(a: &Q3, b: &Q3) -> BigRational {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// Exact t, u, v where the ray hits the closed triangle; the plane equation and edge functions taken literally.
pub(crate) fn exact_hit(ray: &Ray, corners: &[Vec3; 3]) -> Option<[BigRational; 3]> {
    let finite = |v: Vec3| v.is_finite();
    let usable = finite(ray.origin) && finite(ray.dir) && corners.iter().all(|&c| finite(c));
    if !usable || ray.t_near.is_nan() || ray.t_far.is_nan() {
        return None;
    }
    let [a, b, c] = corners.map(q3);
    let (o, d) = (q3(ray.origin), q3(ray.dir));
    let normal = cross(&sub(&b, &a), &sub(&c, &a));
    let slope = dot(&normal, &d);
    if slope.is_zero() {
        return None;
    }
    let t = dot(&normal, &sub(&a, &o)) / slope;
    let point: Q3 = std::array::from_fn(|i| &o[i] + &t * &d[i]);
    let area = dot(&normal, &normal);
    let weight = |from: &Q3, to: &Q3| dot(&cross(&sub(to, from), &sub(&point, from)), &normal) / &area;
    let (w, u, v) = (weight(&b, &c), weight(&c, &a), weight(&a, &b));
    let near = rational(ray.t_near.max(0.0));
    let far = rational(ray.t_far.min(f32::MAX));
    let inside = !(w.is_negative() || u.is_negative() || v.is_negative());
    (inside && t >= near && t <= far).then_some([t, u, v])
}

/// A rational rounded to the nearest f32, ties to even.
pub(crate) fn round(value: &BigRational) -> f32 {
    if value.is_zero() {
        return 0.0;
    }
    // Start from a guess and walk to the nearest; midpoints are compared exactly.
    let guess = to_f64(value) as f32;
    let guess = if guess.is_finite() { guess } else { f32::MAX.copysign(guess) };
    let candidates = [guess.next_down(), guess, guess.next_up()];
    let distance = |f: f32| (rational(f) - value).abs();
    let finite = candidates.into_iter().filter(|f| f.is_finite());
    finite
        .min_by(|&a, &b| distance(a).cmp(&distance(b)).then((a.to_bits() & 1).cmp(&(b.to_bits() & 1))))
        .expect("one is finite")
        + 0.0
}

/// Close to the value, within a relative error of some 2^-50.
fn to_f64(value: &BigRational) -> f64 {
    let shift = value.denom().bits() as i64 - value.numer().bits() as i64 + 64;
    let scaled = if shift >= 0 { value.numer() << shift.unsigned_abs() } else { value.numer() >> shift.unsigned_abs() };
    let quotient: BigInt = scaled / value.denom();
    let (sign, digits) = quotient.to_u64_digits();
    let magnitude = digits.iter().rev().fold(0.0, |sum, &d| sum * 2.0_f64.powi(64) + d as f64);
    let magnitude = magnitude * 2.0_f64.powi(-shift as i32);
    if sign == num_bigint::Sign::Minus { -magnitude } else { magnitude }
}

/// Closest hit by rationals over a whole mesh: least t, then least number.
pub(crate) fn exact_closest(ray: &Ray, mesh: &Mesh) -> Option<Hit> {
    if ray.dir == Vec3::ZERO {
        return None;
    }
    let mut best: Option<(usize, [BigRational; 3])> = None;
    for prim in 0..mesh.indices.len() {
        if let Some(found) = exact_hit(ray, &mesh.corners(prim))
            && best.as_ref().is_none_or(|(_, b)| found[0] < b[0])
        {
            best = Some((prim, found));
        }
    }
    best.map(|(prim, [t, u, v])| Hit {
        t: round(&t),
        u: round(&u),
        v: round(&v),
        prim: PrimId(prim as u32),
        instance: kinora::geom::InstanceId(0),
    })
}

/// A small generator of reproducible numbers (Vigna's splitmix64).
#[derive(Clone, Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// In [-1, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 8_388_608.0 - 1.0
    }

    pub(crate) fn vec3(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}
