//! Local transforms as `f64` matrices that stay finite.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::quat;
use crate::scene::{LocalTransform, Trs};

/// Largest magnitude of a matrix entry in a pose.
///
/// Products of two such entries and sums of a few of them stay finite, so a chain of scales that runs out of
/// range saturates instead of ending in NaN.
const LIMIT: f64 = 1e150;

/// `m` with every entry brought into the range of a pose; NaN stays NaN.
pub(super) fn saturated(m: &DAffine3) -> DAffine3 {
    let clamp = |v: DVec3| DVec3::new(v.x.clamp(-LIMIT, LIMIT), v.y.clamp(-LIMIT, LIMIT), v.z.clamp(-LIMIT, LIMIT));
    DAffine3 {
        matrix3: DMat3::from_cols(clamp(m.matrix3.x_axis), clamp(m.matrix3.y_axis), clamp(m.matrix3.z_axis)),
        translation: clamp(m.translation),
    }
}

/// `a * b`, saturated.
pub(super) fn product(a: &DAffine3, b: &DAffine3) -> DAffine3 {
    saturated(&(*a * *b))
}

/// The matrix of a translation, rotation and scale; the rotation is normalised first.
pub(super) fn from_trs(trs: &Trs) -> DAffine3 {
    saturated(&DAffine3::from_scale_rotation_translation(trs.scale, quat::normalized(trs.rotation), trs.translation))
}

/// The upper three rows of a matrix whose last row is (0, 0, 0, 1).
pub(super) fn from_matrix(m: &DMat4) -> DAffine3 {
    saturated(&DAffine3 {
        matrix3: DMat3::from_cols(m.x_axis.truncate(), m.y_axis.truncate(), m.z_axis.truncate()),
        translation: m.w_axis.truncate(),
    })
}

/// The matrix of a node's rest placement.
pub(super) fn local_matrix(local: &LocalTransform) -> DAffine3 {
    match local {
        LocalTransform::Trs(trs) => from_trs(trs),
        LocalTransform::Matrix(m) => from_matrix(m),
    }
}

/// `m` divided by its largest entry, so that products of entries neither overflow nor vanish, and that entry's
/// magnitude. A zero matrix stays.
pub(super) fn scaled_to_one(m: &DMat3) -> (DMat3, f64) {
    let largest = m.x_axis.abs().max(m.y_axis.abs()).max(m.z_axis.abs()).max_element();
    if largest > 0.0 { (*m * (1.0 / largest), largest) } else { (*m, 0.0) }
}
