//! Bands of the picture: the unit of parallel work. Each is entered once through the SIMD dispatch.

use std::ops::Range;

use glam::Vec3;

use super::{
    context::FrameContext,
    filter::{LayerKey, is_seen, layer_key},
    pattern::{PixelSampler, subpixel},
    plain,
    shade::ShadePoint,
    sky::backdrop,
    tone::filmic,
};
use crate::{
    geom::{Hit, Ray},
    simd::{Simd, Task},
};

/// Rows of a band.
pub(crate) const BAND_ROWS: usize = 8;
/// Most blended layers of a pixel.
const LAYERS: usize = 32;
/// Light that still passes below which further layers are not looked for.
const OPAQUE: f32 = 1.0 / 512.0;

/// Rows of a picture with their place.
#[derive(Debug)]
pub(crate) struct Band<'a> {
    /// First row.
    pub(crate) top: u32,
    pub(crate) color: &'a mut [[f32; 4]],
    pub(crate) depth: &'a mut [f32],
    pub(crate) instance: &'a mut [u32],
}

/// Renders a band; returns the number of rays.
pub(crate) struct BandTask<'a, 'b> {
    pub(crate) ctx: &'b FrameContext<'a>,
    pub(crate) band: Band<'b>,
}

/// Pixels a side of a block: the rays that are traced together.
const SIDE: u32 = 4;
const LANES: usize = (SIDE * SIDE) as usize;

/// What the samples of one pixel have found so far.
#[derive(Clone, Copy)]
struct Pixel {
    color: Vec3,
    coverage: f32,
    depth: f32,
    instance: u32,
}

impl Pixel {
    const EMPTY: Self = Self { color: Vec3::ZERO, coverage: 0.0, depth: f32::INFINITY, instance: 0 };

    /// Adds one sample's first surface.
    #[inline(always)]
    fn add_surface(&mut self, hit: &Hit) {
        if hit.t < self.depth {
            (self.depth, self.instance) = (hit.t, hit.instance.0 + 1);
        }
    }
}

impl Task for BandTask<'_, '_> {
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(mut self) -> u64 {
        let width = self.ctx.size[0];
        #[expect(clippy::cast_possible_truncation, reason = "at most BAND_ROWS")]
        let bottom = self.band.top + (self.band.color.len() / width as usize) as u32;
        for y in self.band.top..bottom {
            self.clear_row(y);
        }
        let [x0, y0, x1, y1] = self.ctx.rect;
        let (top, bottom) = (self.band.top.max(y0), bottom.min(y1));
        let mut rays = 0;
        let mut y = self.band.top;
        while y < bottom {
            let rows = y.max(top)..(y + SIDE).min(bottom);
            let mut x = x0 - x0 % SIDE;
            while x < x1 && !rows.is_empty() {
                rays += self.block::<S>(x, y, x.max(x0)..(x + SIDE).min(x1), rows.clone());
                x += SIDE;
            }
            y += SIDE;
        }
        rays
    }
}

impl BandTask<'_, '_> {
    /// Fills a row with the background.
    fn clear_row(&mut self, y: u32) {
        let behind = background(self.ctx, y);
        let first = self.at(0, y);
        let row = first..first + self.ctx.size[0] as usize;
        self.band.color[row.clone()].fill([behind.x, behind.y, behind.z, 0.0]);
        self.band.depth[row.clone()].fill(f32::INFINITY);
        self.band.instance[row].fill(0);
    }

    /// Place of a pixel in the band.
    #[inline(always)]
    fn at(&self, x: u32, y: u32) -> usize {
        (y - self.band.top) as usize * self.ctx.size[0] as usize + x as usize
    }

    /// Renders the pixels `columns` x `rows` of the block that begins at (`left`, `top`).
    #[inline(always)]
    fn block<S: Simd>(&mut self, left: u32, top: u32, columns: Range<u32>, rows: Range<u32>) -> u64 {
        let ctx = self.ctx;
        let mut pixels = [Pixel::EMPTY; LANES];
        let mut rays = 0;
        let settings = &ctx.settings;
        for sample in (0..settings.samples).map(|s| settings.first_sample.wrapping_add(s)) {
            rays += sample_block::<S>(ctx, [left, top], &columns, &rows, sample, &mut pixels);
        }
        let scale = 1.0 / settings.samples as f32;
        for y in rows {
            let behind = background(ctx, y);
            for x in columns.clone() {
                let pixel = &pixels[lane(x - left, y - top)];
                if pixel.instance != 0 {
                    let at = self.at(x, y);
                    let coverage = pixel.coverage * scale;
                    let color = pixel.color * scale + behind * (1.0 - coverage);
                    self.band.color[at] = [color.x, color.y, color.z, coverage];
                    self.band.depth[at] = pixel.depth;
                    self.band.instance[at] = pixel.instance;
                }
            }
        }
        rays
    }
}

#[inline(always)]
fn lane(x: u32, y: u32) -> usize {
    (y * SIDE + x) as usize
}

/// Adds one sample of each pixel of a block; returns the number of rays.
#[inline(always)]
fn sample_block<S: Simd>(
    ctx: &FrameContext<'_>,
    [left, top]: [u32; 2],
    columns: &Range<u32>,
    rows: &Range<u32>,
    sample: u32,
    pixels: &mut [Pixel; LANES],
) -> u64 {
    let (jitter_x, jitter_y) = subpixel(sample);
    let mut count = 0;
    for y in rows.clone() {
        for x in columns.clone() {
            let ray = ctx.rays.ray(x as f32 + jitter_x, y as f32 + jitter_y);
            let pixel = &mut pixels[lane(x - left, y - top)];
            let random = PixelSampler::new(ctx.settings.seed, ctx.settings.frame, y * ctx.size[0] + x, sample);
            count += shade_ray::<S>(ctx, &ray, &random, pixel);
        }
    }
    count
}

/// Adds what one camera ray sees: layers front to back until one is opaque.
#[inline(always)]
fn shade_ray<S: Simd>(ctx: &FrameContext<'_>, ray: &Ray, random: &PixelSampler, pixel: &mut Pixel) -> u64 {
    let lit = ctx.settings.shading.is_lit();
    let (mut rays, mut through, mut after, mut rest) = (0, 1.0, None::<LayerKey>, *ray);
    for _ in 0..LAYERS {
        rays += 1;
        let seen = |hit: &Hit| is_seen(ctx, ray, after, hit);
        let Some(hit) = ctx.world.closest_hit::<S, _>(&rest, &seen) else { break };
        if after.is_none() {
            pixel.add_surface(&hit);
        }
        let (color, alpha) = if lit {
            let mut point = ShadePoint::new(ctx, ray, &hit);
            rays += point.add_lights::<S>(ctx, random);
            (point.color, point.alpha)
        } else {
            let (color, cast) = plain::color::<S>(ctx, ray, &hit, random);
            rays += cast;
            (color, 1.0)
        };
        pixel.color += color * (alpha * through);
        pixel.coverage += alpha * through;
        through *= 1.0 - alpha;
        if through < OPAQUE {
            break;
        }
        // Sure to find the next layer: the range is closed and keys past the last are refused.
        (after, rest.t_near) = (Some(layer_key(&hit)), hit.t);
    }
    rays
}

/// Colour behind everything in row `y`.
fn background(ctx: &FrameContext<'_>, y: u32) -> Vec3 {
    let color = backdrop((y as f32 + 0.5) / ctx.size[1] as f32);
    match ctx.settings.shading {
        shading if shading.is_lit() => color,
        super::Shading::Depth => Vec3::ZERO,
        _ => filmic(color),
    }
}
