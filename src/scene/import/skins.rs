//! Skins: joints and inverse bind matrices.

use glam::{DMat4, DVec4, Mat4};

use super::{
    super::{NodeId, Skin},
    context::{Context, check_index},
    error::{Problem, Step},
    json,
};

/// All skins.
pub(super) fn import(cx: &Context<'_>) -> Step<Vec<Skin>> {
    cx.doc.skins.iter().enumerate().map(|(i, skin)| import_skin(cx, i, skin)).collect()
}

fn import_skin(cx: &Context<'_>, index: usize, source: &json::Skin) -> Step<Skin> {
    let place = format!("skins[{index}]");
    for (i, joint) in source.joints.iter().enumerate() {
        check_index(joint.index(), cx.doc.nodes.len(), format_args!("{place}.joints[{i}]"), "node")?;
    }
    if let Some(skeleton) = source.skeleton {
        check_index(skeleton.index(), cx.doc.nodes.len(), format_args!("{place}.skeleton"), "node")?;
    }
    if source.joints.is_empty() {
        return Err(Problem::at(format_args!("{place}.joints"), "is empty; a skin needs a joint"));
    }
    cx.budget.take(source.joints.len(), size_of::<DMat4>() + 4, &place)?;
    let inverse_bind = match source.inverse_bind_matrices {
        Some(accessor) => inverse_bind(cx, accessor.index(), source.joints.len(), &place)?,
        None => vec![DMat4::IDENTITY; source.joints.len()],
    };
    Ok(Skin {
        name: source.name.as_deref().unwrap_or_default().to_owned(),
        joints: source.joints.iter().map(|j| NodeId(j.0)).collect(),
        inverse_bind,
    })
}

fn inverse_bind(cx: &Context<'_>, accessor: usize, joints: usize, place: &str) -> Step<Vec<DMat4>> {
    let place = format!("{place}.inverseBindMatrices");
    let count = cx.accessor(accessor, &place)?.count.get();
    if count < joints {
        return Err(Problem::at(place, format!("{count} matrices for {joints} joints")));
    }
    let mut bent = None;
    let mut matrices = Vec::with_capacity(joints);
    for (i, columns) in cx.vectors::<16>(accessor, &place)?.into_iter().take(joints).enumerate() {
        let mut matrix = Mat4::from_cols_array(&columns).as_dmat4();
        if !matrix.is_finite() {
            return Err(Problem::at(place, format!("matrix {i} is not finite")));
        }
        if matrix.row(3) != DVec4::W {
            bent = bent.or(Some(i));
            matrix.x_axis.w = 0.0;
            matrix.y_axis.w = 0.0;
            matrix.z_axis.w = 0.0;
            matrix.w_axis.w = 1.0;
        }
        matrices.push(matrix);
    }
    if let Some(i) = bent {
        cx.warnings.add(place, format_args!("last row of matrix {i} is not 0 0 0 1; taken as if it were"));
    }
    Ok(matrices)
}
