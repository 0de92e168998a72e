//! Animations: each is read on its own, and one that is not valid disables itself.

use std::collections::HashMap;

use super::{
    super::{Channel, ChannelTarget, Clip, Interpolation, LocalTransform, Mesh, NodeId, Sampler, SceneNode},
    accessor::Component,
    context::{Context, check_index},
    error::{Problem, Step},
    json::{self, AccessorType, Animation, AnimationTarget, Object},
    pointer,
};

/// Bytes that a clip without keys takes, the reason why it is disabled included.
const CLIP_BYTES: usize = size_of::<Clip>() + 384;

/// All animations; nodes with a matrix that a channel drives get translation, rotation and scale instead.
pub(super) fn import(cx: &Context<'_>, nodes: &mut [SceneNode], meshes: &[Mesh]) -> Step<Vec<Clip>> {
    let sources = cx.doc.animations.as_deref().unwrap_or_default();
    cx.budget.take(sources.len(), CLIP_BYTES, "animations")?;
    let mut importer = ClipImporter { cx, nodes, meshes, ignored_pointers: Vec::new() };
    let clips = sources.iter().enumerate().map(|(i, text)| importer.clip(i, text.get())).collect();
    if let [first, rest @ ..] = importer.ignored_pointers.as_slice() {
        let what = "animates what is not played (only node transforms and morph weights are)";
        let text = format!("{what}: {first}, and {} more such channels", rest.len());
        cx.warnings.add("animations", text);
    }
    Ok(clips)
}

struct ClipImporter<'c> {
    cx: &'c Context<'c>,
    nodes: &'c mut [SceneNode],
    meshes: &'c [Mesh],
    ignored_pointers: Vec<String>,
}

impl ClipImporter<'_> {
    fn clip(&mut self, index: usize, text: &str) -> Clip {
        let place = format!("animations[{index}]");
        let animation = match json::read::<Object<Animation>>(text, &place) {
            Ok(Object(animation)) => animation,
            Err(problem) => return self.disabled(Clip::default(), &problem),
        };
        let clip = Clip {
            name: animation.name.clone().unwrap_or_default(),
            channel_count: animation.channels.len(),
            ..Clip::default()
        };
        match self.channels(&animation, &place) {
            Ok(parts) => {
                Clip { channels: parts.channels, samplers: parts.samplers, duration_s: parts.duration_s, ..clip }
            }
            Err(problem) => self.disabled(clip, &problem),
        }
    }

    fn disabled(&self, clip: Clip, problem: &Problem) -> Clip {
        self.cx.warnings.add_problem(problem, "the animation is disabled");
        Clip { disabled: Some(format!("{}: {}", problem.place(), problem.reason())), ..clip }
    }

    fn channels(&mut self, animation: &Animation, clip_place: &str) -> Step<ClipParts> {
        let mut parts = ClipParts::default();
        let mut inputs = Vec::with_capacity(animation.samplers.len());
        for (i, sampler) in animation.samplers.iter().enumerate() {
            let place = format!("{clip_place}.samplers[{i}]");
            let input = self.input(sampler, &place)?;
            parts.duration_s = input.times.last().map_or(parts.duration_s, |&t| parts.duration_s.max(f64::from(t)));
            inputs.push(input);
        }
        if animation.channels.is_empty() || animation.samplers.is_empty() {
            return Err(Problem::at(clip_place, "has no channel or no sampler"));
        }
        let mut made: HashMap<(usize, usize), u32> = HashMap::new();
        for (i, channel) in animation.channels.iter().enumerate() {
            let place = format!("{clip_place}.channels[{i}]");
            let sampler = channel.sampler.index();
            check_index(sampler, inputs.len(), format_args!("{place}.sampler"), "sampler")?;
            let Some((target, width)) = self.target(&channel.target, &format!("{place}.target"))? else { continue };
            let number = if let Some(&number) = made.get(&(sampler, width)) {
                number
            } else {
                let place = format!("{clip_place}.samplers[{sampler}]");
                let source = &animation.samplers[sampler];
                parts.samplers.push(self.sampler(source, &inputs[sampler], target, width, &place)?);
                let number = u32::try_from(parts.samplers.len() - 1).unwrap_or(u32::MAX);
                made.insert((sampler, width), number);
                number
            };
            if !parts.add(Channel { sampler: number, target }) {
                let text = "is driven by an earlier channel too; this one counts";
                self.cx.warnings.add(format_args!("{place}.target"), text);
            }
        }
        Ok(parts)
    }

    /// Key times, finite and increasing.
    fn input(&self, sampler: &json::AnimationSampler, place: &str) -> Step<Input> {
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            Some(other) => {
                let reason = format!("`{}` is not LINEAR, STEP or CUBICSPLINE", other.escape_debug());
                return Err(Problem::at(format_args!("{place}.interpolation"), reason));
            }
        };
        let place = format!("{place}.input");
        let accessor = self.cx.accessor(sampler.input.index(), &place)?;
        if accessor.min.is_none() || accessor.max.is_none() {
            self.cx.warnings.add(&place, format_args!("accessors[{}] has no min and max", sampler.input.0));
        }
        let layout = self.cx.layout(sampler.input.index())?;
        if layout.kind != AccessorType::Scalar || layout.component != Component::F32 {
            return Err(Problem::at(place, format!("accessors[{}] is not of SCALAR floats", sampler.input.0)));
        }
        let times = self.cx.numbers(sampler.input.index())?;
        if times.is_empty() {
            return Err(Problem::at(place, format!("accessors[{}] has no key", sampler.input.0)));
        }
        if let Some(i) = times.iter().position(|t| !t.is_finite()) {
            return Err(Problem::at(place, format!("time of key {i} is not finite")));
        }
        if let Some(i) = times.windows(2).position(|t| t[0] >= t[1]) {
            let reason = format!("times do not increase: key {} at {} after {}", i + 1, times[i + 1], times[i]);
            return Err(Problem::at(place, reason));
        }
        if times[0] < 0.0 {
            self.cx.warnings.add(place, format_args!("first key at the negative time {}", times[0]));
        }
        Ok(Input { interpolation, times })
    }

    /// Values for a target of `width` numbers.
    fn sampler(
        &self,
        source: &json::AnimationSampler,
        input: &Input,
        target: ChannelTarget,
        width: usize,
        place: &str,
    ) -> Step<Sampler> {
        let place = format!("{place}.output");
        let index = source.output.index();
        self.cx.accessor(index, &place)?;
        let layout = self.cx.layout(index)?;
        let is_weights = matches!(target, ChannelTarget::Weights(_) | ChannelTarget::MeshWeights(_));
        let kind_fits = if is_weights { layout.kind == AccessorType::Scalar } else { layout.kind.lanes() == width };
        if !kind_fits || !(layout.component == Component::F32 || layout.normalized) {
            let reason = format!("accessors[{index}] has no legal format for this target");
            return Err(Problem::at(place, reason));
        }
        let keys = input.times.len() * if input.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let expected = keys.saturating_mul(width);
        let actual = layout.count.saturating_mul(layout.kind.lanes());
        if actual != expected {
            let reason = format!("{actual} numbers in accessors[{index}], but {expected} are needed for the keys");
            return Err(Problem::at(place, reason));
        }
        let values = self.cx.numbers(index)?;
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return Err(Problem::at(place, format!("number {i} is not finite")));
        }
        if matches!(target, ChannelTarget::Rotation(_)) {
            self.check_rotations(&values, input.interpolation, &place);
        }
        if input.interpolation == Interpolation::CubicSpline && input.times.len() < 2 {
            self.cx.warnings.add(&place, "a CUBICSPLINE of one key; the key holds");
        }
        self.cx.budget.take(input.times.len(), 4, &place)?;
        Ok(Sampler { interpolation: input.interpolation, times: input.times.clone(), width, values })
    }

    fn check_rotations(&self, values: &[f32], interpolation: Interpolation, place: &str) {
        let step = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let is_unit = |q: &[f32]| (q.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>() - 1.0).abs() < 0.01;
        if let Some(key) = values.chunks_exact(4).skip(step / 2).step_by(step).position(|q| !is_unit(q)) {
            self.cx.warnings.add(place, format_args!("key {key} is no unit quaternion; keys are normalised"));
        }
    }

    /// What a channel drives and how many numbers that takes; `None` for what is skipped.
    fn target(&mut self, target: &AnimationTarget, place: &str) -> Step<Option<(ChannelTarget, usize)>> {
        if let Some(pointer) = target.pointer() {
            if target.node.is_some() {
                self.cx.warnings.add(place, "has a node beside its pointer; the pointer counts");
            }
            let Some(target) = pointer::parse(pointer) else {
                self.ignored_pointers.push(format!("{place}: {}", super::uri::shorten(pointer)));
                return Ok(None);
            };
            return self.checked(target, place);
        }
        let Some(node) = target.node else { return Ok(None) };
        let node = NodeId(node.0);
        let target = match target.path.as_str() {
            "translation" => ChannelTarget::Translation(node),
            "rotation" => ChannelTarget::Rotation(node),
            "scale" => ChannelTarget::Scale(node),
            "weights" => ChannelTarget::Weights(node),
            other => {
                let reason = format!("`{}` is unknown; the channel is ignored", other.escape_debug());
                self.cx.warnings.add(format_args!("{place}.path"), reason);
                return Ok(None);
            }
        };
        self.checked(target, place)
    }

    fn checked(&mut self, target: ChannelTarget, place: &str) -> Step<Option<(ChannelTarget, usize)>> {
        let targets = |mesh: usize| self.meshes[mesh].weights.len();
        let width = match target {
            ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) | ChannelTarget::Scale(node) => {
                check_index(node.index(), self.nodes.len(), format_args!("{place}.node"), "node")?;
                if !self.make_animatable(node, place) {
                    return Ok(None);
                }
                if matches!(target, ChannelTarget::Rotation(_)) { 4 } else { 3 }
            }
            ChannelTarget::Weights(node) => {
                check_index(node.index(), self.nodes.len(), format_args!("{place}.node"), "node")?;
                self.nodes[node.index()].mesh.map_or(0, |mesh| targets(mesh.index()))
            }
            ChannelTarget::MeshWeights(mesh) => {
                check_index(mesh.index(), self.meshes.len(), place, "mesh")?;
                targets(mesh.index())
            }
        };
        if width == 0 {
            self.cx.warnings.add(place, "drives morph weights where there is no morph target; ignored");
            return Ok(None);
        }
        Ok(Some((target, width)))
    }

    /// Splits a node's matrix into parts that a channel can drive; false when it shears.
    fn make_animatable(&mut self, node: NodeId, place: &str) -> bool {
        let LocalTransform::Matrix(matrix) = self.nodes[node.index()].local else { return true };
        let Some(trs) = super::decompose::decompose(&matrix) else {
            self.cx.warnings.add(place, "drives a node whose matrix shears or flattens; ignored");
            return false;
        };
        self.cx.warnings.add(place, "drives a node that has a matrix; the matrix is split into its parts");
        self.nodes[node.index()].local = LocalTransform::Trs(trs);
        true
    }
}

#[derive(Default)]
struct ClipParts {
    channels: Vec<Channel>,
    samplers: Vec<Sampler>,
    duration_s: f64,
    /// Which channel drives a target.
    driven: HashMap<ChannelTarget, usize>,
}

impl ClipParts {
    /// Adds a channel; false when it replaces an earlier one with the same target.
    fn add(&mut self, channel: Channel) -> bool {
        let last = self.channels.len();
        let place = *self.driven.entry(channel.target).or_insert(last);
        if place == last {
            self.channels.push(channel);
        } else {
            self.channels[place] = channel;
        }
        place == last
    }
}

struct Input {
    interpolation: Interpolation,
    times: Vec<f32>,
}
