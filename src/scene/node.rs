use glam::{DMat4, DQuat, DVec3};

use super::{CameraId, LightId, MeshId, NodeId, SkinId};

/// Translation, rotation and scale; applied right to left: scale, rotate, translate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Translation.
    pub translation: DVec3,
    /// Rotation as stored; normalised when a matrix is made of it.
    pub rotation: DQuat,
    /// Scale.
    pub scale: DVec3,
}

impl Trs {
    /// No change.
    pub const IDENTITY: Self = Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };
}

/// How a node is placed under its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalTransform {
    /// Animatable components.
    Trs(Trs),
    /// A matrix used as it stands (it may shear).
    Matrix(DMat4),
}

/// A glTF node.
#[derive(Clone, Debug)]
pub struct SceneNode {
    /// Name, empty when the file has none.
    pub name: String,
    /// Parent, `None` for a root.
    pub parent: Option<NodeId>,
    /// Children in file order.
    pub children: Vec<NodeId>,
    /// Placement in the rest pose.
    pub local: LocalTransform,
    /// Mesh drawn here.
    pub mesh: Option<MeshId>,
    /// Skin that deforms the mesh; the node's own transform then does not count for it.
    pub skin: Option<SkinId>,
    /// Camera here, looking along -Z.
    pub camera: Option<CameraId>,
    /// Light here, shining along -Z.
    pub light: Option<LightId>,
    /// Default morph weights of this node, before those of the mesh.
    pub weights: Option<Vec<f32>>,
    /// Copies of the mesh under `EXT_mesh_gpu_instancing`: `node_from_copy` transforms.
    pub copies: Option<Vec<Trs>>,
}
