use std::{ops::Range, sync::Arc};

use glam::DAffine3;

use super::{
    quat, sampler,
    transform::{from_matrix, from_trs, local_matrix, product},
};
use crate::scene::{Channel, ChannelTarget, Clip, ClipId, LocalTransform, NodeId, Scene, SkinId, Trs};

/// A clip playing at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveClip {
    /// The clip.
    pub clip: ClipId,
    /// Time on the clip's own clock in seconds; clamped to each sampler's keys.
    pub time_s: f64,
}

/// A cross-fade from other clips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade<'a> {
    /// The clips that are left.
    pub from: &'a [ActiveClip],
    /// How much of the new ones there is: 0 for none, 1 for nothing else. Values beyond count as the nearer end, NaN as 1.
    pub alpha: f64,
}

/// A joint matrix as four columns, each padded to the width of a vector register.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct JointColumns(pub(super) [[f64; 4]; 4]);

impl From<&DAffine3> for JointColumns {
    fn from(m: &DAffine3) -> Self {
        let column = |v: glam::DVec3| [v.x, v.y, v.z, 0.0];
        Self([column(m.matrix3.x_axis), column(m.matrix3.y_axis), column(m.matrix3.z_axis), column(m.translation)])
    }
}

/// A joint matrix rounded to `f32`: four columns of four, the last row 0.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct JointRow(pub(super) [f32; 16]);

impl From<&DAffine3> for JointRow {
    /// Saturates.
    #[expect(clippy::cast_possible_truncation, reason = "the rounding is what makes it fast")]
    fn from(m: &DAffine3) -> Self {
        let mut out = [0.0; 16];
        for (to, from) in out.iter_mut().zip(JointColumns::from(m).0.as_flattened()) {
            *to = from.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
        }
        Self(out)
    }
}

/// No node of the driven list.
const UNDRIVEN: u32 = u32::MAX;

/// What a pose knows of its scene; the same for every frame.
#[derive(Debug)]
struct Layout {
    /// Rest placement of each node.
    rest_local: Vec<DAffine3>,
    /// Place of each node in `rest_trs`, or [`UNDRIVEN`].
    driven_slot: Vec<u32>,
    /// Rest components of every node that some channel drives, save those given as a matrix.
    rest_trs: Vec<Trs>,
    /// Where each node's morph weights lie.
    weight_ranges: Vec<Range<usize>>,
    /// Morph weights of the rest pose.
    rest_weights: Vec<f64>,
    /// For each mesh, the nodes that draw it with the mesh's own default weights.
    default_weight_nodes: Vec<Vec<NodeId>>,
    /// `joint_from_mesh` of each skin's joints, all skins in a row.
    inverse_bind: Vec<DAffine3>,
    /// Where each skin's joints lie.
    joint_ranges: Vec<Range<usize>>,
}

/// Where every node is and how every mesh is morphed at one moment. Reused from frame to frame.
///
/// Belongs to the scene it was made for. Everything is `f64`; matrix entries saturate at 1e150 so that finite
/// input never becomes NaN.
#[derive(Clone, Debug)]
pub struct Pose {
    layout: Arc<Layout>,
    world_from_node: Vec<DAffine3>,
    weights: Vec<f64>,
    joint_matrices: Vec<DAffine3>,
    palette: Vec<JointColumns>,
    fast_palette: Vec<JointRow>,
    /// Components of the driven nodes, as far as `active` says.
    trs: Vec<Trs>,
    /// The same of the clips that are faded out, and their weights.
    faded_trs: Vec<Trs>,
    faded_weights: Vec<f64>,
    active: Vec<bool>,
    was_active: Vec<bool>,
    /// Nodes whose global transform was computed anew by the last evaluation.
    dirty: Vec<bool>,
    /// The `world_from_scene` of the last evaluation.
    root: Option<DAffine3>,
}

impl Pose {
    /// The rest pose of `scene`. Allocates all that later evaluations need.
    pub fn rest(scene: &Scene) -> Self {
        let layout = Layout::new(scene);
        let joints = layout.inverse_bind.len();
        let driven = layout.rest_trs.len();
        let mut pose = Self {
            world_from_node: vec![DAffine3::IDENTITY; scene.nodes.len()],
            weights: layout.rest_weights.clone(),
            joint_matrices: vec![DAffine3::IDENTITY; joints],
            palette: vec![JointColumns::from(&DAffine3::IDENTITY); joints],
            fast_palette: vec![JointRow::from(&DAffine3::IDENTITY); joints],
            trs: layout.rest_trs.clone(),
            faded_trs: layout.rest_trs.clone(),
            faded_weights: layout.rest_weights.clone(),
            active: vec![false; driven],
            was_active: vec![false; driven],
            dirty: vec![true; scene.nodes.len()],
            root: None,
            layout: Arc::new(layout),
        };
        pose.evaluate(scene, &[], &DAffine3::IDENTITY);
        pose
    }

    /// Evaluates `clips` together over the rest pose; a later clip wins where two drive the same target.
    ///
    /// `world_from_scene` is applied above the roots. Channels on a node that is given as a matrix do nothing
    /// (importers take such matrices apart where that loses nothing). Weights driven at a node win over those
    /// driven at its mesh. Only nodes at or below one that is driven, or was in the evaluation before, are
    /// computed anew.
    ///
    /// Cost: O(channels log keys + nodes + joints), no allocation, one thread.
    ///
    /// # Panics
    /// When `scene` is not the one the pose was made for (as far as the node count tells), or a clip is not
    /// in it.
    pub fn evaluate(&mut self, scene: &Scene, clips: &[ActiveClip], world_from_scene: &DAffine3) {
        assert_eq!(scene.nodes.len(), self.world_from_node.len(), "the pose belongs to another scene");
        self.begin();
        self.sample_nodes(scene, clips);
        self.sample_weights(scene, clips);
        self.place_nodes(scene, world_from_scene);
        self.place_joints(scene);
    }

    /// As [`Pose::evaluate`], on the way from other clips: translations, scales and weights on a straight line between what either gives,
    /// rotations on the shorter arc. What only one of them drives is faded from or to the rest pose. At either end the pose is that of
    /// [`Pose::evaluate`], bit for bit. No allocation.
    ///
    /// # Panics
    /// As there.
    pub fn evaluate_faded(&mut self, scene: &Scene, fade: Fade<'_>, clips: &[ActiveClip], world_from_scene: &DAffine3) {
        let alpha = fade.alpha;
        if alpha <= 0.0 {
            return self.evaluate(scene, fade.from, world_from_scene);
        }
        if alpha.is_nan() || alpha >= 1.0 {
            return self.evaluate(scene, clips, world_from_scene);
        }
        assert_eq!(scene.nodes.len(), self.world_from_node.len(), "the pose belongs to another scene");
        self.begin();
        self.sample_nodes(scene, fade.from);
        self.sample_weights(scene, fade.from);
        std::mem::swap(&mut self.trs, &mut self.faded_trs);
        std::mem::swap(&mut self.weights, &mut self.faded_weights);
        self.sample_nodes(scene, clips);
        self.sample_weights(scene, clips);
        for (to, from) in self.trs.iter_mut().zip(&self.faded_trs) {
            to.translation = from.translation + (to.translation - from.translation) * alpha;
            to.scale = from.scale + (to.scale - from.scale) * alpha;
            to.rotation = quat::slerp(from.rotation, to.rotation, alpha);
        }
        for (to, from) in self.weights.iter_mut().zip(&self.faded_weights) {
            *to = from + (*to - from) * alpha;
        }
        self.place_nodes(scene, world_from_scene);
        self.place_joints(scene);
    }

    /// Forgets what was driven the last time but one.
    fn begin(&mut self) {
        std::mem::swap(&mut self.active, &mut self.was_active);
        self.active.fill(false);
    }

    /// Samples components of the driven nodes, and adds to what is driven.
    fn sample_nodes(&mut self, scene: &Scene, clips: &[ActiveClip]) {
        self.trs.copy_from_slice(&self.layout.rest_trs);
        for (clip, channel, time_s) in channels(scene, clips) {
            let (ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) | ChannelTarget::Scale(node)) =
                channel.target
            else {
                continue;
            };
            let slot = self.layout.driven_slot[node.index()];
            if slot == UNDRIVEN {
                continue;
            }
            let slot = slot as usize;
            let sampler = &clip.samplers[channel.sampler as usize];
            let trs = &mut self.trs[slot];
            match channel.target {
                ChannelTarget::Translation(_) => trs.translation = sampler::vector(sampler, time_s),
                ChannelTarget::Rotation(_) => trs.rotation = sampler::rotation(sampler, time_s),
                _ => trs.scale = sampler::vector(sampler, time_s),
            }
            self.active[slot] = true;
        }
    }

    fn sample_weights(&mut self, scene: &Scene, clips: &[ActiveClip]) {
        self.weights.copy_from_slice(&self.layout.rest_weights);
        for (clip, channel, time_s) in channels(scene, clips) {
            if let ChannelTarget::MeshWeights(mesh) = channel.target {
                for node in &self.layout.default_weight_nodes[mesh.index()] {
                    let range = self.layout.weight_ranges[node.index()].clone();
                    sampler::weights(&clip.samplers[channel.sampler as usize], time_s, &mut self.weights[range]);
                }
            }
        }
        for (clip, channel, time_s) in channels(scene, clips) {
            if let ChannelTarget::Weights(node) = channel.target {
                let range = self.layout.weight_ranges[node.index()].clone();
                sampler::weights(&clip.samplers[channel.sampler as usize], time_s, &mut self.weights[range]);
            }
        }
    }

    fn place_nodes(&mut self, scene: &Scene, world_from_scene: &DAffine3) {
        let root_moved = self.root.replace(*world_from_scene) != Some(*world_from_scene);
        for &node in &scene.eval_order {
            let n = node.index();
            let parent = scene.nodes[n].parent;
            let slot = self.layout.driven_slot[n];
            let driven = slot != UNDRIVEN && self.active[slot as usize];
            let was_driven = slot != UNDRIVEN && self.was_active[slot as usize];
            let above_moved = parent.map_or(root_moved, |p| self.dirty[p.index()]);
            self.dirty[n] = driven || was_driven || above_moved;
            if !self.dirty[n] {
                continue;
            }
            let local = if driven { from_trs(&self.trs[slot as usize]) } else { self.layout.rest_local[n] };
            let above = parent.map_or(world_from_scene, |p| &self.world_from_node[p.index()]);
            self.world_from_node[n] = product(above, &local);
        }
    }

    fn place_joints(&mut self, scene: &Scene) {
        for (skin, range) in scene.skins.iter().zip(&self.layout.joint_ranges) {
            for (joint, slot) in skin.joints.iter().zip(range.clone()) {
                if self.dirty[joint.index()] {
                    let m = product(&self.world_from_node[joint.index()], &self.layout.inverse_bind[slot]);
                    self.joint_matrices[slot] = m;
                    self.palette[slot] = JointColumns::from(&m);
                    self.fast_palette[slot] = JointRow::from(&m);
                }
            }
        }
    }

    /// Whether both can be poses of one scene: as many nodes, morph weights and joints at the same places.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let (a, b) = (&self.layout, &other.layout);
        let alike = || a.weight_ranges == b.weight_ranges && a.joint_ranges == b.joint_ranges;
        Arc::ptr_eq(a, b) || (self.world_from_node.len() == other.world_from_node.len() && alike())
    }

    /// Global transform of a node.
    pub fn world_from_node(&self, node: NodeId) -> &DAffine3 {
        &self.world_from_node[node.index()]
    }

    /// Morph weights in force at a node with a mesh, one a target of its mesh; empty without targets.
    pub fn weights(&self, node: NodeId) -> &[f64] {
        &self.weights[self.layout.weight_ranges[node.index()].clone()]
    }

    /// `world_from_mesh` of each joint of a skin: joint global transform times inverse bind matrix.
    pub fn joint_matrices(&self, skin: SkinId) -> &[DAffine3] {
        &self.joint_matrices[self.layout.joint_ranges[skin.index()].clone()]
    }

    /// [`Pose::joint_matrices`] in the layout of the skinning kernel.
    pub(super) fn palette(&self, skin: SkinId) -> &[JointColumns] {
        &self.palette[self.layout.joint_ranges[skin.index()].clone()]
    }

    /// [`Pose::palette`] rounded to `f32`.
    pub(super) fn fast_palette(&self, skin: SkinId) -> &[JointRow] {
        &self.fast_palette[self.layout.joint_ranges[skin.index()].clone()]
    }
}

/// Every channel of `clips` with its clip and time, in the order in which later ones win.
fn channels<'a>(scene: &'a Scene, clips: &'a [ActiveClip]) -> impl Iterator<Item = (&'a Clip, &'a Channel, f64)> + 'a {
    clips.iter().flat_map(|active| {
        let clip = &scene.clips[active.clip.index()];
        clip.channels.iter().map(move |channel| (clip, channel, active.time_s))
    })
}

impl Layout {
    fn new(scene: &Scene) -> Self {
        let (driven_slot, rest_trs) = driven_nodes(scene);
        let (weight_ranges, rest_weights) = rest_weights(scene);
        let mut default_weight_nodes = vec![Vec::new(); scene.meshes.len()];
        for (n, node) in (0u32..).zip(&scene.nodes) {
            if let (Some(mesh), None) = (node.mesh, &node.weights) {
                default_weight_nodes[mesh.index()].push(NodeId(n));
            }
        }
        let mut joint_ranges = Vec::with_capacity(scene.skins.len());
        let mut inverse_bind = Vec::new();
        for skin in &scene.skins {
            let start = inverse_bind.len();
            inverse_bind.extend(skin.inverse_bind.iter().map(from_matrix));
            inverse_bind.resize(start + skin.joints.len(), DAffine3::IDENTITY);
            joint_ranges.push(start..inverse_bind.len());
        }
        Self {
            rest_local: scene.nodes.iter().map(|node| local_matrix(&node.local)).collect(),
            driven_slot,
            rest_trs,
            weight_ranges,
            rest_weights,
            default_weight_nodes,
            inverse_bind,
            joint_ranges,
        }
    }
}

/// For each node its place in the list of driven nodes, and that list's rest components.
fn driven_nodes(scene: &Scene) -> (Vec<u32>, Vec<Trs>) {
    let mut slots = vec![UNDRIVEN; scene.nodes.len()];
    let mut rest = Vec::new();
    for channel in scene.clips.iter().flat_map(|clip| &clip.channels) {
        if let ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) | ChannelTarget::Scale(node) =
            channel.target
            && slots[node.index()] == UNDRIVEN
            && let LocalTransform::Trs(trs) = scene.nodes[node.index()].local
        {
            slots[node.index()] = u32::try_from(rest.len()).expect("as many driven nodes as nodes at most");
            rest.push(trs);
        }
    }
    (slots, rest)
}

/// Where each node's morph weights lie, and their defaults: the node's own, else the mesh's.
fn rest_weights(scene: &Scene) -> (Vec<Range<usize>>, Vec<f64>) {
    let mut ranges = Vec::with_capacity(scene.nodes.len());
    let mut weights = Vec::new();
    for node in &scene.nodes {
        let start = weights.len();
        if let Some(mesh) = node.mesh {
            let defaults = &scene.meshes[mesh.index()].weights;
            let own = node.weights.as_ref().unwrap_or(defaults);
            weights.extend(own.iter().take(defaults.len()).map(|&w| f64::from(w)));
            weights.resize(start + defaults.len(), 0.0);
        }
        ranges.push(start..weights.len());
    }
    (ranges, weights)
}
