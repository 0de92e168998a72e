use super::{MeshId, NodeId};

/// A glTF animation.
#[derive(Clone, Debug, Default)]
pub struct Clip {
    /// Name, empty when the file has none.
    pub name: String,
    /// Channels whose target is honoured.
    pub channels: Vec<Channel>,
    /// Key data, shared between channels.
    pub samplers: Vec<Sampler>,
    /// Largest key time of all samplers in seconds; 0 without keys.
    pub duration_s: f64,
    /// Number of channels in the file, honoured or not.
    pub channel_count: usize,
    /// Why the clip was disabled, if it was; then it has no channels.
    pub disabled: Option<String>,
}

/// A sampler driving a target.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Index into the clip's samplers.
    pub sampler: u32,
    /// What it drives.
    pub target: ChannelTarget,
}

/// What a channel drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelTarget {
    /// A node's translation.
    Translation(NodeId),
    /// A node's rotation.
    Rotation(NodeId),
    /// A node's scale.
    Scale(NodeId),
    /// A node's morph weights.
    Weights(NodeId),
    /// The default morph weights of a mesh (`KHR_animation_pointer` `/meshes/M/weights`).
    MeshWeights(MeshId),
}

/// How values between keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Hold the key before.
    Step,
    /// Straight line; shorter-arc slerp for rotations.
    Linear,
    /// Hermite cubic with stored tangents; each key is in-tangent, value, out-tangent.
    CubicSpline,
}

/// Key times and values.
///
/// `times` is strictly increasing and finite with at least one key, `values` holds
/// `times.len() * width` numbers, three times that for [`Interpolation::CubicSpline`].
#[derive(Clone, Debug)]
pub struct Sampler {
    /// Interpolation between keys.
    pub interpolation: Interpolation,
    /// Key times in seconds.
    pub times: Vec<f32>,
    /// Numbers a value: 3, 4 or the number of morph weights.
    pub width: usize,
    /// Values, dequantised.
    pub values: Vec<f32>,
}
