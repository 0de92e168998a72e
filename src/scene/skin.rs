use glam::DMat4;

use super::NodeId;

/// Joints and the matrices that take mesh space to each joint's space in the bind pose.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Name, empty when the file has none.
    pub name: String,
    /// Joint nodes; they may lie outside the default scene.
    pub joints: Vec<NodeId>,
    /// `joint_from_mesh`, one a joint (identity where the file has none).
    pub inverse_bind: Vec<DMat4>,
}
