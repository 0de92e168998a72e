use glam::{DVec3, Vec3};

/// `16 * 2^-53`, the factor of every error bound on volumes in f64.
///
/// With ε = 2^-53, a difference of two f32 rounded to f64 has a relative error of at most ε (it cannot underflow).
/// A term of D is then off by at most 7 ε of its size: three differences or exact factors, two products, one
/// difference, two sums; a term of T by 8 ε. The sum of the terms' sizes is at most `|d|∞ |e1|₁ |e2|₁` for D, since
/// a product of a component of e1 and one of e2 meets only one component of d; likewise `|d|∞ |s|₁ |e2|₁` for U,
/// `|d|∞ |s|₁ |e1|₁` for V and `|e1|₁ |e2|₁ |s|₁` for T. The rest of the factor 16 covers the rounding of the norms and
/// of the bounds themselves, `W = D - U - V` (2 ε more) and the comparison `T - limit * D` (2 ε more). Contracting a
/// product into a sum only removes roundings. Products of three f32 and their bounds stay within 2^-447 and 2^393,
/// so f64 neither overflows nor loses precision by underflow.
pub const BOUND: f64 = 16.0 * (f64::EPSILON / 2.0);

/// The four volumes in f64, each within its error of the exact value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    /// `D`.
    pub(super) det: f64,
    /// `U`.
    pub(super) u: f64,
    /// `V`.
    pub(super) v: f64,
    /// `T`.
    pub(super) t: f64,
    /// Bound on the error of `det`.
    pub(super) det_error: f64,
    /// Bound on the errors of `u`, `v` and `det - u - v`.
    pub(super) uv_error: f64,
    /// Bound on the error of `t`.
    pub(super) t_error: f64,
}

/// What an estimate says about a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The line surely passes the triangle by, or the triangle surely has no area.
    Miss,
    /// The line surely meets the triangle's inside, and D is known to a few bits at least.
    Meets,
    /// Only exact arithmetic can tell.
    Doubt,
}

impl Estimate {
    pub(super) fn new(origin: Vec3, dir: Vec3, corners: &[Vec3; 3]) -> Self {
        let [v0, v1, v2] = corners.map(Vec3::as_dvec3);
        let d = dir.as_dvec3();
        let (e1, e2, s) = (v1 - v0, v2 - v0, origin.as_dvec3() - v0);
        let (p, q) = (cross(d, e2), cross(s, e1));
        let (n1, n2, ns) = (norm1(e1), norm1(e2), norm1(s));
        let reach = BOUND * d.abs().max_element();
        Self {
            det: dot(e1, p),
            u: dot(s, p),
            v: dot(d, q),
            t: dot(e2, q),
            det_error: reach * (n1 * n2),
            uv_error: reach * (n1 * n2 + ns * (n1 + n2)),
            t_error: BOUND * (n1 * n2) * ns,
        }
    }

    pub(super) fn verdict(&self) -> Verdict {
        let (u, v, w) = (self.u, self.v, self.det - self.u - self.v);
        let e = self.uv_error;
        let above = [u > e, v > e, w > e];
        let below = [u < -e, v < -e, w < -e];
        if self.det_error == 0.0 || (above.contains(&true) && below.contains(&true)) {
            Verdict::Miss
        } else if (above == [true; 3] || below == [true; 3]) && self.det.abs() >= 4.0 * self.det_error {
            Verdict::Meets
        } else {
            Verdict::Doubt
        }
    }

    /// Bounds on t; needs `|det| >= 4 det_error`. See [`Quotients`].
    #[inline(always)]
    pub(super) fn t_bounds(&self) -> (f64, f64) {
        let (t, error) = self.quotients().bounded(self.t, self.t_error);
        (t - error, t + error)
    }

    /// What u and v can be had from later.
    #[inline(always)]
    pub(super) fn quotients(&self) -> Quotients {
        let Self { det, u, v, det_error, uv_error, .. } = *self;
        Quotients { inv_det: 1.0 / det, u, v, det_error, uv_error }
    }
}

/// Volumes of a triangle with `|det| >= 4 det_error`, ready to be divided.
///
/// Writing N, D for exact volumes and n, d for estimates, `|N/D - n/d| <= (|n - N| + |n/d| |d - D|) / |D|` and
/// `|D| >= 3/4 |d|`. A bound of `2 (error + |q| det_error) |1/d| + 4 * 2^-52 |q|` with `q = n * (1/d)` has the factor 2 in
/// place of 4/3 and the last term to cover the roundings of q, of the bound, and of the sum of both.
#[derive(Clone, Copy, Debug)]
pub struct Quotients {
    /// `1 / D`.
    pub inv_det: f64,
    /// `U`.
    pub u: f64,
    /// `V`.
    pub v: f64,
    /// Bound on the error of `D`.
    pub det_error: f64,
    /// Bound on the errors of `U` and `V`.
    pub uv_error: f64,
}

impl Quotients {
    /// A volume over D, and a bound on its error.
    #[inline(always)]
    fn bounded(&self, volume: f64, error: f64) -> (f64, f64) {
        let q = volume * self.inv_det;
        (q, 2.0 * (error + q.abs() * self.det_error) * self.inv_det.abs() + 4.0 * f64::EPSILON * q.abs())
    }

    /// u and v, each with a bound on its error.
    #[inline(always)]
    pub(super) fn barycentric(&self) -> [(f64, f64); 2] {
        [self.bounded(self.u, self.uv_error), self.bounded(self.v, self.uv_error)]
    }
}

fn norm1(a: DVec3) -> f64 {
    a.x.abs() + a.y.abs() + a.z.abs()
}

fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

fn dot(a: DVec3, b: DVec3) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z
}
