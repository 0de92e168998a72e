//! Shadings that need no materials: eyelight, normals, depth, ambient occlusion. Display-linear colours.

use glam::Vec3;

use super::{
    Shading,
    block::Probe,
    context::FrameContext,
    math::{disc, frame},
    pattern::PixelSampler,
    surface::{Patch, Surface},
};
use crate::geom::{Hit, Ray};

/// Occlusion rays a sample.
const AO_RAYS: u32 = 4;
/// Reflectance of the eyelight's clay.
const CLAY: Vec3 = Vec3::new(0.86, 0.84, 0.80);
/// Purpose number of the pattern over the hemisphere.
const AO_PATTERN: u32 = 0;

/// A point without material: its display colour, and what occlusion rays start from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlainPoint {
    pub(crate) color: Vec3,
    surface: Option<Surface>,
}

impl PlainPoint {
    /// Secondary rays a point of a shading.
    pub(crate) fn probe_count(shading: Shading) -> usize {
        if shading == Shading::Ao { AO_RAYS as usize } else { 0 }
    }

    /// What `ray` sees at `hit`; ambient occlusion begins black.
    pub(crate) fn new(ctx: &FrameContext<'_>, ray: &Ray, hit: &Hit) -> Self {
        if ctx.settings.shading == Shading::Depth {
            return Self { color: Vec3::splat(depth(ctx.depth_range, hit.t)), surface: None };
        }
        let info = ctx.info(hit.instance);
        let mut patch = Patch::new(ctx, info, hit);
        if ctx.material(info).normal_map.is_some() {
            patch = patch.with_steps(ctx, ray, hit.t);
        }
        let surface = Surface::new(ctx, info, &patch, ray, hit);
        let color = match ctx.settings.shading {
            Shading::Normals => encoded_normal(surface.n_shade),
            Shading::Ao => Vec3::ZERO,
            _ => CLAY * surface.n_shade.dot(surface.view).clamp(0.0, 1.0),
        };
        Self { color, surface: Some(surface) }
    }

    /// Occlusion ray `number`, drawn from the cosine-weighted hemisphere within the context's reach.
    pub(crate) fn probe(&self, ctx: &FrameContext<'_>, number: usize, random: &PixelSampler) -> Option<Probe> {
        let surface = self.surface.as_ref()?;
        let n = surface.n_shade;
        let (a, b) = frame(n);
        #[expect(clippy::cast_possible_truncation, reason = "a handful of rays")]
        let (u, v) = random.square(AO_PATTERN, number as u32, AO_RAYS);
        let (x, y) = disc(u, v);
        let mut dir = a * x + b * y + n * (1.0 - x * x - y * y).max(0.0).sqrt();
        // Directions below the facet are mirrored to its upper side.
        dir -= surface.n_geom * (2.0 * dir.dot(surface.n_geom).min(0.0));
        let ray = Ray { origin: surface.origin(dir), dir, t_near: 0.0, t_far: ctx.reach };
        Some(Probe { ray, light: Vec3::splat(1.0 / AO_RAYS as f32), width: 0.0 })
    }
}

/// Components of [-1, 1] as sRGB codes 0 to 255, so that a file's bytes are the normal.
#[inline(always)]
fn encoded_normal(n: Vec3) -> Vec3 {
    let channel = |x: f32| super::tone::linear_of((x * 0.5 + 0.5).clamp(0.0, 1.0));
    Vec3::new(channel(n.x), channel(n.y), channel(n.z))
}

/// White at the nearest depth of the scene, dark grey at the farthest.
#[inline(always)]
fn depth([near, far]: [f32; 2], t: f32) -> f32 {
    let part = ((t - near) / (far - near)).clamp(0.0, 1.0);
    // NaN when the scene has no depth at all.
    if part >= 0.0 { 1.0 - 0.96 * part } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_white_near_and_dark_far() {
        assert_eq!(depth([1.0, 3.0], 1.0), 1.0);
        assert!((depth([1.0, 3.0], 3.0) - 0.04).abs() < 1e-6);
        assert_eq!(depth([2.0, 2.0], 2.0), 1.0);
        assert_eq!(depth([f32::INFINITY, 0.0], 2.0), 1.0);
    }

    #[test]
    fn normals_are_stored_as_plain_codes() {
        let table = super::super::tone::Srgb8::get();
        let code = |x: f32| table.encode(encoded_normal(Vec3::new(x, 0.0, 0.0)).x);
        assert_eq!((code(-1.0), code(0.0), code(1.0)), (0, 128, 255));
        assert_eq!(code(0.5), 191);
    }
}
