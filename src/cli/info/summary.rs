//! The numbers of `kinora info`, named as the contract of the command line names them.

use std::collections::HashSet;

use kinora::{
    anim::{LeftOut, MotionClass, classify, left_out},
    scene::{MeshPart, Scene},
};
use serde::Serialize;

/// What a file holds.
#[derive(Debug, Serialize)]
pub(super) struct Summary<'s> {
    pub(super) file: &'s str,
    pub(super) scenes: usize,
    pub(super) nodes: usize,
    pub(super) meshes: usize,
    /// Parts (glTF primitives), once a mesh.
    pub(super) parts: usize,
    /// Triangles, once a mesh.
    pub(super) triangles: usize,
    /// Triangles of the default scene, copies and shared meshes counted each time.
    pub(super) triangles_drawn: usize,
    /// Vertices, once a mesh.
    pub(super) vertices: usize,
    /// Nodes that are joints of a skin.
    pub(super) joints: usize,
    /// The most morph targets of any mesh.
    pub(super) morph_targets: usize,
    pub(super) animations: Vec<Animation<'s>>,
    pub(super) cameras: usize,
    pub(super) lights: usize,
    pub(super) materials: usize,
    pub(super) textures: usize,
    pub(super) extensions_used: &'s [String],
    pub(super) extensions_ignored: &'s [String],
    pub(super) classes: Classes,
    pub(super) left_out: Vec<LeftOut>,
    pub(super) warnings: &'s [String],
}

/// One animation; `disabled` is the reason, if it is.
#[derive(Debug, Serialize)]
pub(super) struct Animation<'s> {
    pub(super) name: &'s str,
    pub(super) duration_s: f64,
    pub(super) channels: usize,
    pub(super) disabled: Option<&'s str>,
}

/// Drawn part instances by how they can move over all animations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub(super) struct Classes {
    #[serde(rename = "static")]
    pub(super) still: usize,
    pub(super) rigid: usize,
    pub(super) deforming: usize,
}

impl Classes {
    fn of(scene: &Scene) -> Self {
        let mut classes = Self::default();
        for class in classify(scene) {
            match class {
                MotionClass::Static => classes.still += 1,
                MotionClass::Rigid => classes.rigid += 1,
                MotionClass::Deforming => classes.deforming += 1,
            }
        }
        classes
    }
}

impl<'s> Summary<'s> {
    /// Counts everything. Cost: O(file).
    pub(super) fn new(scene: &'s Scene) -> Self {
        let parts = || scene.meshes.iter().flat_map(|m| &m.parts);
        let sum = |count: fn(&MeshPart) -> usize| parts().map(count).sum();
        let classes = Classes::of(scene);
        let animation = |clip: &'s kinora::scene::Clip| Animation {
            name: &clip.name,
            duration_s: clip.duration_s,
            channels: clip.channel_count,
            disabled: clip.disabled.as_deref(),
        };
        Self {
            file: &scene.file,
            scenes: scene.scene_count,
            nodes: scene.nodes.len(),
            meshes: scene.meshes.len(),
            parts: parts().count(),
            triangles: sum(|p| p.triangles.len()),
            triangles_drawn: scene.triangles_drawn(),
            vertices: sum(|p| p.positions.len()),
            joints: scene.skins.iter().flat_map(|s| &s.joints).collect::<HashSet<_>>().len(),
            morph_targets: scene.meshes.iter().map(|m| m.weights.len()).max().unwrap_or(0),
            animations: scene.clips.iter().map(animation).collect(),
            cameras: scene.cameras.len(),
            lights: scene.lights.len(),
            materials: scene.materials.len(),
            textures: scene.textures.len(),
            extensions_used: &scene.extensions_used,
            extensions_ignored: &scene.extensions_ignored,
            classes,
            left_out: left_out(scene, &classify(scene)),
            warnings: &scene.warnings,
        }
    }
}
