//! Lit shading: materials, lights with shadows, surroundings.

use glam::{Vec3, Vec4};

use super::{
    brdf::{Reflectance, View},
    context::FrameContext,
    filter::{Blocking, blocking, layer_key},
    lights::terminator,
    material::{Coverage, ShadeMaterial},
    math::disc,
    pattern::PixelSampler,
    surface::{Patch, Surface},
    texture::Footprint,
    tone::filmic_inverse,
};
use crate::{
    geom::{Hit, Ray},
    simd::Simd,
};

/// Least light that is worth a shadow ray.
const DARK: f32 = 1e-5;
/// Most blended layers that a shadow ray goes through.
const SHADOW_LAYERS: usize = 16;
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
    info: &'b super::context::InstanceInfo,
    patch: &'b Patch<'a>,
    known: Option<(u32, glam::Vec2, Footprint)>,
}

impl Maps<'_, '_> {
    #[inline(always)]
    fn read(&mut self, binding: Option<&super::material::Binding>) -> Option<Vec4> {
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
    #[inline(always)]
    pub(crate) fn new(ctx: &FrameContext<'_>, ray: &Ray, hit: &Hit) -> Self {
        let info = ctx.info(hit.instance);
        let material = ctx.material(info);
        let mut patch = Patch::new(ctx, info, hit);
        if !material.is_plain() || ctx.blends {
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
        let width = if ctx.blends { patch.width() } else { 0.0 };
        Self { surface, reflectance: finish.reflectance, view, color, alpha, width, lit: !material.unlit }
    }

    /// Adds the light of every source. Returns the number of shadow rays.
    #[inline(always)]
    pub(crate) fn add_lights<S: Simd>(&mut self, ctx: &FrameContext<'_>, random: &PixelSampler) -> u64 {
        let mut rays = 0;
        if !self.lit || self.alpha <= 0.0 {
            return 0;
        }
        for (number, light) in ctx.lights.iter().enumerate() {
            // The first sample sees the light's centre, so that one sample a pixel gives clean edges.
            let spot = if light.has_size() && random.index() > 0 {
                #[expect(clippy::cast_possible_truncation, reason = "a handful of lights")]
                let (u, v) = random.square(LIGHT_PATTERN + number as u32, 0, 1);
                disc(u, v)
            } else {
                (0.0, 0.0)
            };
            let Some(incident) = light.incident(self.surface.point, spot) else { continue };
            let surface = &self.surface;
            let shade_cos = surface.n_shade.dot(incident.dir);
            let geom_cos = surface.n_geom.dot(incident.dir);
            if shade_cos <= 0.0 || geom_cos <= 0.0 {
                continue;
            }
            let reflected =
                self.reflectance.evaluate(&self.view, surface.n_shade, surface.view, incident.dir, shade_cos);
            let light = reflected * incident.level * terminator(geom_cos, shade_cos, surface.between);
            if light.max_element() > DARK {
                let shadow = shadow_ray(surface, incident.dir, incident.distance);
                let (through, cast) = transmittance::<S>(ctx, &shadow, self.width);
                rays += cast;
                self.color += light * through;
            }
        }
        rays
    }
}

/// Material values at a point.
struct Finish {
    reflectance: Reflectance,
    emitted: Vec3,
    occlusion: f32,
}

impl Finish {
    #[inline(always)]
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

#[inline(always)]
fn surroundings(ctx: &FrameContext<'_>, surface: &Surface, finish: &Finish, view: &View) -> Vec3 {
    let n = surface.n_shade;
    let mirrored = n * (2.0 * n.dot(surface.view)) - surface.view;
    // Directions below the facet would mirror what the surface itself hides.
    let below = mirrored.dot(surface.n_geom).min(0.0);
    let mirrored = super::math::unit_or(mirrored - surface.n_geom * (2.0 * below), n);
    let around = ctx.sky.mirrored(mirrored, finish.reflectance.roughness);
    Reflectance::surroundings(view, ctx.sky.irradiance(n), around) * finish.occlusion
}

#[inline(always)]
fn shadow_ray(surface: &Surface, dir: Vec3, distance: f32) -> Ray {
    let t_far = if distance.is_finite() { distance * 0.9995 } else { f32::INFINITY };
    Ray { origin: surface.shadow_origin(dir), dir, t_near: 0.0, t_far }
}

/// The part of a light that reaches the ray's origin, and the number of rays it took.
///
/// Blended layers dim the light in order of (t, instance, prim), so that the product does not depend on the order in
/// which a structure finds them.
#[inline(always)]
fn transmittance<S: Simd>(ctx: &FrameContext<'_>, ray: &Ray, width: f32) -> (f32, u64) {
    let layered = std::cell::Cell::new(false);
    let stops = |hit: &Hit| match blocking(ctx, width, hit) {
        Blocking::Whole => true,
        Blocking::None => false,
        Blocking::Part(alpha) => {
            layered.set(layered.get() || alpha > 0.0);
            alpha >= 1.0
        }
    };
    if ctx.world.is_occluded::<S, _>(ray, &stops) {
        return (0.0, 1);
    }
    if layered.get() { through_layers::<S>(ctx, ray, width) } else { (1.0, 1) }
}

#[inline(always)]
fn through_layers<S: Simd>(ctx: &FrameContext<'_>, ray: &Ray, width: f32) -> (f32, u64) {
    let (mut through, mut rays, mut after, mut ray) = (1.0, 1, None, *ray);
    for _ in 0..SHADOW_LAYERS {
        rays += 1;
        let next = |hit: &Hit| {
            let behind = after.is_none_or(|last| layer_key(hit) > last);
            behind && blocking(ctx, width, hit) != Blocking::None
        };
        let Some(hit) = ctx.world.closest_hit::<S, _>(&ray, &next) else { return (through, rays) };
        if let Blocking::Part(alpha) = blocking(ctx, width, &hit) {
            through *= 1.0 - alpha;
        }
        (after, ray.t_near) = (Some(layer_key(&hit)), hit.t);
    }
    (through, rays)
}
