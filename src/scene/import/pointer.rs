//! JSON pointers of `KHR_animation_pointer`.

use super::super::{ChannelTarget, MeshId, NodeId};

/// What a pointer drives; `None` for what is not played.
pub(super) fn parse(pointer: &str) -> Option<ChannelTarget> {
    let mut steps = pointer.strip_prefix('/')?.split('/');
    let (kind, index, member) = (steps.next()?, steps.next()?, steps.next()?);
    // Array indices of RFC 6901 have neither signs nor leading zeros.
    let is_index = index == "0" || (index.bytes().all(|b| b.is_ascii_digit()) && !index.starts_with('0'));
    if steps.next().is_some() || !is_index {
        return None;
    }
    let index = index.parse().ok()?;
    let node = NodeId(index);
    match (kind, member) {
        ("nodes", "translation") => Some(ChannelTarget::Translation(node)),
        ("nodes", "rotation") => Some(ChannelTarget::Rotation(node)),
        ("nodes", "scale") => Some(ChannelTarget::Scale(node)),
        ("nodes", "weights") => Some(ChannelTarget::Weights(node)),
        ("meshes", "weights") => Some(ChannelTarget::MeshWeights(MeshId(index))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_transforms_and_weights_are_played() {
        assert_eq!(parse("/nodes/3/translation"), Some(ChannelTarget::Translation(NodeId(3))));
        assert_eq!(parse("/meshes/0/weights"), Some(ChannelTarget::MeshWeights(MeshId(0))));
        let others = [
            "",
            "/",
            "nodes/3/scale",
            "/nodes/3",
            "/nodes/x/scale",
            "/nodes/03/scale",
            "/nodes/+3/scale",
            "/nodes/3/scale/0",
            "/materials/0/alphaCutoff",
            "/nodes/99999999999/scale",
            "/meshes/0/translation",
        ];
        for other in others {
            assert_eq!(parse(other), None, "{other}");
        }
    }
}
