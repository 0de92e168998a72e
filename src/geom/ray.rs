use glam::Vec3;

/// The points `origin + t * dir` for `t` in the closed range `[t_near, t_far]`.
///
/// `dir` may have any length; `t_near >= 0`; `t_far` may be infinite. NaN anywhere, a zero direction or
/// `t_far < t_near` makes every query a miss.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Ray {
    /// Start point.
    pub origin: Vec3,
    /// Least parameter that counts.
    pub t_near: f32,
    /// Direction, of any nonzero length.
    pub dir: Vec3,
    /// Greatest parameter that counts.
    pub t_far: f32,
}

impl Ray {
    /// The ray from `origin` along `dir` without an end.
    pub fn new(origin: Vec3, dir: Vec3) -> Self {
        Self { origin, dir, t_near: 0.0, t_far: f32::INFINITY }
    }

    /// The point at parameter `t`, rounded.
    #[inline(always)]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.dir * t
    }
}
