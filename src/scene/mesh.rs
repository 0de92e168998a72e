use glam::{Vec2, Vec3, Vec4};

use super::MaterialId;

/// A glTF mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name, empty when the file has none.
    pub name: String,
    /// Parts (glTF primitives) in file order, whatever their topology.
    pub parts: Vec<MeshPart>,
    /// Default morph weights; as long as the longest target list of the parts, missing ones 0.
    pub weights: Vec<f32>,
}

/// What a part's indices meant in the file. Only triangles are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// A list, strip or fan of triangles, all stored as a list.
    Triangles,
    /// Lines in any form: posed, not traced.
    Lines,
    /// Points: posed, not traced.
    Points,
}

/// A glTF primitive: vertices in POSITION accessor order and the triangles over them.
///
/// Optional attributes are empty when the file has none, else one entry a vertex.
#[derive(Clone, Debug)]
pub struct MeshPart {
    /// What the file's indices meant.
    pub topology: Topology,
    /// Rest positions, mesh space, dequantised.
    pub positions: Vec<Vec3>,
    /// Corners of each triangle, in the file's order and winding; empty for lines and points.
    pub triangles: Vec<[u32; 3]>,
    /// Unit normals in mesh space.
    pub normals: Vec<Vec3>,
    /// Tangents; `w` is the sign of the bitangent.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates by set: `TEXCOORD_0`, `TEXCOORD_1`, ...
    pub tex_coords: Vec<Vec<Vec2>>,
    /// Linear vertex colours with alpha (`COLOR_0`).
    pub colors: Vec<Vec4>,
    /// Joints and weights; `None` without `JOINTS_0`.
    pub influences: Option<Influences>,
    /// Morph targets.
    pub targets: Vec<MorphTarget>,
    /// Material; `None` is glTF's default material.
    pub material: Option<MaterialId>,
}

/// Joint influences of a part's vertices, all `JOINTS_n` / `WEIGHTS_n` sets together.
#[derive(Clone, Debug, Default)]
pub struct Influences {
    /// Influences a vertex: 4 times the number of sets.
    pub per_vertex: usize,
    /// Joint numbers in the skin's list, `per_vertex` each vertex; in range for every skin used with the part,
    /// but for the first joint of a vertex whose weights are all zero, which may be any number.
    pub joints: Vec<u16>,
    /// Weights as the file has them (dequantised, not normalised), `per_vertex` each vertex.
    pub weights: Vec<f32>,
}

/// Displacements of one morph target; an empty array means none of that attribute.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// Position displacements.
    pub positions: Vec<Vec3>,
    /// Normal displacements.
    pub normals: Vec<Vec3>,
    /// Tangent displacements (direction only).
    pub tangents: Vec<Vec3>,
}
