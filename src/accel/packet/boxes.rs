//! Rays of a packet against single boxes.

use super::{ALL, PACKET};
use crate::{
    accel::{
        TravRay,
        query::{GROW, ORDINARY_MAX, SHRINK, SLACK},
    },
    geom::Aabb,
    simd::{Lanes, Simd},
};

/// The rays of a packet against single boxes, whatever the signs of their directions.
#[derive(Debug)]
pub(crate) struct PacketBoxes {
    origin: [[f32; PACKET]; 3],
    inv: [[f32; PACKET]; 3],
    t_near: [f32; PACKET],
    /// Rays whose misses the f32 test proves: ordinary ones that are parallel to no plane of a box.
    tested: u32,
}

impl PacketBoxes {
    #[inline(always)]
    pub(crate) fn new<S: Simd>(rays: &[TravRay; PACKET]) -> Self {
        let row = [0.0; PACKET];
        let mut out = Self { origin: [row; 3], inv: [row; 3], t_near: row, tested: 0 };
        let mut dir = [row; 3];
        for (i, ray) in rays.iter().enumerate() {
            let range = ray.range();
            for (axis, dir) in dir.iter_mut().enumerate() {
                out.origin[axis][i] = range.origin[axis];
                dir[i] = range.dir[axis];
            }
            out.t_near[i] = range.t_near;
            let slanted = range.dir.x != 0.0 && range.dir.y != 0.0 && range.dir.z != 0.0;
            out.tested |= u32::from(slanted && ray.is_ordinary()) << i;
        }
        for (inv, dir) in out.inv.iter_mut().zip(&dir) {
            for first in (0..PACKET).step_by(S::F::LEN) {
                (S::F::splat(1.0) / S::F::load(&dir[first..])).store(&mut inv[first..]);
            }
        }
        out
    }

    /// The rays that may meet `aabb` at `limits` or before.
    ///
    /// The bounds of [`SHRINK`] and [`GROW`] hold for a factor applied last as for one applied to the reciprocal, and
    /// rounding keeps order, so the lesser product is the entry's.
    #[inline(always)]
    pub(crate) fn meeting<S: Simd>(&self, aabb: &Aabb, limits: &[f32; PACKET]) -> u32 {
        if aabb.is_empty() {
            return 0;
        }
        let reach = aabb.min.abs().max(aabb.max.abs()).max_element();
        if reach.is_nan() || reach > ORDINARY_MAX {
            return ALL;
        }
        let mut mask = ALL & !self.tested;
        for first in (0..PACKET).step_by(S::F::LEN) {
            let (mut near, mut far) = (S::F::load(&self.t_near[first..]), S::F::load(&limits[first..]));
            for axis in 0..3 {
                let (origin, inv) = (S::F::load(&self.origin[axis][first..]), S::F::load(&self.inv[axis][first..]));
                let low = (S::F::splat(aabb.min[axis]) - origin) * inv;
                let high = (S::F::splat(aabb.max[axis]) - origin) * inv;
                near = (low.min(high) * S::F::splat(SHRINK)).max(near);
                far = (low.max(high) * S::F::splat(GROW)).min(far);
            }
            mask |= (near - far).le(S::F::splat(SLACK)) << first;
        }
        mask
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        geom::Ray,
        simd::{SimdLevel, Task, dispatch},
    };

    struct Meeting<'a> {
        rays: &'a [TravRay; PACKET],
        aabb: Aabb,
    }

    impl Task for Meeting<'_> {
        type Output = u32;

        #[inline(always)]
        fn run<S: Simd>(self) -> u32 {
            let limits = std::array::from_fn(|i| self.rays[i].range().t_far);
            PacketBoxes::new::<S>(self.rays).meeting::<S>(&self.aabb, &limits)
        }
    }

    fn meeting(level: SimdLevel, rays: &[Ray; PACKET], aabb: Aabb) -> u32 {
        let rays = std::array::from_fn(|i| TravRay::new(&rays[i]).unwrap());
        dispatch(level, Meeting { rays: &rays, aabb })
    }

    #[test]
    fn rays_that_pass_a_box_by_are_left_out() {
        let towards = |i: usize| Ray::new(Vec3::new(0.3, 0.4, 5.0), Vec3::new(i as f32 * 0.05 - 0.01, 0.01, -1.0));
        let short = |i: usize| Ray { t_far: 3.9, ..towards(i) };
        let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        for level in SimdLevel::available() {
            assert_eq!(meeting(level, &std::array::from_fn(towards), unit), 0b1111, "{level}");
            assert_eq!(meeting(level, &std::array::from_fn(short), unit), 0, "{level}");
            assert_eq!(meeting(level, &std::array::from_fn(towards), Aabb::EMPTY), 0, "{level}");
        }
    }

    #[test]
    fn rays_that_the_test_cannot_judge_are_kept() {
        let far = Aabb { min: Vec3::splat(9.0), max: Vec3::splat(10.0) };
        let odd = |i: usize| {
            let dir = [Vec3::X, Vec3::new(1e-30, 1.0, 1.0), Vec3::NEG_Y, Vec3::new(1.0, 1e30, 1.0)][i % 4];
            Ray::new(Vec3::ZERO, dir)
        };
        let huge = Aabb { min: Vec3::splat(1e30), max: Vec3::splat(2e30) };
        for level in SimdLevel::available() {
            assert_eq!(meeting(level, &std::array::from_fn(odd), far), 0xffff, "{level}");
            let plain = |_| Ray::new(Vec3::ZERO, -Vec3::ONE);
            assert_eq!(meeting(level, &std::array::from_fn(plain), huge), 0xffff, "{level}");
        }
    }

    proptest! {
        /// The point is exact, and the ray enters along x where it leaves along y: no slack but the test's own.
        #[test]
        fn a_box_that_a_ray_touches_in_one_point_is_met(
            origin in prop::array::uniform3(-100_i8..100),
            dir in prop::array::uniform3(prop_oneof![-100_i8..0, 1_i8..101]),
            t in 1_u8..64,
            sizes in prop::array::uniform3(1_u8..100),
        ) {
            let (origin, dir) = (Vec3::from(origin.map(f32::from)), Vec3::from(dir.map(f32::from)));
            let touched = origin + dir * f32::from(t);
            let size = Vec3::from(sizes.map(f32::from)) * dir.signum() * Vec3::new(1.0, -1.0, 1.0);
            let aabb = Aabb::from_points([touched, touched + size]);
            let ray = Ray { t_far: f32::from(t), ..Ray::new(origin, dir) };
            for level in SimdLevel::available() {
                prop_assert_eq!(meeting(level, &[ray; PACKET], aabb), 0xffff, "{}", level);
            }
        }

        #[test]
        fn a_box_around_a_point_of_a_ray_is_met(
            origin in prop::array::uniform3(-1e3_f32..1e3),
            dir in prop::array::uniform3(prop_oneof![Just(0.0_f32), -1e3_f32..1e3, -1e-6_f32..1e-6]),
            t in 0_u8..64,
            grow in prop::array::uniform3(0.0_f32..1.0),
        ) {
            let t = f32::from(t) * 0.25;
            let ray = Ray { t_far: t, ..Ray::new(Vec3::from(origin), Vec3::from(dir)) };
            prop_assume!(ray.dir != Vec3::ZERO);
            // t is a multiple of a quarter, so the point is off by one rounding of the sum.
            let near = (ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t)).as_vec3();
            let aabb = Aabb {
                min: Vec3::new(near.x.next_down(), near.y.next_down(), near.z.next_down()),
                max: Vec3::new(near.x.next_up(), near.y.next_up(), near.z.next_up()) + Vec3::from(grow),
            };
            for level in SimdLevel::available() {
                prop_assert_eq!(meeting(level, &[ray; PACKET], aabb), 0xffff, "{}", level);
            }
        }
    }
}
