//! What shading needs of a scene, decided once: materials with their textures, light nodes, exposure.

use std::sync::Arc;

use super::{
    exposure,
    material::{Channel, Coverage, MaterialMaker, ShadeMaterial},
    texture::Pyramid,
};
use crate::scene::{Material, NodeId, Scene};

/// A scene prepared for shading.
#[derive(Debug)]
pub(crate) struct PreparedScene {
    pub(crate) scene: Arc<Scene>,
    pub(crate) materials: Vec<ShadeMaterial>,
    pub(crate) pyramids: Vec<Pyramid>,
    /// Nodes of the default scene that hold a light.
    pub(crate) light_nodes: Vec<NodeId>,
    /// Scale that brings the file's lights to a mean level; 1 without lights.
    pub(crate) exposure: f32,
    /// Some material is masked or blended.
    pub(crate) pierced: bool,
}

impl PreparedScene {
    /// Prepares `scene`. Cost: O(texels + triangles sampled for the exposure).
    pub(crate) fn new(scene: Arc<Scene>) -> Self {
        let mut maker = MaterialMaker::new(&scene);
        let mut materials: Vec<_> = scene.materials.iter().map(|m| maker.make(m)).collect();
        materials.push(maker.make(&Material::default()));
        let pyramids = maker.into_pyramids();
        let has_light = |n: &NodeId| scene.nodes[n.index()].light.is_some();
        let light_nodes: Vec<_> = scene.draw_order.iter().copied().filter(has_light).collect();
        let exposure = exposure::of_scene(&scene, &light_nodes);
        let pierced = materials.iter().any(|m| m.coverage != Coverage::Opaque);
        Self { scene, materials, pyramids, light_nodes, exposure, pierced }
    }

    /// Number of the material of a part, that of glTF's default material when it names none.
    pub(crate) fn material_of(&self, mesh: usize, part: usize) -> u32 {
        let default = self.materials.len() - 1;
        let named = self.scene.meshes[mesh].parts[part].material;
        #[expect(clippy::cast_possible_truncation, reason = "material numbers are 32 bits wide")]
        let index = named.map_or(default, |m| m.index().min(default)) as u32;
        index
    }

    /// True when some material reads a normal map, for which tangents are asked.
    pub(crate) fn has_tangents(&self) -> bool {
        self.materials.iter().any(|m| m.map(Channel::Normal).is_some())
    }

    /// Bytes that texture pyramids take beside the scene's own images.
    pub(crate) fn texture_bytes(&self) -> usize {
        self.pyramids.iter().map(Pyramid::coarse_bytes).sum()
    }
}
