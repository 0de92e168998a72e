//! Normals and tangents at single vertices: computed where a ray hits, not at all vertices.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::{
    Pose,
    deform::{Placement, blended, placement},
    transform::scaled_to_one,
};
use crate::scene::{PartInstance, Scene};

/// Unit world-space normal of one vertex at this pose; `None` when the part has no normals or the result
/// vanishes.
///
/// The morphed normal times the inverse transpose of the vertex' matrix, so that it stays perpendicular to the
/// surface under shear and points to the same side under a negative scale.
pub fn vertex_normal(scene: &Scene, pose: &Pose, instance: PartInstance, vertex: u32) -> Option<Vec3> {
    let part = scene.part(instance);
    let v = vertex as usize;
    let mut normal = part.normals.get(v)?.as_dvec3();
    for (target, &weight) in part.targets.iter().zip(pose.weights(instance.node)) {
        if let Some(shift) = target.normals.get(v) {
            normal += shift.as_dvec3() * weight;
        }
    }
    let (cofactors, side) = cofactors(&vertex_matrix(scene, pose, instance, v).matrix3);
    unit(cofactors * normal * side)
}

/// Unit world-space tangent of one vertex at this pose and the bitangent's sign; `None` without tangents, or
/// when the tangent vanishes.
///
/// The bitangent is `cross(normal, tangent) * sign`; a mirroring matrix turns the sign.
pub fn vertex_tangent(scene: &Scene, pose: &Pose, instance: PartInstance, vertex: u32) -> Option<(Vec3, f32)> {
    let part = scene.part(instance);
    let v = vertex as usize;
    let stored = part.tangents.get(v)?;
    let mut tangent = stored.truncate().as_dvec3();
    for (target, &weight) in part.targets.iter().zip(pose.weights(instance.node)) {
        if let Some(shift) = target.tangents.get(v) {
            tangent += shift.as_dvec3() * weight;
        }
    }
    let (matrix, _) = scaled_to_one(&vertex_matrix(scene, pose, instance, v).matrix3);
    let side = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let sign = if stored.w < 0.0 { -1.0 } else { 1.0 };
    Some((unit(matrix * tangent)?, sign * side))
}

/// The matrix that takes one vertex from (morphed) mesh space to the world, up to a positive factor when
/// skinned.
fn vertex_matrix(scene: &Scene, pose: &Pose, instance: PartInstance, vertex: usize) -> DAffine3 {
    let (influences, palette) = match placement(scene, pose, instance) {
        Placement::Whole(matrix) => return matrix,
        Placement::Skinned { influences, palette, .. } => (influences, palette),
    };
    let range = vertex * influences.per_vertex..(vertex + 1) * influences.per_vertex;
    let (columns, sum) = blended(&influences.joints[range.clone()], &influences.weights[range], palette);
    let side = if sum < 0.0 { -1.0 } else { 1.0 };
    let column = |c: &[f64; 4]| DVec3::new(c[0], c[1], c[2]) * side;
    let [x, y, z, t] = &columns;
    DAffine3 { matrix3: DMat3::from_cols(column(x), column(y), column(z)), translation: column(t) }
}

/// The cofactor matrix (determinant times inverse transpose) of `m` up to a positive factor, and the sign of
/// the determinant, 1 when it is zero.
fn cofactors(m: &DMat3) -> (DMat3, f64) {
    let (m, _) = scaled_to_one(m);
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let side = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    (DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)), side)
}

/// `v` at unit length; `None` for zero, NaN and infinite vectors.
fn unit(v: DVec3) -> Option<Vec3> {
    let largest = v.abs().max_element();
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let v = v / largest;
    Some((v / v.length()).as_vec3())
}
