//! Which hits count: culled back faces, holes of masked materials, layers already passed.

use super::{
    context::{FrameContext, InstanceInfo},
    material::Coverage,
    surface::Patch,
};
use crate::geom::{Hit, Ray};

/// Place of a hit in the order of blending.
pub(crate) type LayerKey = (f32, u32, u32);

/// The key of a hit: least `t`, then instance, then triangle.
#[inline(always)]
pub(crate) fn layer_key(hit: &Hit) -> LayerKey {
    (hit.t, hit.instance.0, hit.prim.0)
}

/// True when a camera ray sees `hit`: not a culled back face, not in a hole, behind the layer `after`.
#[inline(always)]
pub(crate) fn is_seen(ctx: &FrameContext<'_>, ray: &Ray, after: Option<LayerKey>, hit: &Hit) -> bool {
    if after.is_some_and(|last| layer_key(hit) <= last) {
        return false;
    }
    let info = ctx.info(hit.instance);
    let material = ctx.material(info);
    if material.double_sided && material.coverage == Coverage::Opaque {
        return true;
    }
    let patch = Patch::new(ctx, info, hit);
    if !material.double_sided && (patch.cross.dot(ray.dir) > 0.0) != info.mirrored {
        return false;
    }
    match material.coverage {
        Coverage::Mask(cutoff) => alpha(ctx, info, &patch.with_steps(ctx, ray, hit.t)) >= cutoff,
        Coverage::Opaque => true,
        Coverage::Blend if ctx.settings.shading.is_lit() => true,
        // Without blending, what is mostly there is drawn.
        Coverage::Blend => alpha(ctx, info, &patch.with_steps(ctx, ray, hit.t)) >= 0.5,
    }
}

/// Alpha of the surface at `patch`: factor, texture and vertex colour.
#[inline(always)]
pub(crate) fn alpha(ctx: &FrameContext<'_>, info: &InstanceInfo, patch: &Patch<'_>) -> f32 {
    let material = ctx.material(info);
    let mut alpha = material.base.w;
    if let Some(binding) = &material.base_map {
        let (uv, footprint) = patch.coordinates(binding.set);
        alpha *= binding.read(&ctx.scene(info).pyramids, uv, &footprint).w;
    }
    if !patch.part.colors.is_empty() {
        let [a, b, c] = patch.vertices.map(|i| patch.part.colors[i as usize].w);
        let [w, u, v] = patch.weights;
        alpha *= a * w + b * u + c * v;
    }
    alpha
}

/// True when `hit` counts for ambient occlusion: not in a hole and mostly there, read at the finest level.
#[inline(always)]
pub(crate) fn is_solid(ctx: &FrameContext<'_>, hit: &Hit) -> bool {
    let info = ctx.info(hit.instance);
    let least = match ctx.material(info).coverage {
        Coverage::Opaque => return true,
        Coverage::Mask(cutoff) => cutoff,
        Coverage::Blend => 0.5,
    };
    alpha(ctx, info, &Patch::new(ctx, info, hit)) >= least
}

/// What a shadow ray finds on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Blocking {
    /// No light passes.
    Whole,
    /// A hole.
    None,
    /// A blended layer that stops this part of the light.
    Part(f32),
}

/// How much of a light `hit` stops; `width` is the footprint's width in metres.
#[inline(always)]
pub(crate) fn blocking(ctx: &FrameContext<'_>, width: f32, hit: &Hit) -> Blocking {
    let info = ctx.info(hit.instance);
    match ctx.material(info).coverage {
        Coverage::Opaque => Blocking::Whole,
        Coverage::Mask(cutoff) => {
            let patch = Patch::new(ctx, info, hit).with_width(width);
            if alpha(ctx, info, &patch) >= cutoff { Blocking::Whole } else { Blocking::None }
        }
        Coverage::Blend => {
            let patch = Patch::new(ctx, info, hit).with_width(width);
            Blocking::Part(alpha(ctx, info, &patch).clamp(0.0, 1.0))
        }
    }
}
