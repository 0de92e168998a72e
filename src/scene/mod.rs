//! The immutable scene: what a file holds, checked once, shared by everything that plays it.
//!
//! Everything lives in arenas addressed by index newtypes that equal the glTF indices. Every index stored in
//! a [`Scene`] is in range, every node's parent chain is finite, and every attribute array of a
//! [`MeshPart`] has the part's vertex count: importers guarantee it, readers rely on it.

pub mod builtin;
mod camera;
mod clip;
mod ids;
pub mod import;
mod light;
mod material;
mod mesh;
mod node;
mod skin;
pub mod spd;
mod texture;

pub use camera::{Camera, Projection};
pub use clip::{Channel, ChannelTarget, Clip, Interpolation, Sampler};
pub use ids::{CameraId, ClipId, ImageId, LightId, MaterialId, MeshId, NodeId, SkinId, TextureId};
pub use light::{Light, LightKind};
pub use material::{AlphaMode, Material, TextureRef};
pub use mesh::{Influences, Mesh, MeshPart, MorphTarget, Topology};
pub use node::{LocalTransform, SceneNode, Trs};
pub use skin::Skin;
pub use texture::{Filter, Image, TexSampler, Texture, Wrap};

/// One part of one copy of one node's mesh: the unit that is posed, traced and reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartInstance {
    /// The node that places it.
    pub node: NodeId,
    /// Its mesh.
    pub mesh: MeshId,
    /// The part (glTF primitive) within the mesh.
    pub part: u32,
    /// The copy's number under `EXT_mesh_gpu_instancing`, else `None`.
    pub copy: Option<u32>,
}

/// Everything a file holds that posing, tracing and shading need.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The file's name without its folder, for messages and pose files.
    pub file: String,
    /// Number of glTF scenes in the file.
    pub scene_count: usize,
    /// All nodes of the file, also those outside the default scene (joints may live there).
    pub nodes: Vec<SceneNode>,
    /// All nodes, each after its parent: the order in which global transforms are computed.
    pub eval_order: Vec<NodeId>,
    /// Nodes of the default scene depth first, a parent before its children, children in file order.
    pub draw_order: Vec<NodeId>,
    /// Part instances in pose order: `draw_order`, then copy, then part.
    pub instances: Vec<PartInstance>,
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Skins.
    pub skins: Vec<Skin>,
    /// Clips (glTF animations); a disabled one has a reason and no channels.
    pub clips: Vec<Clip>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures: image and sampling.
    pub textures: Vec<Texture>,
    /// Decoded images.
    pub images: Vec<Image>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Punctual lights.
    pub lights: Vec<Light>,
    /// Names in `extensionsUsed`.
    pub extensions_used: Vec<String>,
    /// Used extensions that this importer does not honour.
    pub extensions_ignored: Vec<String>,
    /// What was odd but could be worked around, one message each, naming the place in the file.
    pub warnings: Vec<String>,
}

impl Scene {
    /// The part behind an instance.
    pub fn part(&self, instance: PartInstance) -> &MeshPart {
        &self.meshes[instance.mesh.index()].parts[instance.part as usize]
    }

    /// Number of triangles in `instances`.
    pub fn triangles_drawn(&self) -> usize {
        self.instances.iter().map(|&i| self.part(i).triangles.len()).sum()
    }
}
