use crate::scene::{Channel, ChannelTarget, Clip, Interpolation, LocalTransform, NodeId, PartInstance, Sampler, Scene};

use super::transform::{from_matrix, scaled_to_one};

/// How a part instance can move over all clips of its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MotionClass {
    /// Never moves in any clip.
    Static,
    /// Moves as a whole.
    Rigid,
    /// Vertices move against each other (skin or morph).
    Deforming,
}

/// Largest ratio of the greatest to the least stretch of a matrix that still counts as well conditioned.
const MAX_CONDITION: f64 = 1e4;

/// Largest factor by which a well-conditioned matrix may stretch, and the inverse of the least.
const MAX_STRETCH: f64 = 1e12;

/// The class of each of `scene.instances`, over every clip together.
///
/// Static parts have bit for bit the same vertices at every time of every clip (and all sets of clips), and in
/// the rest pose: no channel whose keys ever differ from the rest value drives them, their nodes, ancestors or
/// joints. A skinned part whose joints never move is static. A part that moves as a whole is `Deforming` when
/// its matrix may be singular or badly conditioned at some time.
///
/// Cost: O(nodes + keys + joints).
pub fn classify(scene: &Scene) -> Vec<MotionClass> {
    let drives = Drives::new(scene);
    let skin_moves: Vec<bool> = scene.skins.iter().map(|s| s.joints.iter().any(|j| drives.moves[j.index()])).collect();
    scene.instances.iter().map(|&instance| class(scene, &drives, &skin_moves, instance)).collect()
}

fn class(scene: &Scene, drives: &Drives, skin_moves: &[bool], instance: PartInstance) -> MotionClass {
    let n = instance.node.index();
    let node = &scene.nodes[n];
    let part = scene.part(instance);
    let morphs = part.targets.iter().any(|t| !t.positions.is_empty());
    if morphs && drives.morphs[n] {
        return MotionClass::Deforming;
    }
    if let (Some(skin), Some(_)) = (node.skin, &part.influences)
        && !scene.skins[skin.index()].joints.is_empty()
    {
        return if skin_moves[skin.index()] { MotionClass::Deforming } else { MotionClass::Static };
    }
    if !drives.moves[n] {
        return MotionClass::Static;
    }
    let copy = instance.copy.and_then(|c| node.copies.as_ref()?.get(c as usize));
    let stretch = copy.map_or(drives.stretch[n], |trs| drives.stretch[n].of_product(Stretch::of_scale(trs.scale)));
    if stretch.is_good() { MotionClass::Rigid } else { MotionClass::Deforming }
}

/// What the clips of a scene drive.
struct Drives {
    /// Nodes that move, themselves or with an ancestor.
    moves: Vec<bool>,
    /// Nodes whose morph weights change.
    morphs: Vec<bool>,
    /// Bounds over all times of how each node's global matrix stretches.
    stretch: Vec<Stretch>,
}

impl Drives {
    fn new(scene: &Scene) -> Self {
        let mut moves = vec![false; scene.nodes.len()];
        let mut morphs = vec![false; scene.nodes.len()];
        let mut local: Vec<Stretch> = scene.nodes.iter().map(|n| Stretch::of_local(&n.local)).collect();
        for clip in &scene.clips {
            for channel in &clip.channels {
                if !changes(scene, clip, channel) {
                    continue;
                }
                let sampler = &clip.samplers[channel.sampler as usize];
                match channel.target {
                    ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) => moves[node.index()] = true,
                    ChannelTarget::Scale(node) => {
                        moves[node.index()] = true;
                        local[node.index()] = local[node.index()].hull(Stretch::of_scale_keys(sampler));
                    }
                    ChannelTarget::Weights(node) => morphs[node.index()] = true,
                    ChannelTarget::MeshWeights(mesh) => {
                        for (n, node) in scene.nodes.iter().enumerate() {
                            morphs[n] |= node.mesh == Some(mesh) && node.weights.is_none();
                        }
                    }
                }
            }
        }
        let mut stretch = local;
        for &node in &scene.eval_order {
            let n = node.index();
            if let Some(parent) = scene.nodes[n].parent {
                moves[n] |= moves[parent.index()];
                stretch[n] = stretch[parent.index()].of_product(stretch[n]);
            }
        }
        Self { moves, morphs, stretch }
    }
}

/// True unless every key of the channel equals the rest value of its target, or it drives a matrix and so nothing.
fn changes(scene: &Scene, clip: &Clip, channel: &Channel) -> bool {
    let sampler = &clip.samplers[channel.sampler as usize];
    let trs = |node: NodeId| match &scene.nodes[node.index()].local {
        LocalTransform::Trs(trs) => Some(*trs),
        LocalTransform::Matrix(_) => None,
    };
    let rest: Option<Vec<f64>> = match channel.target {
        ChannelTarget::Translation(node) => trs(node).map(|t| t.translation.to_array().to_vec()),
        ChannelTarget::Rotation(node) => trs(node).map(|t| t.rotation.to_array().to_vec()),
        ChannelTarget::Scale(node) => trs(node).map(|t| t.scale.to_array().to_vec()),
        ChannelTarget::Weights(node) => Some(rest_weights(scene, node)),
        ChannelTarget::MeshWeights(mesh) => {
            Some(scene.meshes[mesh.index()].weights.iter().map(|&w| f64::from(w)).collect())
        }
    };
    rest.is_some_and(|rest| !holds(sampler, &rest))
}

/// A node's morph weights in the rest pose.
fn rest_weights(scene: &Scene, node: NodeId) -> Vec<f64> {
    let node = &scene.nodes[node.index()];
    let Some(mesh) = node.mesh else { return Vec::new() };
    let defaults = &scene.meshes[mesh.index()].weights;
    let own = node.weights.as_ref().unwrap_or(defaults);
    (0..defaults.len()).map(|i| own.get(i).copied().map_or(0.0, f64::from)).collect()
}

/// True when the sampler gives `rest` at every time: all keys equal it, all tangents are zero.
#[expect(clippy::float_cmp, reason = "a value that differs at all moves the part")]
fn holds(sampler: &Sampler, rest: &[f64]) -> bool {
    let width = sampler.width.max(1);
    sampler.values.chunks(width).enumerate().all(|(slot, value)| {
        let tangent = sampler.interpolation == Interpolation::CubicSpline && slot % 3 != 1;
        value.iter().zip(rest).all(|(&v, &r)| f64::from(v) == if tangent { 0.0 } else { r })
    })
}

/// Bounds on the factors by which a linear map changes lengths.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    least: f64,
    most: f64,
}

impl Stretch {
    const SINGULAR: Self = Self { least: 0.0, most: f64::INFINITY };

    fn of_local(local: &LocalTransform) -> Self {
        match local {
            LocalTransform::Trs(trs) => Self::of_scale(trs.scale),
            LocalTransform::Matrix(m) => Self::of_matrix(&from_matrix(m).matrix3),
        }
    }

    fn of_scale(scale: glam::DVec3) -> Self {
        let scale = scale.abs();
        Self { least: scale.min_element(), most: scale.max_element() }
    }

    /// From the Frobenius norms of the matrix and its inverse.
    fn of_matrix(m: &glam::DMat3) -> Self {
        let (unit, factor) = scaled_to_one(m);
        let det = unit.determinant();
        if det == 0.0 || !det.is_finite() {
            return Self::SINGULAR;
        }
        let norm = |m: &glam::DMat3| {
            (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
        };
        Self { least: factor / norm(&unit.inverse()), most: factor * norm(&unit) }
    }

    /// Over all times of a scale sampler. A cubic may swing past its keys, so it counts as singular, and so
    /// does a component that changes sign.
    fn of_scale_keys(sampler: &Sampler) -> Self {
        if sampler.interpolation == Interpolation::CubicSpline {
            return Self::SINGULAR;
        }
        let mut bounds = [(f64::INFINITY, f64::NEG_INFINITY); 3];
        for value in sampler.values.chunks_exact(3) {
            for ((lo, hi), &v) in bounds.iter_mut().zip(value) {
                *lo = lo.min(f64::from(v));
                *hi = hi.max(f64::from(v));
            }
        }
        if bounds.iter().any(|&(lo, hi)| lo <= 0.0 && hi >= 0.0) {
            return Self::SINGULAR;
        }
        let least = bounds.iter().map(|(lo, hi)| lo.abs().min(hi.abs())).fold(f64::INFINITY, f64::min);
        let most = bounds.iter().map(|(lo, hi)| lo.abs().max(hi.abs())).fold(0.0, f64::max);
        Self { least, most }
    }

    /// Bounds that hold for either.
    fn hull(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), most: self.most.max(other.most) }
    }

    /// Bounds for the product of two maps.
    fn of_product(self, other: Self) -> Self {
        Self { least: self.least * other.least, most: self.most * other.most }
    }

    fn is_good(self) -> bool {
        self.most <= MAX_CONDITION * self.least && self.most <= MAX_STRETCH && self.least >= 1.0 / MAX_STRETCH
    }
}
