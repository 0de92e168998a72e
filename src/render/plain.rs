//! Shadings that need no materials: eyelight, normals, depth, ambient occlusion. Display-linear colours.

use glam::Vec3;

use super::{
    Shading,
    context::FrameContext,
    found::Spots,
    math::{disc, frame},
    pattern::Samplers,
    probe::{Points, Probes},
    surface::Surface,
    wide::{Bits, Floats, LANES, V3, clamp, put3, row},
};

/// Occlusion rays a sample.
const AO_RAYS: u32 = 4;
/// Reflectance of the eyelight's clay.
const CLAY: Vec3 = Vec3::new(0.86, 0.84, 0.80);
/// Purpose number of the pattern over the hemisphere.
const AO_PATTERN: u32 = 0;

/// Points without material: their display colours, and what occlusion rays start from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlainPoints<'s, F> {
    color: V3<F>,
    surface: &'s Surface<'s, F>,
    mask: u32,
}

/// Secondary rays a point of a shading.
pub(crate) fn probe_count(shading: Shading) -> usize {
    if shading == Shading::Ao { AO_RAYS as usize } else { 0 }
}

impl<'s, F: Floats> PlainPoints<'s, F> {
    /// The points of `surface`, which lies at `spots`; ambient occlusion begins black.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new(ctx: &FrameContext<'_>, spots: &Spots<'_>, surface: &'s Surface<'s, F>) -> Self {
        let color = match ctx.settings.shading {
            Shading::Depth => {
                let mut grey = row(spots.t::<F>());
                for lane in Bits(spots.mask) {
                    grey[lane] = depth(ctx.depth_range, grey[lane]);
                }
                V3::all(F::load(&grey))
            }
            Shading::Normals => {
                let mut rows = surface.n_shade.rows();
                for lane in Bits(spots.mask) {
                    for row in &mut rows {
                        row[lane] = encoded(row[lane]);
                    }
                }
                V3::load(&rows)
            }
            Shading::Ao => V3::zero(),
            _ => V3::splat(CLAY) * clamp(surface.n_shade.dot(surface.view), 0.0, 1.0),
        };
        Self { color, surface, mask: spots.mask }
    }
}

impl<F: Floats> Points<F> for PlainPoints<'_, F> {
    /// Occlusion rays `number`, drawn from the cosine-weighted hemisphere within the context's reach.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn probes(&self, ctx: &FrameContext<'_>, number: usize, random: &Samplers) -> Probes<F> {
        let normals = self.surface.n_shade.rows();
        let mut rows = [[0.0; LANES]; 3];
        for lane in Bits(self.mask) {
            let n = Vec3::new(normals[0][lane], normals[1][lane], normals[2][lane]);
            let (a, b) = frame(n);
            #[expect(clippy::cast_possible_truncation, reason = "a handful of rays")]
            let (u, v) = random.at(lane).square(AO_PATTERN, number as u32, AO_RAYS);
            let (x, y) = disc(u, v);
            put3(&mut rows, lane, a * x + b * y + n * (1.0 - x * x - y * y).max(0.0).sqrt());
        }
        let (dir, n_geom) = (V3::load(&rows), self.surface.n_geom);
        // Directions below the facet are mirrored to its upper side.
        let below = dir.dot(n_geom).min(F::splat(0.0));
        let dir = dir - n_geom * (F::splat(2.0) * below);
        Probes {
            mask: self.mask,
            origin: self.surface.origin(dir),
            dir,
            t_far: F::splat(ctx.reach),
            light: V3::all(F::splat(1.0 / AO_RAYS as f32)),
            width: F::splat(0.0),
        }
    }

    #[inline(always)]
    fn add(&mut self, mask: u32, light: V3<F>) {
        self.color = V3::select(mask, self.color + light, self.color);
    }

    #[inline(always)]
    fn result(&self) -> (V3<F>, F) {
        (self.color, F::splat(1.0))
    }
}

/// A component in [-1, 1] as sRGB code 0 to 255, so that a file's bytes are the normal.
#[inline(always)]
fn encoded(x: f32) -> f32 {
    super::tone::linear_of((x * 0.5 + 0.5).clamp(0.0, 1.0))
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
        let code = |x: f32| table.encode(encoded(x));
        assert_eq!((code(-1.0), code(0.0), code(1.0)), (0, 128, 255));
        assert_eq!(code(0.5), 191);
    }
}
