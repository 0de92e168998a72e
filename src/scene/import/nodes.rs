//! Nodes with their transforms and references, and the part instances they draw.

use glam::{DMat4, DQuat, DVec3};

use super::{
    super::{CameraId, LightId, LocalTransform, MeshId, NodeId, PartInstance, SceneNode, Skin, SkinId, Trs},
    context::{Context, check_index},
    error::{Problem, Step},
    graph, instancing, json,
    meshes::{ImportedMesh, morph_weights},
};

/// Bytes that a node takes in all of the scene's arrays.
const NODE_BYTES: usize = size_of::<SceneNode>() + 64;

/// All nodes of the file.
pub(super) fn import(cx: &Context<'_>, meshes: &[ImportedMesh], skins: &[Skin]) -> Step<Vec<SceneNode>> {
    cx.budget.take(cx.doc.nodes.len(), NODE_BYTES, "nodes")?;
    let parents = graph::parents(cx)?;
    let node = |(i, source): (usize, &json::Node)| import_node(cx, i, source, parents[i], meshes, skins);
    cx.doc.nodes.iter().enumerate().map(node).collect()
}

fn import_node(
    cx: &Context<'_>,
    index: usize,
    source: &json::Node,
    parent: Option<NodeId>,
    meshes: &[ImportedMesh],
    skins: &[Skin],
) -> Step<SceneNode> {
    let place = format!("nodes[{index}]");
    let reference = |value: Option<json::Idx>, count: usize, kind: &str| -> Step<Option<u32>> {
        let Some(value) = value else { return Ok(None) };
        let place = format!("{place}.{}", if kind == "light" { "extensions.KHR_lights_punctual.light" } else { kind });
        check_index(value.index(), count, place, kind)?;
        Ok(Some(value.0))
    };
    let mesh = reference(source.mesh, meshes.len(), "mesh")?.map(MeshId);
    let skin = reference(source.skin, skins.len(), "skin")?.map(SkinId);
    let camera = reference(source.camera, cx.doc.cameras.len(), "camera")?.map(CameraId);
    let light = reference(source.light(), cx.doc.lights().len(), "light")?.map(LightId);
    if let (Some(mesh), Some(skin)) = (mesh, skin) {
        check_joints(&meshes[mesh.index()], mesh, &skins[skin.index()], skin, &place)?;
    }
    let weights = match mesh {
        Some(mesh) => {
            let targets = meshes[mesh.index()].mesh.weights.len();
            morph_weights(cx, source.weights.as_deref(), targets, &place)?
        }
        None => None,
    };
    let copies = source.instancing().map(|i| instancing::import(cx, i, &place)).transpose()?;
    Ok(SceneNode {
        name: source.name.as_deref().unwrap_or_default().to_owned(),
        parent,
        children: source.children.iter().flatten().map(|c| NodeId(c.0)).collect(),
        local: local(cx, source, &place),
        mesh,
        skin: skin.filter(|_| mesh.is_some()),
        camera,
        light,
        weights,
        copies: copies.filter(|_| mesh.is_some()),
    })
}

/// Every joint number of the mesh must exist in the skin.
fn check_joints(mesh: &ImportedMesh, mesh_id: MeshId, skin: &Skin, skin_id: SkinId, place: &str) -> Step<()> {
    for (part, joint) in mesh.max_joint.iter().enumerate() {
        if let Some(joint) = joint.filter(|&j| usize::from(j) >= skin.joints.len()) {
            let reason = format!(
                "meshes[{}].primitives[{part}] uses joint {joint}, but skins[{}] has {} joints",
                mesh_id.0,
                skin_id.0,
                skin.joints.len()
            );
            return Err(Problem::at(format_args!("{place}.skin"), reason));
        }
    }
    Ok(())
}

fn local(cx: &Context<'_>, source: &json::Node, place: &str) -> LocalTransform {
    let trs = Trs {
        translation: source.translation.as_deref().map_or(DVec3::ZERO, |&t| DVec3::from_array(t)),
        rotation: source.rotation.as_deref().map_or(DQuat::IDENTITY, |&r| DQuat::from_array(r)),
        scale: source.scale.as_deref().map_or(DVec3::ONE, |&s| DVec3::from_array(s)),
    };
    let has_trs = source.translation.is_some() || source.rotation.is_some() || source.scale.is_some();
    let Some(matrix) = &source.matrix else {
        if (trs.rotation.length_squared() - 1.0).abs() > 0.01 {
            cx.warnings.add(format_args!("{place}.rotation"), "is no unit quaternion; it is normalised");
        }
        return LocalTransform::Trs(trs);
    };
    if has_trs {
        cx.warnings.add(place, "has a matrix beside translation, rotation or scale; the matrix counts");
    }
    let mut matrix = DMat4::from_cols_array(matrix);
    if matrix.row(3) != glam::DVec4::W {
        cx.warnings.add(format_args!("{place}.matrix"), "last row is not 0 0 0 1; taken as if it were");
        matrix.x_axis.w = 0.0;
        matrix.y_axis.w = 0.0;
        matrix.z_axis.w = 0.0;
        matrix.w_axis.w = 1.0;
    }
    LocalTransform::Matrix(matrix)
}

/// Part instances in pose order: node, then copy, then part.
pub(super) fn instances(
    cx: &Context<'_>,
    nodes: &[SceneNode],
    order: &[NodeId],
    meshes: &[ImportedMesh],
) -> Step<Vec<PartInstance>> {
    let drawn = || order.iter().filter_map(|&id| nodes[id.index()].mesh.map(|mesh| (id, mesh)));
    let parts = |mesh: MeshId| u32::try_from(meshes[mesh.index()].mesh.parts.len()).unwrap_or(u32::MAX);
    for (id, mesh) in drawn() {
        let copies = nodes[id.index()].copies.as_ref().map_or(1, Vec::len);
        let bytes = copies.saturating_mul(size_of::<PartInstance>());
        cx.budget.take(parts(mesh) as usize, bytes, format_args!("nodes[{}]", id.0))?;
    }
    let mut instances = Vec::new();
    for (node, mesh) in drawn() {
        let copies = nodes[node.index()].copies.as_ref();
        let copies: Box<dyn Iterator<Item = Option<u32>>> = match copies {
            Some(copies) => Box::new((0..u32::try_from(copies.len()).unwrap_or(u32::MAX)).map(Some)),
            None => Box::new(std::iter::once(None)),
        };
        for copy in copies {
            instances.extend((0..parts(mesh)).map(|part| PartInstance { node, mesh, part, copy }));
        }
    }
    Ok(instances)
}
