//! Shadings that need no materials: eyelight, normals, depth, ambient occlusion. Display-linear colours.

use glam::Vec3;

use super::{
    Shading,
    context::FrameContext,
    math::{disc, frame},
    pattern::PixelSampler,
    surface::{Patch, Surface},
};
use crate::{
    geom::{Hit, Ray},
    simd::Simd,
};

/// Occlusion rays a sample.
const AO_RAYS: u32 = 4;
/// Purpose number of the pattern over the hemisphere.
const AO_PATTERN: u32 = 0;

/// The display colour at `hit` and the number of further rays it took.
#[inline(always)]
pub(crate) fn color<S: Simd>(ctx: &FrameContext<'_>, ray: &Ray, hit: &Hit, random: &PixelSampler) -> (Vec3, u64) {
    if ctx.settings.shading == Shading::Depth {
        return (Vec3::splat(depth(ctx.depth_range, hit.t)), 0);
    }
    let info = ctx.info(hit.instance);
    let mut patch = Patch::new(ctx, info, hit);
    if ctx.material(info).normal_map.is_some() {
        patch = patch.with_steps(ctx, ray, hit.t);
    }
    let surface = Surface::new(ctx, info, &patch, ray, hit);
    match ctx.settings.shading {
        Shading::Normals => (encoded_normal(surface.n_shade), 0),
        Shading::Ao => (Vec3::splat(openness::<S>(ctx, &surface, random)), u64::from(AO_RAYS)),
        _ => (Vec3::new(0.86, 0.84, 0.80) * surface.n_shade.dot(surface.view).clamp(0.0, 1.0), 0),
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

/// Part of the cosine-weighted hemisphere that is open within the context's reach.
#[inline(always)]
fn openness<S: Simd>(ctx: &FrameContext<'_>, surface: &Surface, random: &PixelSampler) -> f32 {
    let n = surface.n_shade;
    let (a, b) = frame(n);
    let mut open = 0u32;
    for i in 0..AO_RAYS {
        let (u, v) = random.square(AO_PATTERN, i, AO_RAYS);
        let (x, y) = disc(u, v);
        let mut dir = a * x + b * y + n * (1.0 - x * x - y * y).max(0.0).sqrt();
        // Directions below the facet are mirrored to its upper side.
        dir -= surface.n_geom * (2.0 * dir.dot(surface.n_geom).min(0.0));
        let ray = Ray { origin: surface.origin(dir), dir, t_near: 0.0, t_far: ctx.reach };
        let solid = |hit: &Hit| super::filter::is_solid(ctx, hit);
        open += u32::from(!ctx.world.is_occluded::<S, _>(&ray, &solid));
    }
    open as f32 / AO_RAYS as f32
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
