use rayon::prelude::*;

use super::{View, meshes};
use crate::{
    anim::{ActiveClip, Pose, deform},
    geom::Triangles,
    glam::{DAffine3, Vec3},
    scene::{ClipId, Scene},
};

/// Time between the two poses of an animated scene, in seconds.
const FRAME_S: f64 = 1.0 / 30.0;

/// What is measured: triangles, and where their vertices are a moment later.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Its name in the rows; says so when it stands for another model.
    pub name: String,
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// The same vertices after a small motion.
    pub moved: Vec<Vec3>,
    /// Corners of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// What the motion is.
    pub motion: &'static str,
    /// Where the papers' pictures are taken from; without it, the whole scene is seen.
    pub view: Option<View>,
}

impl Subject {
    /// A mesh; its motion is a wave of a thousandth of its size.
    pub fn still(name: impl Into<String>, positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Self {
        let moved = meshes::waved(&positions);
        Self { name: name.into(), positions, moved, indices, motion: "wave", view: None }
    }

    /// The instances of a scene in the middle of its first clip, and a thirtieth of a second later. Without a clip, its rest pose, as
    /// [`Subject::still`].
    pub fn from_scene(name: impl Into<String>, scene: &Scene) -> Self {
        let clip = scene.clips.iter().position(|c| c.disabled.is_none());
        let (positions, indices) = posed(scene, clip, 0.0);
        if clip.is_none() {
            return Self::still(name, positions, indices);
        }
        let (moved, _) = posed(scene, clip, FRAME_S);
        Self { name: name.into(), positions, moved, indices, motion: "clip, one frame", view: None }
    }

    /// The triangles before the motion.
    pub fn prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.positions, indices: &self.indices, topology_epoch: 1 }
    }

    /// The triangles after it.
    pub fn moved_prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.moved, indices: &self.indices, topology_epoch: 1 }
    }
}

/// All triangles of a scene in one list, `after_s` seconds after the middle of a clip.
fn posed(scene: &Scene, clip: Option<usize>, after_s: f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    posed_at(scene, clip.map(|i| middle(scene, i, after_s)))
}

/// `after_s` seconds after the middle of a clip.
pub(super) fn middle(scene: &Scene, clip: usize, after_s: f64) -> ActiveClip {
    let id = ClipId(u32::try_from(clip).unwrap_or(u32::MAX));
    ActiveClip { clip: id, time_s: scene.clips[clip].duration_s / 2.0 + after_s }
}

/// All triangles of a scene in one list, at a time of a clip or in the rest pose.
pub(super) fn posed_at(scene: &Scene, active: Option<ActiveClip>) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut pose = Pose::rest(scene);
    pose.evaluate(scene, active.as_slice(), &DAffine3::IDENTITY);
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for &instance in &scene.instances {
        let part = scene.part(instance);
        let first = positions.len();
        positions.resize(first + part.positions.len(), Vec3::ZERO);
        deform(scene, &pose, instance, &mut positions[first..]);
        let first = u32::try_from(first).unwrap_or(u32::MAX);
        indices.par_extend(part.triangles.par_iter().map(|t| t.map(|i| i.saturating_add(first))));
    }
    (positions, indices)
}
