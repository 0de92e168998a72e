//! Camera rays of one picture, and the part of the picture that a box can cover.

use glam::{DAffine3, DVec3, Vec3};

use super::{
    CameraView,
    camera::corners,
    wide::{Floats, V3},
};
#[cfg(test)]
use crate::geom::Ray;
use crate::{geom::Aabb, scene::Projection};

/// Makes the ray through any point of the picture. A ray's `t` is the distance along the view axis.
///
/// Origin and direction are affine in the picture's coordinates, so their change from pixel to pixel, which
/// texture footprints need, is constant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayMaker {
    origin: [Vec3; 3],
    dir: [Vec3; 3],
    t_near: f32,
    t_far: f32,
    camera_from_world: DAffine3,
    /// Half extents at distance 1 (perspective) or at any distance (orthographic).
    half: [f64; 2],
    perspective: bool,
    size: [u32; 2],
}

impl RayMaker {
    /// Rays of `camera` for a picture of `width` x `height` pixels.
    ///
    /// A file's own aspect ratio is a promise of what is seen: a picture of another shape shows more, not less.
    pub(crate) fn new(camera: &CameraView, width: u32, height: u32) -> Self {
        let size = [width.max(1), height.max(1)];
        let (half, [near, far], perspective) = lens(&camera.projection, f64::from(size[0]) / f64::from(size[1]));
        let m = &camera.world_from_camera;
        let per_pixel = [2.0 * half[0] / f64::from(size[0]), -2.0 * half[1] / f64::from(size[1])];
        let steps = [m.matrix3.x_axis * per_pixel[0], m.matrix3.y_axis * per_pixel[1]].map(DVec3::as_vec3);
        let corner = m.matrix3 * DVec3::new(-half[0], half[1], if perspective { -1.0 } else { 0.0 });
        let ahead = -m.matrix3.z_axis;
        let (origin, dir) = if perspective {
            ([m.translation.as_vec3(), Vec3::ZERO, Vec3::ZERO], [corner.as_vec3(), steps[0], steps[1]])
        } else {
            ([(m.translation + corner).as_vec3(), steps[0], steps[1]], [ahead.as_vec3(), Vec3::ZERO, Vec3::ZERO])
        };
        let camera_from_world = m.inverse();
        Self { origin, dir, t_near: near, t_far: far, camera_from_world, half, perspective, size }
    }

    /// The ray through picture point (`x`, `y`), in pixels from the upper left corner.
    #[cfg(test)]
    pub(crate) fn ray(&self, x: f32, y: f32) -> Ray {
        Ray {
            origin: self.origin[0] + self.origin[1] * x + self.origin[2] * y,
            dir: self.dir[0] + self.dir[1] * x + self.dir[2] * y,
            t_near: self.t_near,
            t_far: self.t_far,
        }
    }

    /// Origins and directions of the rays through the picture points (`x`, `y`), in pixels from the upper left corner.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn lines<F: Floats>(&self, x: F, y: F) -> [V3<F>; 2] {
        let [o, right, down] = self.origin;
        let origin = V3::splat(o) + V3::splat(right) * x + V3::splat(down) * y;
        let [d, right, down] = self.dir;
        [origin, V3::splat(d) + V3::splat(right) * x + V3::splat(down) * y]
    }

    /// The range of `t` of every ray.
    #[inline(always)]
    pub(crate) fn range(&self) -> [f32; 2] {
        [self.t_near, self.t_far]
    }

    /// How far the point at parameter `t` moves for one pixel to the right and one down, the plane's tilt
    /// not yet counted.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn pixel_steps<F: Floats>(&self, t: F) -> [V3<F>; 2] {
        [V3::splat(self.origin[1]) + V3::splat(self.dir[1]) * t, V3::splat(self.origin[2]) + V3::splat(self.dir[2]) * t]
    }

    /// The pixels that `bounds` can cover, as `[x0, y0, x1, y1)`; everything when part of it lies behind the camera.
    pub(crate) fn pixel_rect(&self, bounds: Aabb) -> [u32; 4] {
        let [w, h] = self.size;
        if bounds.is_empty() {
            return [0; 4];
        }
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in corners(bounds) {
            let p = self.camera_from_world.transform_point3(corner.as_dvec3());
            let depth = if self.perspective { -p.z } else { 1.0 };
            if !p.is_finite() || depth <= 1e-6 * p.length() {
                return [0, 0, w, h];
            }
            let at = [p.x / (depth * self.half[0]), -p.y / (depth * self.half[1])];
            for axis in 0..2 {
                let pixel = (at[axis] * 0.5 + 0.5) * f64::from(self.size[axis]);
                low[axis] = low[axis].min(pixel);
                high[axis] = high[axis].max(pixel);
            }
        }
        // One pixel of margin covers the rounding of rays.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the picture")]
        let pixel = |x: f64, axis: usize| x.clamp(0.0, f64::from(self.size[axis])) as u32;
        [
            pixel((low[0] - 1.0).floor(), 0),
            pixel((low[1] - 1.0).floor(), 1),
            pixel((high[0] + 1.0).ceil(), 0),
            pixel((high[1] + 1.0).ceil(), 1),
        ]
    }

    /// Distances along the view axis of the nearest and farthest corner of `bounds`.
    pub(crate) fn depth_range(&self, bounds: Aabb) -> [f32; 2] {
        let (mut near, mut far) = (f32::INFINITY, 0.0f32);
        if !bounds.is_empty() {
            for corner in corners(bounds) {
                let p = self.camera_from_world.transform_point3(corner.as_dvec3());
                #[expect(clippy::cast_possible_truncation, reason = "a rounded distance")]
                let depth = -p.z as f32;
                near = near.min(depth);
                far = far.max(depth);
            }
        }
        [near.max(0.0), far]
    }
}

/// Half extents, depth range and whether rays spread, for a picture of the given aspect.
fn lens(projection: &Projection, picture: f64) -> ([f64; 2], [f32; 2], bool) {
    let range = |near: f32, far: Option<f32>| {
        let near = if near > 0.0 && near.is_finite() { near } else { 0.0 };
        [near, far.filter(|&f| f > near).unwrap_or(f32::INFINITY)]
    };
    match *projection {
        Projection::Perspective { y_fov, aspect, z_near, z_far } => {
            let fov = if y_fov.is_finite() { f64::from(y_fov).clamp(1e-3, 3.1) } else { 0.7 };
            let mut y = libm::tan(fov * 0.5);
            if let Some(own) = aspect.map(f64::from).filter(|&a| a.is_finite() && a > picture) {
                y *= own / picture;
            }
            ([y * picture, y], range(z_near, z_far), true)
        }
        Projection::Orthographic { x_mag, y_mag, z_near, z_far } => {
            let positive = |m: f32| f64::from(m.abs()).clamp(1e-30, 1e30);
            let (x, y) = if x_mag.is_nan() || y_mag.is_nan() { (1.0, 1.0) } else { (positive(x_mag), positive(y_mag)) };
            let y = y.max(x / picture);
            ([y * picture, y], range(z_near, Some(z_far)), false)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(projection: Projection) -> CameraView {
        CameraView { projection, ..CameraView::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.7) }
    }

    #[test]
    fn the_centre_ray_looks_ahead_and_t_is_depth() {
        let maker = RayMaker::new(&CameraView::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.7), 64, 48);
        let ray = maker.ray(32.0, 24.0);
        assert!((ray.dir - Vec3::NEG_Z).length() < 1e-6);
        let corner = maker.ray(0.0, 0.0);
        assert!((corner.dir.z + 1.0).abs() < 1e-6 && corner.dir.x < 0.0 && corner.dir.y > 0.0);
    }

    #[test]
    fn a_narrow_picture_keeps_the_width_that_the_file_promises() {
        let lens = Projection::Perspective { y_fov: 0.7, aspect: Some(2.0), z_near: 0.1, z_far: Some(9.0) };
        let wide = RayMaker::new(&view(lens), 200, 100);
        let tall = RayMaker::new(&view(lens), 100, 100);
        assert!((wide.ray(0.0, 50.0).dir.x - tall.ray(0.0, 50.0).dir.x).abs() < 1e-5);
        assert_eq!((wide.ray(0.0, 0.0).t_near, wide.ray(0.0, 0.0).t_far), (0.1, 9.0));
    }

    #[test]
    fn orthographic_rays_are_parallel() {
        let lens = Projection::Orthographic { x_mag: 2.0, y_mag: 1.0, z_near: 0.0, z_far: 10.0 };
        let maker = RayMaker::new(&view(lens), 200, 100);
        let (a, b) = (maker.ray(0.0, 50.0), maker.ray(200.0, 50.0));
        assert_eq!(a.dir, b.dir);
        assert!((b.origin.x - a.origin.x - 4.0).abs() < 1e-5);
    }

    #[test]
    fn a_box_behind_the_camera_covers_everything_and_an_empty_one_nothing() {
        let maker = RayMaker::new(&CameraView::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 0.7), 64, 48);
        assert_eq!(maker.pixel_rect(Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE }), [0, 0, 64, 48]);
        assert_eq!(maker.pixel_rect(Aabb::EMPTY), [0; 4]);
        let ahead = maker.pixel_rect(Aabb { min: Vec3::new(-0.1, -0.1, -3.0), max: Vec3::new(0.1, 0.1, -2.0) });
        assert!(ahead[0] > 20 && ahead[2] < 44 && ahead[1] > 14 && ahead[3] < 34, "{ahead:?}");
    }

    #[test]
    fn invalid_lenses_still_make_rays() {
        for (y_fov, aspect) in [(f32::NAN, None), (0.0, Some(0.0)), (9.0, Some(f32::NAN))] {
            let lens = Projection::Perspective { y_fov, aspect, z_near: f32::NAN, z_far: Some(-1.0) };
            assert!(RayMaker::new(&view(lens), 8, 8).ray(1.0, 2.0).dir.is_finite());
        }
    }
}
