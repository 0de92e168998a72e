use glam::{Vec2, Vec3, Vec4};

use super::TextureId;

/// A metallic-roughness material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name, empty when the file has none.
    pub name: String,
    /// Linear base colour and alpha.
    pub base_color: Vec4,
    /// Base colour texture (sRGB with linear alpha).
    pub base_color_texture: Option<TextureRef>,
    /// Metalness in [0, 1].
    pub metallic: f32,
    /// Perceptual roughness in [0, 1].
    pub roughness: f32,
    /// Roughness in G, metalness in B (linear).
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals (linear).
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
    /// Ambient occlusion in R (linear).
    pub occlusion_texture: Option<TextureRef>,
    /// Strength of the occlusion in [0, 1].
    pub occlusion_strength: f32,
    /// Linear emitted radiance, `KHR_materials_emissive_strength` applied.
    pub emissive: Vec3,
    /// Emission texture (sRGB).
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is used.
    pub alpha_mode: AlphaMode,
    /// Both faces are drawn.
    pub double_sided: bool,
    /// `KHR_materials_unlit`: base colour is the answer.
    pub unlit: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

/// How alpha is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Surface where alpha is at least the cutoff, hole elsewhere.
    Mask {
        /// Least alpha that counts as surface.
        cutoff: f32,
    },
    /// Alpha blends with what lies behind, in order of `t`.
    Blend,
}

/// A texture with the coordinates it is read at (`KHR_texture_transform` applied as
/// `uv' = offset + rotate(rotation) * (scale * uv)`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// The texture.
    pub texture: TextureId,
    /// Which TEXCOORD set.
    pub tex_coord: u32,
    /// Offset.
    pub offset: Vec2,
    /// Rotation in radians as `KHR_texture_transform` defines it.
    pub rotation: f32,
    /// Scale.
    pub scale: Vec2,
}
