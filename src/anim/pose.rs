use glam::DAffine3;

use crate::scene::{ClipId, NodeId, Scene, SkinId};

/// A clip playing at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveClip {
    /// The clip.
    pub clip: ClipId,
    /// Time on the clip's own clock in seconds; clamped to each sampler's keys.
    pub time_s: f64,
}

/// Where every node is and how every mesh is morphed at one moment. Reused from frame to frame.
#[derive(Clone, Debug)]
pub struct Pose {
    world_from_node: Vec<DAffine3>,
}

impl Pose {
    /// The rest pose of `scene`. Allocates all that later evaluations need.
    pub fn rest(scene: &Scene) -> Self {
        Self { world_from_node: vec![DAffine3::IDENTITY; scene.nodes.len()] }
    }

    /// Evaluates `clips` together over the rest pose; a later clip wins where two drive the same target.
    /// `world_from_scene` is applied above the roots. No allocation.
    pub fn evaluate(&mut self, _scene: &Scene, _clips: &[ActiveClip], _world_from_scene: &DAffine3) {}

    /// Global transform of a node.
    pub fn world_from_node(&self, node: NodeId) -> &DAffine3 {
        &self.world_from_node[node.index()]
    }

    /// Morph weights in force at a node with a mesh; empty without targets.
    pub fn weights(&self, _node: NodeId) -> &[f32] {
        &[]
    }

    /// `world_from_mesh` of each joint of a skin: joint global transform times inverse bind matrix.
    pub fn joint_matrices(&self, _skin: SkinId) -> &[DAffine3] {
        &[]
    }
}
