use glam::{DVec3, Vec3};

use crate::{accel::TravRay, geom::Aabb};

/// Relative error allowed for the parameter of a plane: 2^-50.
const MARGIN: f64 = 1.0 / (1_u64 << 50) as f64;

/// A ray prepared for tests against the boxes of the top level, in `f64`.
///
/// Differences of `f32` and their quotients by an `f32` neither overflow nor underflow in `f64`, so three
/// roundings (reciprocal, difference, product) bound the relative error of every plane's parameter by
/// 4 * 2^-53, and its sign is exact. Moving entries down and exits up by 2^-50 makes a reported miss a real
/// one; since `t_near >= 0`, negative parameters decide by their sign alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabRay {
    origin: DVec3,
    inv: DVec3,
    t_near: f64,
}

impl SlabRay {
    /// Prepares `ray`.
    #[inline(always)]
    pub(crate) fn new(ray: &TravRay) -> Self {
        let range = ray.range();
        Self { origin: range.origin.as_dvec3(), inv: range.dir.as_dvec3().recip(), t_near: f64::from(range.t_near) }
    }

    /// A lower bound of the parameter at which the ray enters `aabb`; `None` when no point of the ray with a
    /// parameter in `[t_near, t_far]` lies in the box, as far as the test can prove. An empty box is missed.
    #[inline(always)]
    pub(crate) fn entry(&self, aabb: &Aabb, t_far: f64) -> Option<f64> {
        let (mut enter, mut exit) = (self.t_near, t_far);
        for axis in 0..3 {
            let (near, far) = self.planes(aabb.min, aabb.max, axis);
            // A plane through the origin of a ray along it gives 0 * inf = NaN, which loses both comparisons:
            // the plane then bounds nothing.
            let near = near * (1.0 - MARGIN);
            let far = far * (1.0 + MARGIN);
            enter = if near > enter { near } else { enter };
            exit = if far < exit { far } else { exit };
        }
        (enter <= exit && aabb.min.x <= aabb.max.x).then_some(enter)
    }

    #[inline(always)]
    fn planes(&self, min: Vec3, max: Vec3, axis: usize) -> (f64, f64) {
        let (min, max) = (f64::from(min[axis]), f64::from(max[axis]));
        let (origin, inv) = (self.origin[axis], self.inv[axis]);
        let (first, last) = if inv.is_sign_negative() { (max, min) } else { (min, max) };
        ((first - origin) * inv, (last - origin) * inv)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geom::Ray;

    fn slabs(ray: &Ray) -> SlabRay {
        SlabRay::new(&TravRay::new(ray).unwrap())
    }

    fn aabb(min: [f32; 3], max: [f32; 3]) -> Aabb {
        Aabb { min: Vec3::from(min), max: Vec3::from(max) }
    }

    #[test]
    fn a_ray_along_a_face_of_a_box_is_not_a_miss() {
        let unit = aabb([0.0; 3], [1.0; 3]);
        for zero in [0.0, -0.0] {
            for x in [0.0, 1.0] {
                let ray = Ray { t_near: 0.5, ..Ray::new(Vec3::new(x, 0.5, -1.0), Vec3::new(zero, zero, 1.0)) };
                assert!(slabs(&ray).entry(&unit, f64::INFINITY).is_some(), "x {x} zero {zero}");
            }
            for x in [-0.001, 1.001] {
                let ray = Ray::new(Vec3::new(x, 0.5, -1.0), Vec3::new(zero, zero, 1.0));
                assert!(slabs(&ray).entry(&unit, f64::INFINITY).is_none(), "x {x} zero {zero}");
            }
        }
    }

    #[test]
    fn an_empty_box_is_missed_and_an_infinite_one_is_hit() {
        let ray = slabs(&Ray::new(Vec3::ZERO, Vec3::new(1.0, 2.0, -0.0)));
        assert!(ray.entry(&Aabb::EMPTY, f64::INFINITY).is_none());
        assert!(ray.entry(&aabb([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]), 1.0).is_some());
    }

    proptest! {
        #[test]
        fn a_box_that_holds_a_point_of_the_ray_is_entered_no_later(
            origin in prop::array::uniform3(-1e3_f32..1e3),
            dir in prop::array::uniform3(prop_oneof![Just(0.0_f32), Just(-0.0), -1e3_f32..1e3, -1e-30_f32..1e-30]),
            t in 0_u8..64,
            grow in prop::array::uniform3(0.0_f32..1.0),
        ) {
            // t is a small power of two, so the point differs from the exact one by one rounding of the sum;
            // the box is the pair of floats around it.
            let t = f32::from(t) * 0.25;
            let ray = Ray::new(Vec3::from(origin), Vec3::from(dir));
            prop_assume!(ray.dir != Vec3::ZERO);
            let point = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t);
            let near = point.as_vec3();
            let around = Aabb {
                min: Vec3::new(near.x.next_down(), near.y.next_down(), near.z.next_down()),
                max: Vec3::new(near.x.next_up(), near.y.next_up(), near.z.next_up()) + Vec3::from(grow),
            };
            let entry = slabs(&ray).entry(&around, f64::from(t));
            prop_assert!(entry.is_some_and(|entry| entry <= f64::from(t)), "{entry:?}");
        }
    }
}
