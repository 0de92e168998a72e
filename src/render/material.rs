//! Materials as shading reads them: what each needs is decided once a scene.

use glam::{Vec2, Vec3, Vec4};

use super::texture::{Encoding, Pyramid};
use crate::scene::{AlphaMode, Material, MeshPart, Scene, TexSampler, TextureRef};

/// A texture bound to a material: pyramid, sampling, coordinate set and their transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Binding {
    pub(crate) pyramid: u32,
    pub(crate) sampler: TexSampler,
    /// TEXCOORD set.
    pub(crate) set: u32,
    /// Rows of the 2 x 2 matrix that takes file coordinates to the texture's, then the offset.
    pub(crate) rows: [Vec2; 2],
    pub(crate) offset: Vec2,
}

/// What of a material a texture scales.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Channel {
    Base,
    Rough,
    Normal,
    Occlusion,
    Emissive,
}

/// How a surface treats rays that meet it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Coverage {
    /// Stops them.
    Opaque,
    /// Stops them where alpha reaches the cutoff.
    Mask(f32),
    /// Stops a part of their light.
    Blend,
}

/// A material ready for shading. Textures that cannot show (factor zero, missing image) are left out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadeMaterial {
    pub(crate) base: Vec4,
    pub(crate) metallic: f32,
    pub(crate) roughness: f32,
    pub(crate) emissive: Vec3,
    pub(crate) normal_scale: f32,
    pub(crate) occlusion_strength: f32,
    pub(crate) coverage: Coverage,
    pub(crate) double_sided: bool,
    pub(crate) unlit: bool,
    /// By [`Channel`].
    maps: [Option<Binding>; 5],
}

impl ShadeMaterial {
    /// The texture of a channel.
    #[inline(always)]
    pub(crate) fn map(&self, channel: Channel) -> Option<&Binding> {
        self.maps[channel as usize].as_ref()
    }

    /// True when nothing is read at texture coordinates.
    #[inline(always)]
    pub(crate) fn is_plain(&self) -> bool {
        self.maps.iter().all(Option::is_none)
    }
}

/// Builds materials and, with them, only the pyramids that they read.
pub(crate) struct MaterialMaker<'a> {
    scene: &'a Scene,
    made: Vec<(u32, Encoding, bool)>,
    pyramids: Vec<Pyramid>,
}

impl<'a> MaterialMaker<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Self {
        Self { scene, made: Vec::new(), pyramids: Vec::new() }
    }

    /// The pyramids that the materials made so far refer to.
    pub(crate) fn into_pyramids(self) -> Vec<Pyramid> {
        self.pyramids
    }

    fn bind(&mut self, texture: Option<&TextureRef>, encoding: Encoding, needed: bool) -> Option<Binding> {
        let texture = texture.filter(|_| needed)?;
        let source = self.scene.textures.get(texture.texture.index())?;
        let id = source.image?;
        let image = self.scene.images.get(id.index())?;
        if image.width == 0 || image.height == 0 || image.rgba.len() < 4 * image.width as usize * image.height as usize
        {
            return None;
        }
        let key = (id.0, encoding, source.sampler.mip.is_some());
        let index = self.made.iter().position(|k| *k == key).unwrap_or_else(|| {
            self.made.push(key);
            self.pyramids.push(Pyramid::new(image, encoding, key.2));
            self.made.len() - 1
        });
        let (sin, cos) = (libm::sinf(texture.rotation), libm::cosf(texture.rotation));
        let scale = texture.scale;
        Some(Binding {
            pyramid: u32::try_from(index).ok()?,
            sampler: source.sampler,
            set: texture.tex_coord,
            rows: [Vec2::new(cos * scale.x, sin * scale.y), Vec2::new(-sin * scale.x, cos * scale.y)],
            offset: texture.offset,
        })
    }

    /// The shading form of a material.
    pub(crate) fn make(&mut self, m: &Material) -> ShadeMaterial {
        let lit = !m.unlit;
        ShadeMaterial {
            base: finite4(m.base_color),
            metallic: finite(m.metallic).clamp(0.0, 1.0),
            roughness: finite(m.roughness).clamp(0.0, 1.0),
            emissive: if lit { finite3(m.emissive) } else { Vec3::ZERO },
            normal_scale: finite(m.normal_scale),
            occlusion_strength: finite(m.occlusion_strength).clamp(0.0, 1.0),
            coverage: match m.alpha_mode {
                AlphaMode::Opaque => Coverage::Opaque,
                AlphaMode::Mask { cutoff } => Coverage::Mask(cutoff),
                AlphaMode::Blend => Coverage::Blend,
            },
            double_sided: m.double_sided,
            unlit: m.unlit,
            maps: [
                self.bind(m.base_color_texture.as_ref(), Encoding::Srgb, true),
                self.bind(
                    m.metallic_roughness_texture.as_ref(),
                    Encoding::Linear,
                    lit && (m.metallic > 0.0 || m.roughness > 0.0),
                ),
                self.bind(m.normal_texture.as_ref(), Encoding::Linear, lit),
                self.bind(m.occlusion_texture.as_ref(), Encoding::Linear, lit && m.occlusion_strength > 0.0),
                self.bind(m.emissive_texture.as_ref(), Encoding::Srgb, lit && m.emissive.max_element() > 0.0),
            ],
        }
    }
}

/// `material` for a part that lacks some of the coordinates it reads: those textures are read at (0, 0), as an
/// absent attribute is zero.
#[inline(always)]
pub(crate) fn tex_coord(part: &MeshPart, set: u32, triangle: [u32; 3]) -> [Vec2; 3] {
    match part.tex_coords.get(set as usize) {
        Some(coords) if !coords.is_empty() => triangle.map(|i| coords[i as usize]),
        _ => [Vec2::ZERO; 3],
    }
}

fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

fn finite3(v: Vec3) -> Vec3 {
    Vec3::new(finite(v.x), finite(v.y), finite(v.z)).max(Vec3::ZERO)
}

fn finite4(v: Vec4) -> Vec4 {
    Vec4::new(finite(v.x), finite(v.y), finite(v.z), finite(v.w)).max(Vec4::ZERO)
}
