//! Materials as shading reads them: what each needs is decided once a scene.

use glam::{Vec2, Vec3, Vec4};

use super::texture::{Encoding, Footprint, Pyramid, sample};
use crate::scene::{AlphaMode, Material, MeshPart, Scene, TexSampler, TextureRef};

/// A texture bound to a material: pyramid, sampling, coordinate set and their transform.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binding {
    pyramid: u32,
    sampler: TexSampler,
    /// TEXCOORD set.
    pub(crate) set: u32,
    /// Rows of the 2 x 2 matrix, then the offset.
    rows: [Vec2; 2],
    offset: Vec2,
}

impl Binding {
    /// Where the texture is read for file coordinates `uv`.
    #[inline(always)]
    fn place(&self, uv: Vec2) -> Vec2 {
        self.turn(uv) + self.offset
    }

    /// [`Binding::place`] for differences.
    #[inline(always)]
    pub(crate) fn turn(&self, uv: Vec2) -> Vec2 {
        Vec2::new(self.rows[0].x * uv.x + self.rows[0].y * uv.y, self.rows[1].x * uv.x + self.rows[1].y * uv.y)
    }

    /// The filtered texel at file coordinates `uv`.
    pub(crate) fn read(&self, pyramids: &[Pyramid], uv: Vec2, footprint: &Footprint) -> Vec4 {
        let footprint = Footprint { dx: self.turn(footprint.dx), dy: self.turn(footprint.dy) };
        sample(&pyramids[self.pyramid as usize], self.sampler, self.place(uv), &footprint)
    }
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
    pub(crate) base_map: Option<Binding>,
    pub(crate) rough_map: Option<Binding>,
    pub(crate) normal_map: Option<Binding>,
    pub(crate) occlusion_map: Option<Binding>,
    pub(crate) emissive_map: Option<Binding>,
}

impl ShadeMaterial {
    /// True when nothing is read at texture coordinates.
    #[inline(always)]
    pub(crate) fn is_plain(&self) -> bool {
        self.base_map.is_none()
            && self.rough_map.is_none()
            && self.normal_map.is_none()
            && self.occlusion_map.is_none()
            && self.emissive_map.is_none()
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
            base_map: self.bind(m.base_color_texture.as_ref(), Encoding::Srgb, true),
            rough_map: self.bind(
                m.metallic_roughness_texture.as_ref(),
                Encoding::Linear,
                lit && (m.metallic > 0.0 || m.roughness > 0.0),
            ),
            normal_map: self.bind(m.normal_texture.as_ref(), Encoding::Linear, lit),
            occlusion_map: self.bind(m.occlusion_texture.as_ref(), Encoding::Linear, lit && m.occlusion_strength > 0.0),
            emissive_map: self.bind(m.emissive_texture.as_ref(), Encoding::Srgb, lit && m.emissive.max_element() > 0.0),
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
