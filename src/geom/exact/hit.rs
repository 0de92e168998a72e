use std::cmp::Ordering;

use glam::Vec3;

use super::{
    estimate::{Estimate, Quotients, Verdict},
    fine,
    volumes::Volumes,
};

/// A ray's line and the finite closed range of `t` that counts.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayRange {
    /// Start point, finite.
    pub origin: Vec3,
    /// Least parameter, finite and not negative.
    pub t_near: f32,
    /// Direction, finite and not zero.
    pub dir: Vec3,
    /// Greatest parameter, finite.
    pub t_far: f32,
}

/// A triangle that a ray surely hits, with t, u and v known as closely as has been needed so far.
#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    /// The corners it was tested with.
    pub corners: [Vec3; 3],
    /// At most the exact t.
    pub t_low: f64,
    /// At least the exact t.
    pub t_high: f64,
    /// Where u and v come from.
    pub quotients: Quotients,
}

impl TriangleHit {
    /// Decides whether `ray` hits the closed triangle within its range. Corners that are not finite are never hit.
    pub fn test(ray: &RayRange, corners: [Vec3; 3]) -> Option<Self> {
        let estimate = Estimate::new(ray.origin, ray.dir, &corners);
        match estimate.verdict() {
            Verdict::Miss => None,
            Verdict::Meets => {
                let hit = Self::from_estimate(corners, estimate);
                let (near, far) = (f64::from(ray.t_near), f64::from(ray.t_far));
                if hit.t_high < near || hit.t_low > far {
                    None
                } else if hit.t_low >= near && hit.t_high <= far {
                    Some(hit)
                } else {
                    Self::exactly(ray, corners)
                }
            }
            Verdict::Doubt => Self::exactly(ray, corners),
        }
    }

    /// As [`TriangleHit::test`], by integers alone.
    #[cold]
    #[inline(never)]
    pub fn exactly(ray: &RayRange, corners: [Vec3; 3]) -> Option<Self> {
        let volumes = Volumes::new(ray.origin, ray.dir, &corners)?;
        let inside = volumes.meets()
            && volumes.cmp_t_to(ray.t_near) != Ordering::Less
            && volumes.cmp_t_to(ray.t_far) != Ordering::Greater;
        inside.then(|| Self::from_estimate(corners, volumes.estimate()))
    }

    #[inline(always)]
    fn from_estimate(corners: [Vec3; 3], estimate: Estimate) -> Self {
        let (t_low, t_high) = estimate.t_bounds();
        Self { corners, t_low, t_high, quotients: estimate.quotients() }
    }

    /// Compares the exact t of two hits of the same ray.
    pub fn cmp_t(&self, other: &Self, ray: &RayRange) -> Ordering {
        if self.t_high < other.t_low {
            Ordering::Less
        } else if self.t_low > other.t_high {
            Ordering::Greater
        } else if self.corners == other.corners {
            Ordering::Equal
        } else {
            match (self.volumes(ray), other.volumes(ray)) {
                (Some(a), Some(b)) => a.cmp_t(&b),
                _ => Ordering::Equal,
            }
        }
    }

    fn volumes(&self, ray: &RayRange) -> Option<Volumes> {
        Volumes::new(ray.origin, ray.dir, &self.corners)
    }

    /// The exact t, u, v, each rounded to the nearest f32.
    #[inline(always)]
    pub fn tuv(&self, ray: &RayRange) -> [f32; 3] {
        let [(u, u_error), (v, v_error)] = self.quotients.barycentric();
        let t = agreed(self.t_low, self.t_high);
        let (u, v) = (agreed(u - u_error, u + u_error), agreed(v - v_error, v + v_error));
        if let (Some(t), Some(u), Some(v)) = (t, u, v) {
            return [t, u, v];
        }
        // A copy, so that the hit itself can stay in registers.
        let copy = *self;
        copy.tuv_exactly(ray)
    }

    #[cold]
    #[inline(never)]
    fn tuv_exactly(&self, ray: &RayRange) -> [f32; 3] {
        fine::tuv(ray, self.corners).unwrap_or_else(|| self.tuv_by_integers(ray))
    }

    #[cold]
    #[inline(never)]
    pub(super) fn tuv_by_integers(&self, ray: &RayRange) -> [f32; 3] {
        self.volumes(ray).map_or([0.0; 3], |x| [x.t_f32(), x.u_f32(), x.v_f32()])
    }
}

/// The f32 that both ends of an interval round to; 0 is +0.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::float_cmp, reason = "roundings are compared")]
fn agreed(low: f64, high: f64) -> Option<f32> {
    let (low, high) = (low as f32, high as f32);
    (low == high).then_some(low + 0.0)
}
