use serde::Deserialize;

use super::{Idx, List};

/// `animations[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Animation {
    pub(in super::super) name: Option<String>,
    pub(in super::super) channels: List<AnimationChannel>,
    pub(in super::super) samplers: List<AnimationSampler>,
}

/// `animations[].channels[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct AnimationChannel {
    pub(in super::super) sampler: Idx,
    pub(in super::super) target: AnimationTarget,
}

/// `animations[].channels[].target`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct AnimationTarget {
    pub(in super::super) node: Option<Idx>,
    pub(in super::super) path: String,
    extensions: Option<TargetExtensions>,
}

#[derive(Debug, Deserialize)]
struct TargetExtensions {
    #[serde(rename = "KHR_animation_pointer")]
    pointer: Option<Pointer>,
}

#[derive(Debug, Deserialize)]
struct Pointer {
    pointer: String,
}

impl AnimationTarget {
    /// The JSON pointer of `KHR_animation_pointer`.
    pub(in super::super) fn pointer(&self) -> Option<&str> {
        self.extensions.as_ref().and_then(|e| e.pointer.as_ref()).map(|p| p.pointer.as_str())
    }
}

/// `animations[].samplers[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct AnimationSampler {
    pub(in super::super) input: Idx,
    pub(in super::super) output: Idx,
    pub(in super::super) interpolation: Option<String>,
}
