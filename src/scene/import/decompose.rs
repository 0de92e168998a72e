//! A matrix as translation, rotation and scale, where it is one.

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use super::super::Trs;

/// The parts of a matrix; `None` when it shears or flattens. A reflection becomes a negative x scale.
pub(super) fn decompose(matrix: &DMat4) -> Option<Trs> {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec4::truncate);
    let mut scale = DVec3::new(x.length(), y.length(), z.length());
    if !(scale.is_finite() && scale.min_element() > 0.0) {
        return None;
    }
    let [x, y, z] = [x / scale.x, y / scale.y, z / scale.z];
    let shear = x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs());
    if shear.is_nan() || shear > 1e-4 {
        return None;
    }
    let sign = if x.cross(y).dot(z) < 0.0 { -1.0 } else { 1.0 };
    scale.x *= sign;
    let rotation = DQuat::from_mat3(&DMat3::from_cols(x * sign, y, z));
    Some(Trs { translation: matrix.w_axis.truncate(), rotation, scale })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_reflecting_matrix_rebuild_it() {
        let rotation = DQuat::from_xyzw(0.1, 0.2, 0.3, 0.9).normalize();
        let scale = DVec3::new(-2.0, 0.5, 3.0);
        let matrix = DMat4::from_scale_rotation_translation(scale, rotation, DVec3::new(1.0, 2.0, 3.0));
        let trs = decompose(&matrix).expect("no shear");
        let again = DMat4::from_scale_rotation_translation(trs.scale, trs.rotation, trs.translation);
        assert!(again.abs_diff_eq(matrix, 1e-12), "{again} {matrix}");
    }

    #[test]
    fn sheared_and_flat_matrices_have_no_parts() {
        let mut shear = DMat4::IDENTITY;
        shear.y_axis.x = 0.5;
        assert!(decompose(&shear).is_none());
        assert!(decompose(&DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
    }
}
