//! Lit shading: materials, lights with shadows, surroundings.

use glam::Vec3;

use super::{
    brdf::{Reflectance, View},
    context::FrameContext,
    found::{Maps, Spots},
    lights::{Incident, terminator},
    material::{Channel, Coverage},
    math::disc,
    patch::Patch,
    pattern::Samplers,
    probe::{Points, Probes},
    surface::Surface,
    tone::filmic_inverse,
    wide::{Bits, Floats, LANES, V3, clamp, put2},
};

/// Least light that is worth a shadow ray.
const DARK: f32 = 1e-5;
/// Part of the way to a light that must be clear: a light may lie in a surface. A wall right in front of one is not missed.
///
/// # Source
/// `ShadowEpsilon` of Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, section 14.3.
const REACH: f32 = 0.9999;
/// Purpose number of the pattern that picks points on lights.
const LIGHT_PATTERN: u32 = 1;

/// Surface points with everything that shading needs, before any light is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LitPoints<'s, F> {
    surface: &'s Surface<'s, F>,
    reflectance: Reflectance<F>,
    view: View<F>,
    /// Light that leaves towards the viewer.
    color: V3<F>,
    /// Part of the light behind that is stopped.
    alpha: F,
    /// Width of the pixel's footprint in metres.
    width: F,
    /// Lanes that lights reach.
    lit: u32,
}

impl<'s, F: Floats> LitPoints<'s, F> {
    /// The points of `surface`, which lies at `spots` on `patch`: emission and the reflected surroundings are in `color`,
    /// lights are still to come.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new<'a>(
        ctx: &FrameContext<'a>,
        spots: &Spots<'a>,
        patch: &Patch<F>,
        mut maps: Maps<'a, '_, F>,
        surface: &'s Surface<'s, F>,
    ) -> Self {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let mut base = spots.vector::<F>(|spot| spot.material.base.truncate());
        let mut alpha = spots.number::<F>(|spot| spot.material.base.w);
        if let Some(placed) = maps.place(Channel::Base) {
            let [x, y, z, w] = maps.read(&placed);
            base = V3::select(placed.mask, base.times(V3 { x, y, z }), base);
            alpha = F::select(placed.mask, alpha * w, alpha);
        }
        let (colored, [x, y, z, w]) = spots.colors(patch);
        if colored != 0 {
            base = V3::select(colored, base.times(V3 { x, y, z }), base);
            alpha = F::select(colored, alpha * w, alpha);
        }
        let blended = spots.lanes(|spot| spot.material.coverage == Coverage::Blend);
        let alpha = F::select(blended, clamp(alpha, 0.0, 1.0), one);
        let finish = Finish::new(spots, &mut maps, base, surface.map_length);
        let cos = clamp(surface.n_shade.dot(surface.view), 1e-3, 1.0);
        let view = finish.reflectance.view(cos);
        let mut color = finish.emitted * F::splat(ctx.emission) + surroundings(ctx, surface, &finish, &view);
        let unlit = spots.lanes(|spot| spot.material.unlit);
        if unlit != 0 {
            color = V3::select(unlit, as_authored(unlit, base), color);
        }
        let width = if ctx.pierced { patch.width() } else { zero };
        let lit = spots.mask & !unlit & zero.lt(alpha);
        Self { surface, reflectance: finish.reflectance, view, color, alpha, width, lit }
    }
}

impl<F: Floats> Points<F> for LitPoints<'_, F> {
    /// The rays to light `number` with the light that they may bring.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn probes(&self, ctx: &FrameContext<'_>, number: usize, random: &Samplers) -> Probes<F> {
        let light = &ctx.lights[number];
        // The first sample sees the light's centre, so that one sample a pixel gives clean edges.
        let mut spots = None;
        if light.has_size() && random.sample > 0 {
            let mut rows = [[0.0; LANES]; 2];
            for lane in Bits(self.lit) {
                #[expect(clippy::cast_possible_truncation, reason = "a handful of lights")]
                let (u, v) = random.at(lane).square(LIGHT_PATTERN + number as u32, 0, 1);
                put2(&mut rows, lane, disc(u, v).into());
            }
            spots = Some(rows);
        }
        let surface = self.surface;
        let Incident { mask, dir, level, distance } = light.incident(surface.point, spots.as_ref());
        let (shade_cos, geom_cos) = (surface.n_shade.dot(dir), surface.n_geom.dot(dir));
        let zero = F::splat(0.0);
        let mask = self.lit & mask & zero.lt(shade_cos) & zero.lt(geom_cos);
        let reflected = self.reflectance.evaluate(&self.view, surface.n_shade, surface.view, dir, shade_cos);
        let light = reflected.times(level) * terminator(geom_cos, shade_cos, surface.between);
        // Infinite distances stay infinite.
        let t_far = distance * F::splat(REACH);
        Probes {
            mask: mask & F::splat(DARK).lt(light.max_element()),
            origin: surface.shadow_origin(dir),
            dir,
            t_far,
            light,
            width: self.width,
        }
    }

    #[inline(always)]
    fn add(&mut self, mask: u32, light: V3<F>) {
        self.color = V3::select(mask, self.color + light, self.color);
    }

    #[inline(always)]
    fn result(&self) -> (V3<F>, F) {
        (self.color, self.alpha)
    }
}

/// What unlit surfaces emit so that they are shown as authored.
#[inline(always)]
fn as_authored<F: Floats>(mask: u32, base: V3<F>) -> V3<F> {
    let mut rows = base.rows();
    for lane in Bits(mask) {
        let shown = filmic_inverse(Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]));
        super::wide::put3(&mut rows, lane, shown);
    }
    V3::load(&rows)
}

/// Material values at points.
struct Finish<F> {
    reflectance: Reflectance<F>,
    emitted: V3<F>,
    occlusion: F,
}

impl<F: Floats> Finish<F> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn new(spots: &Spots<'_>, maps: &mut Maps<'_, '_, F>, base: V3<F>, map_length: F) -> Self {
        let one = F::splat(1.0);
        let mut metallic = spots.number::<F>(|spot| spot.material.metallic);
        let mut roughness = spots.number::<F>(|spot| spot.material.roughness);
        let mut emitted = spots.vector::<F>(|spot| spot.material.emissive);
        let mut occlusion = one;
        let rough = maps.place(Channel::Rough);
        let mut rough_texel = [one; 4];
        if let Some(placed) = &rough {
            rough_texel = maps.read(placed);
            roughness = F::select(placed.mask, roughness * rough_texel[1], roughness);
            metallic = F::select(placed.mask, metallic * rough_texel[2], metallic);
        }
        if let Some(placed) = maps.place(Channel::Occlusion) {
            // Files often keep both in one image.
            let shared = rough.is_some_and(|rough| rough.is(&placed));
            let texel = if shared { rough_texel } else { maps.read(&placed) };
            let strength = spots.number::<F>(|spot| spot.material.occlusion_strength);
            occlusion = F::select(placed.mask, one + strength * (texel[0] - one), one);
        }
        if let Some(placed) = maps.place(Channel::Emissive) {
            let [x, y, z, _] = maps.read(&placed);
            emitted = V3::select(placed.mask, emitted.times(V3 { x, y, z }), emitted);
        }
        Self { reflectance: Reflectance::new(base, metallic, widened(roughness, map_length)), emitted, occlusion }
    }
}

/// Roughness that takes over what a filtered normal map no longer shows.
///
/// # Source
/// Toksvig, "Mipmapping Normal Maps", 2005: a shortened mean normal stands for a spread of normals; the bound on
/// the widening is from Tokuyoshi and Kaplanyan, "Improved Geometric Specular Antialiasing", 2019.
#[cfg_attr(not(debug_assertions), inline(always))]
fn widened<F: Floats>(roughness: F, map_length: F) -> F {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    // 8-bit normals are unit only within about a hundredth.
    let spread = (F::splat(0.99) - map_length).max(zero) / map_length.max(F::splat(0.1));
    let spreads = zero.lt(spread);
    if spreads == 0 {
        return roughness;
    }
    let alpha = roughness * roughness;
    let wider = (alpha * alpha + (F::splat(2.0) * spread).min(F::splat(0.18))).min(one).sqrt().sqrt();
    F::select(spreads, wider, roughness)
}

#[cfg_attr(not(debug_assertions), inline(always))]
fn surroundings<F: Floats>(
    ctx: &FrameContext<'_>,
    surface: &Surface<'_, F>,
    finish: &Finish<F>,
    view: &View<F>,
) -> V3<F> {
    let two = F::splat(2.0);
    let n = surface.n_shade;
    let mirrored = n * (two * n.dot(surface.view)) - surface.view;
    // Directions below the facet would mirror what the surface itself hides.
    let below = mirrored.dot(surface.n_geom).min(F::splat(0.0));
    let mirrored = (mirrored - surface.n_geom * (two * below)).unit_or(n);
    let around = ctx.sky.mirrored(mirrored, finish.reflectance.roughness);
    Reflectance::surroundings(view, ctx.sky.irradiance(n), around) * finish.occlusion
}
