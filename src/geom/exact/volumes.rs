use std::cmp::Ordering;

use glam::Vec3;

use super::{
    estimate::Estimate,
    int::{Int, cmp_scaled, quotient_f32},
};

/// `value = mantissa * 2^exponent`; the exponent of 0 is the largest.
#[derive(Clone, Copy)]
pub(super) struct Scaled {
    pub(super) mantissa: i32,
    pub(super) exponent: i32,
}

impl Scaled {
    pub(super) fn new(value: f32) -> Self {
        let bits = value.to_bits();
        let biased = ((bits >> 23) & 0xff).cast_signed();
        let fraction = (bits & 0x007f_ffff).cast_signed();
        let (mantissa, exponent) = if biased == 0 { (fraction, -149) } else { (fraction | 0x0080_0000, biased - 150) };
        if mantissa == 0 {
            return Self { mantissa: 0, exponent: i32::MAX };
        }
        let zeros = mantissa.trailing_zeros();
        let mantissa = mantissa >> zeros;
        Self {
            mantissa: if value.is_sign_negative() { -mantissa } else { mantissa },
            exponent: exponent + zeros.cast_signed(),
        }
    }

    /// `value / 2^exponent`, an integer.
    pub(super) fn to_int(self, exponent: i32) -> Int {
        if self.mantissa == 0 {
            Int::ZERO
        } else {
            Int::from_scaled(self.mantissa, (self.exponent - exponent).unsigned_abs())
        }
    }
}

/// The least exponent among `points`' coordinates; 0 when all are 0.
pub(super) fn least_exponent(points: &[Vec3]) -> i32 {
    let least = points.iter().flat_map(Vec3::to_array).map(|c| Scaled::new(c).exponent).min();
    least.filter(|&e| e != i32::MAX).unwrap_or(0)
}

pub(super) type Int3 = [Int; 3];

pub(super) fn to_ints(point: Vec3, exponent: i32) -> Int3 {
    point.to_array().map(|c| Scaled::new(c).to_int(exponent))
}

pub(super) fn sub(a: &Int3, b: &Int3) -> Int3 {
    [a[0].sub(&b[0]), a[1].sub(&b[1]), a[2].sub(&b[2])]
}

pub(super) fn cross(a: &Int3, b: &Int3) -> Int3 {
    let minor = |i: usize, j: usize| a[i].mul(&b[j]).sub(&a[j].mul(&b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

pub(super) fn dot(a: &Int3, b: &Int3) -> Int {
    a[0].mul(&b[0]).add(&a[1].mul(&b[1])).add(&a[2].mul(&b[2]))
}

/// As [`super::side`], by integers alone.
#[cold]
#[inline(never)]
pub(super) fn side_of_plane(corners: &[Vec3; 3], point: Vec3) -> i32 {
    let points = [corners[0], corners[1], corners[2], point];
    if !points.iter().all(|p| p.is_finite()) {
        return 0;
    }
    let exponent = least_exponent(&points);
    let [a, b, c, p] = points.map(|p| to_ints(p, exponent));
    dot(&cross(&sub(&b, &a), &sub(&c, &a)), &sub(&p, &a)).signum()
}

/// As [`super::slope`], by integers alone.
#[cold]
#[inline(never)]
pub(super) fn slope_to_plane(corners: &[Vec3; 3], dir: Vec3) -> i32 {
    if !(dir.is_finite() && corners.iter().all(|p| p.is_finite())) {
        return 0;
    }
    let exponent = least_exponent(corners);
    let [a, b, c] = corners.map(|p| to_ints(p, exponent));
    let dir = to_ints(dir, least_exponent(&[dir]));
    dot(&cross(&sub(&b, &a), &sub(&c, &a)), &dir).signum()
}

/// The four volumes as integers, D made positive.
///
/// With p the exponent of positions and q that of the direction: D, U and V are in units of 2^(2p+q), T in 2^(3p).
pub(super) struct Volumes {
    det: Int,
    u: Int,
    v: Int,
    t: Int,
    position_exponent: i32,
    dir_exponent: i32,
}

impl Volumes {
    /// `None` when a coordinate is not finite or D is 0.
    pub(super) fn new(origin: Vec3, dir: Vec3, corners: &[Vec3; 3]) -> Option<Self> {
        let points = [origin, corners[0], corners[1], corners[2]];
        if !(dir.is_finite() && points.iter().all(|p| p.is_finite())) {
            return None;
        }
        let position_exponent = least_exponent(&points);
        let dir_exponent = least_exponent(&[dir]);
        let [o, a, b, c] = points.map(|p| to_ints(p, position_exponent));
        let d = to_ints(dir, dir_exponent);
        let (e1, e2, s) = (sub(&b, &a), sub(&c, &a), sub(&o, &a));
        let (p, q) = (cross(&d, &e2), cross(&s, &e1));
        let det = dot(&e1, &p);
        let sign = det.signum();
        (sign != 0).then(|| Self {
            det: det.times_sign(sign),
            u: dot(&s, &p).times_sign(sign),
            v: dot(&d, &q).times_sign(sign),
            t: dot(&e2, &q).times_sign(sign),
            position_exponent,
            dir_exponent,
        })
    }

    /// True when the line of the ray meets the closed triangle.
    pub(super) fn meets(&self) -> bool {
        self.u.signum() >= 0 && self.v.signum() >= 0 && self.det.sub(&self.u).sub(&self.v).signum() >= 0
    }

    /// Compares exact t with a finite number.
    pub(super) fn cmp_t_to(&self, limit: f32) -> Ordering {
        let limit = Scaled::new(limit);
        let right = self.det.mul(&Int::from_scaled(limit.mantissa, 0));
        let right_exponent = if limit.mantissa == 0 { 0 } else { limit.exponent };
        cmp_scaled(&self.t, self.position_exponent - self.dir_exponent, &right, right_exponent)
    }

    /// Compares exact t of two triangles met by the same ray.
    pub(super) fn cmp_t(&self, other: &Self) -> Ordering {
        let (a, b) = (self.t.mul(&other.det), other.t.mul(&self.det));
        cmp_scaled(&a, self.position_exponent, &b, other.position_exponent)
    }

    pub(super) fn t_f32(&self) -> f32 {
        quotient_f32(&self.t, &self.det, self.position_exponent - self.dir_exponent)
    }

    pub(super) fn u_f32(&self) -> f32 {
        quotient_f32(&self.u, &self.det, 0)
    }

    pub(super) fn v_f32(&self) -> f32 {
        quotient_f32(&self.v, &self.det, 0)
    }

    /// The volumes rounded to f64, with bounds.
    pub(super) fn estimate(&self) -> Estimate {
        let unit = 2 * self.position_exponent + self.dir_exponent;
        let (det, t) = (self.det.to_f64(unit), self.t.to_f64(3 * self.position_exponent));
        let (u, v) = (self.u.to_f64(unit), self.v.to_f64(unit));
        let error = |x: f64| x.abs() * f64::EPSILON;
        Estimate { det, u, v, t, det_error: error(det), uv_error: error(u).max(error(v)), t_error: error(t) }
    }
}
