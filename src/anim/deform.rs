use glam::Vec3;

use super::Pose;
use crate::scene::{PartInstance, Scene};

/// Writes the world-space vertices of one part instance: morph, then skin or place, in `f64`, rounded once.
///
/// `out` has the part's vertex count; POSITION accessor order. No allocation.
pub fn deform(_scene: &Scene, _pose: &Pose, _instance: PartInstance, _out: &mut [Vec3]) {}

/// Unit world-space normal of one vertex at this pose; `None` when the part has no normals or the result
/// vanishes.
pub fn vertex_normal(_scene: &Scene, _pose: &Pose, _instance: PartInstance, _vertex: u32) -> Option<Vec3> {
    None
}

/// Unit world-space tangent of one vertex at this pose and the bitangent's sign; `None` without tangents.
pub fn vertex_tangent(_scene: &Scene, _pose: &Pose, _instance: PartInstance, _vertex: u32) -> Option<(Vec3, f32)> {
    None
}
