//! Lit shading: materials, lights with shadows, surroundings.

use glam::{Vec2, Vec3, Vec4};

use super::{
    block::Probe,
    brdf::{Reflectance, View},
    context::{FrameContext, InstanceInfo},
    lights::{Incident, terminator},
    material::{Binding, Coverage, ShadeMaterial},
    math::{disc, unit_or},
    pattern::PixelSampler,
    surface::{Patch, Surface},
    texture::Footprint,
    tone::filmic_inverse,
};
use crate::geom::{Hit, Ray};

/// Least light that is worth a shadow ray.
const DARK: f32 = 1e-5;
/// Purpose number of the pattern that picks points on lights.
const LIGHT_PATTERN: u32 = 1;

/// A surface point with everything that shading needs, before any light is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadePoint {
    surface: Surface,
    reflectance: Reflectance,
    view: View,
    /// Light that leaves towards the viewer.
    pub(crate) color: Vec3,
    /// Part of the light behind that is stopped.
    pub(crate) alpha: f32,
    /// Width of the pixel's footprint in metres.
    width: f32,
    lit: bool,
}

/// Texture look-ups at one patch: coordinates are found once for maps that share a set.
struct Maps<'a, 'b> {
    ctx: &'b FrameContext<'a>,
    info: &'b InstanceInfo,
    patch: &'b Patch<'a>,
    known: Option<(u32, Vec2, Footprint)>,
}

impl Maps<'_, '_> {
    fn read(&mut self, binding: Option<&Binding>) -> Option<Vec4> {
        let binding = binding?;
        let (uv, footprint) = match self.known {
            Some((set, uv, footprint)) if set == binding.set => (uv, footprint),
            _ => self.patch.coordinates(binding.set),
        };
        self.known = Some((binding.set, uv, footprint));
        Some(binding.read(&self.ctx.scene(self.info).pyramids, uv, &footprint))
    }
}

fn rgb(v: Vec4) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

impl ShadePoint {
    /// What `ray` sees at `hit`: emission and the reflected surroundings are in `color`, lights are still to come.
    pub(crate) fn new(ctx: &FrameContext<'_>, ray: &Ray, hit: &Hit) -> Self {
        let info = ctx.info(hit.instance);
        let material = ctx.material(info);
        let mut patch = Patch::new(ctx, info, hit);
        if !material.is_plain() || ctx.pierced {
            patch = patch.with_steps(ctx, ray, hit.t);
        }
        let surface = Surface::new(ctx, info, &patch, ray, hit);
        let mut maps = Maps { ctx, info, patch: &patch, known: None };

        let mut base = material.base;
        if let Some(texel) = maps.read(material.base_map.as_ref()) {
            base *= texel;
        }
        if !patch.part.colors.is_empty() {
            let [a, b, c] = patch.vertices.map(|i| patch.part.colors[i as usize]);
            let [w, u, v] = patch.weights;
            base *= a * w + b * u + c * v;
        }
        let alpha = if material.coverage == Coverage::Blend { base.w.clamp(0.0, 1.0) } else { 1.0 };
        let finish = Finish::new(material, &mut maps, rgb(base), surface.map_length);
        let cos = surface.n_shade.dot(surface.view).clamp(1e-3, 1.0);
        let view = finish.reflectance.view(cos);
        let color = if material.unlit {
            filmic_inverse(rgb(base))
        } else {
            finish.emitted * ctx.emission + surroundings(ctx, &surface, &finish, &view)
        };
        let width = if ctx.pierced { patch.width() } else { 0.0 };
        Self { surface, reflectance: finish.reflectance, view, color, alpha, width, lit: !material.unlit }
    }

    /// The ray to light `number` with the light that it may bring; `None` when that is none anyway.
    pub(crate) fn probe(&self, ctx: &FrameContext<'_>, number: usize, random: &PixelSampler) -> Option<Probe> {
        if !self.lit || self.alpha <= 0.0 {
            return None;
        }
        let light = &ctx.lights[number];
        // The first sample sees the light's centre, so that one sample a pixel gives clean edges.
        let spot = if light.has_size() && random.index() > 0 {
            #[expect(clippy::cast_possible_truncation, reason = "a handful of lights")]
            let (u, v) = random.square(LIGHT_PATTERN + number as u32, 0, 1);
            disc(u, v)
        } else {
            (0.0, 0.0)
        };
        let surface = &self.surface;
        let Incident { dir, level, distance } = light.incident(surface.point, spot)?;
        let (shade_cos, geom_cos) = (surface.n_shade.dot(dir), surface.n_geom.dot(dir));
        if shade_cos <= 0.0 || geom_cos <= 0.0 {
            return None;
        }
        let reflected = self.reflectance.evaluate(&self.view, surface.n_shade, surface.view, dir, shade_cos);
        let light = reflected * level * terminator(geom_cos, shade_cos, surface.between);
        let t_far = if distance.is_finite() { distance * 0.9995 } else { f32::INFINITY };
        let ray = Ray { origin: surface.shadow_origin(dir), dir, t_near: 0.0, t_far };
        (light.max_element() > DARK).then_some(Probe { ray, light, width: self.width })
    }
}

/// Material values at a point.
struct Finish {
    reflectance: Reflectance,
    emitted: Vec3,
    occlusion: f32,
}

impl Finish {
    fn new(m: &ShadeMaterial, maps: &mut Maps<'_, '_>, base: Vec3, map_length: f32) -> Self {
        let (mut metallic, mut roughness, mut occlusion, mut emitted) = (m.metallic, m.roughness, 1.0, m.emissive);
        if let Some(texel) = maps.read(m.rough_map.as_ref()) {
            roughness *= texel.y;
            metallic *= texel.z;
        }
        if let Some(texel) = maps.read(m.occlusion_map.as_ref()) {
            occlusion = 1.0 + m.occlusion_strength * (texel.x - 1.0);
        }
        if let Some(texel) = maps.read(m.emissive_map.as_ref()) {
            emitted *= rgb(texel);
        }
        Self { reflectance: Reflectance::new(base, metallic, widened(roughness, map_length)), emitted, occlusion }
    }
}

/// Roughness that takes over what a filtered normal map no longer shows.
///
/// # Source
/// Toksvig, "Mipmapping Normal Maps", 2005: a shortened mean normal stands for a spread of normals; the bound on
/// the widening is from Tokuyoshi and Kaplanyan, "Improved Geometric Specular Antialiasing", 2019.
#[inline(always)]
fn widened(roughness: f32, map_length: f32) -> f32 {
    // 8-bit normals are unit only within about a hundredth.
    let spread = (0.99 - map_length).max(0.0) / map_length.max(0.1);
    if spread == 0.0 {
        return roughness;
    }
    let alpha = roughness * roughness;
    (alpha * alpha + (2.0 * spread).min(0.18)).min(1.0).sqrt().sqrt()
}

fn surroundings(ctx: &FrameContext<'_>, surface: &Surface, finish: &Finish, view: &View) -> Vec3 {
    let n = surface.n_shade;
    let mirrored = n * (2.0 * n.dot(surface.view)) - surface.view;
    // Directions below the facet would mirror what the surface itself hides.
    let below = mirrored.dot(surface.n_geom).min(0.0);
    let mirrored = unit_or(mirrored - surface.n_geom * (2.0 * below), n);
    let around = ctx.sky.mirrored(mirrored, finish.reflectance.roughness);
    Reflectance::surroundings(view, ctx.sky.irradiance(n), around) * finish.occlusion
}
