//! The box that a scene fills over a whole animation, for framing it.

use std::collections::HashMap;

use glam::{DAffine3, Vec3};

use super::{
    ActiveClip, MotionClass, Pose, classify,
    deform::{Placement, deform_range, placed, placement},
};
use crate::{
    geom::Aabb,
    scene::{ClipId, MeshId, PartInstance, Scene},
};

/// Key times looked at, spread evenly over the list when there are more.
const KEY_TIMES: usize = 64;
/// Times looked at besides, evenly from the first key to the last.
const EVEN_TIMES: usize = 32;
/// Nodes posed in all before fewer times are looked at.
const NODE_BUDGET: usize = 1 << 22;
/// Vertices deformed in all before parts are sampled instead.
const VERTEX_BUDGET: usize = 1 << 23;
/// Vertices sampled in a row.
const RUN: usize = 64;

/// The box around everything drawn while `clips` play together once, or around the rest pose without clips.
///
/// Parts that no clip moves count once. The others are looked at on key times (64 of them at most) and on 32
/// evenly spaced times, so motion between may pass the box by a little. In scenes too big for that there are
/// fewer times (16 at least), parts without skin and morph are bounded by the corners of their rest boxes, and of
/// the others every n-th run of vertices is taken. Parts without triangles count only when nothing has any.
/// Empty for a scene without vertices.
///
/// Cost: about 2^22 nodes posed and 2^23 vertices deformed at most, save for what is needed to see each part at
/// all; one thread.
pub fn animation_bounds(scene: &Scene, clips: &[ClipId]) -> Aabb {
    let drawn = drawn(scene);
    let times = times(scene, clips);
    let (still, moving): (Vec<_>, Vec<_>) = drawn.into_iter().partition(|(_, class)| *class == MotionClass::Static);
    let mut sweep = Sweep { scene, rest_boxes: HashMap::new(), scratch: [Vec3::ZERO; RUN], aabb: Aabb::EMPTY };
    let mut pose = Pose::rest(scene);
    sweep.grow_all(&pose, &still, 1);
    for &time_s in &times {
        let active: Vec<_> = clips.iter().map(|&clip| ActiveClip { clip, time_s }).collect();
        pose.evaluate(scene, &active, &DAffine3::IDENTITY);
        sweep.grow_all(&pose, &moving, times.len());
    }
    sweep.aabb
}

/// The instances that count, with their classes.
fn drawn(scene: &Scene) -> Vec<(PartInstance, MotionClass)> {
    let all = || scene.instances.iter().copied().zip(classify(scene));
    let traced: Vec<_> = all().filter(|(i, _)| !scene.part(*i).triangles.is_empty()).collect();
    if traced.is_empty() { all().collect() } else { traced }
}

/// The times to look at, ascending; at least one.
fn times(scene: &Scene, clips: &[ClipId]) -> Vec<f64> {
    let mut keys: Vec<f32> = Vec::new();
    for clip in clips.iter().map(|c| &scene.clips[c.index()]) {
        for channel in &clip.channels {
            keys.extend(&clip.samplers[channel.sampler as usize].times);
        }
    }
    keys.sort_unstable_by(f32::total_cmp);
    keys.dedup();
    let (Some(&first), Some(&last)) = (keys.first(), keys.last()) else {
        return vec![0.0];
    };
    let (first, last) = (f64::from(first), f64::from(last));
    let affordable = (NODE_BUDGET / scene.nodes.len().max(1)).max(16);
    let even = EVEN_TIMES.min(affordable / 2);
    let step = (last - first) / even as f64;
    let mut times: Vec<f64> = (0..=even).map(|i| first + step * i as f64).collect();
    let taken = keys.len().min(KEY_TIMES).min(affordable / 2);
    times.extend((0..taken).map(|i| f64::from(keys[i * (keys.len() - 1) / taken.saturating_sub(1).max(1)])));
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    times
}

/// A box that grows over parts and times.
struct Sweep<'a> {
    scene: &'a Scene,
    rest_boxes: HashMap<(MeshId, u32), Aabb>,
    scratch: [Vec3; RUN],
    aabb: Aabb,
}

impl Sweep<'_> {
    /// Grows by every one of `parts` at one of `times` poses.
    fn grow_all(&mut self, pose: &Pose, parts: &[(PartInstance, MotionClass)], times: usize) {
        let vertices: usize = parts.iter().map(|(i, _)| self.scene.part(*i).positions.len()).sum();
        let stride = vertices.saturating_mul(times).div_ceil(VERTEX_BUDGET).max(1);
        for &(instance, _) in parts {
            let morphs = pose.weights(instance.node).iter().any(|&w| w != 0.0);
            match placement(self.scene, pose, instance) {
                Placement::Whole(matrix) if stride > 1 && !morphs => self.grow_by_corners(&matrix, instance),
                _ => self.grow_by_vertices(pose, instance, stride),
            }
        }
    }

    fn grow_by_vertices(&mut self, pose: &Pose, instance: PartInstance, stride: usize) {
        let count = self.scene.part(instance).positions.len();
        for first in (0..count).step_by(RUN * stride) {
            let out = &mut self.scratch[..RUN.min(count - first)];
            deform_range(self.scene, pose, instance, first, out);
            self.aabb = out.iter().fold(self.aabb, |aabb, &p| aabb.grown(p));
        }
    }

    fn grow_by_corners(&mut self, matrix: &DAffine3, instance: PartInstance) {
        let part = self.scene.part(instance);
        let rest = *self
            .rest_boxes
            .entry((instance.mesh, instance.part))
            .or_insert_with(|| Aabb::from_points(part.positions.iter().copied()));
        if rest.is_empty() {
            return;
        }
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { rest.min[axis] } else { rest.max[axis] };
            self.aabb = self.aabb.grown(placed(matrix, Vec3::new(pick(0), pick(1), pick(2))));
        }
    }
}
