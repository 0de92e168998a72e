//! Blocks of 4 x 4 pixels: their rays are traced together, then shaded, then lit.
//!
//! Camera rays and secondary rays go in packets and meet the world at one place each, so that the traversals behind
//! them are compiled once a SIMD level; shading between them is plain code, compiled once.

use std::{cell::Cell, ops::Range};

use glam::Vec3;

use super::{
    context::FrameContext,
    filter::{Layer, Layers, is_seen},
    pattern::{PixelSampler, subpixel},
    plain::PlainPoint,
    shade::ShadePoint,
};
use crate::{
    geom::{Hit, Ray},
    simd::Simd,
};

/// Pixels a side of a block.
pub(crate) const SIDE: u32 = 4;
const LANES: usize = (SIDE * SIDE) as usize;
/// Most blended layers of a pixel.
const LAYERS: usize = 32;
/// Light that still passes below which further layers are not looked for.
const OPAQUE: f32 = 1.0 / 512.0;

/// A secondary ray and the light that it brings when nothing is in its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probe {
    pub(crate) ray: Ray,
    pub(crate) light: Vec3,
    /// Width of the footprint in metres, for the alpha of what is in the way.
    pub(crate) width: f32,
}

impl Probe {
    /// Fills places without a probe.
    const NONE: Self = Self {
        ray: Ray { origin: Vec3::ZERO, dir: Vec3::ZERO, t_near: 0.0, t_far: 0.0 },
        light: Vec3::ZERO,
        width: 0.0,
    };
}

/// What the samples of one pixel have found so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pixel {
    pub(crate) color: Vec3,
    pub(crate) coverage: f32,
    pub(crate) depth: f32,
    pub(crate) instance: u32,
}

impl Pixel {
    const EMPTY: Self = Self { color: Vec3::ZERO, coverage: 0.0, depth: f32::INFINITY, instance: 0 };
}

/// A camera ray on its way through layers.
#[derive(Clone, Copy, Debug)]
struct Lane {
    ray: Ray,
    /// The last layer met.
    last: Option<Hit>,
    /// Part of the light behind that still shows.
    through: f32,
    random: PixelSampler,
    pixel: usize,
}

/// A point to be lit.
#[derive(Clone, Copy, Debug)]
enum Point {
    Lit(ShadePoint),
    Plain(PlainPoint),
}

/// Place of a pixel in its block.
#[inline(always)]
pub(crate) fn lane(x: u32, y: u32) -> usize {
    (y * SIDE + x) as usize
}

/// The pixels of a block while they are made.
#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) left: u32,
    pub(crate) top: u32,
    columns: Range<u32>,
    rows: Range<u32>,
    pub(crate) pixels: [Pixel; LANES],
    /// Rays traced.
    pub(crate) rays: u64,
}

impl Block {
    /// An empty block at (`left`, `top`), of which only `columns` x `rows` are rendered.
    pub(crate) fn new(left: u32, top: u32, columns: &Range<u32>, rows: &Range<u32>) -> Self {
        Self { left, top, columns: columns.clone(), rows: rows.clone(), pixels: [Pixel::EMPTY; LANES], rays: 0 }
    }

    /// Adds one sample of every pixel.
    #[inline(always)]
    pub(crate) fn add_sample<S: Simd>(&mut self, ctx: &FrameContext<'_>, sample: u32) {
        let mut lanes: [Option<Lane>; LANES] = [None; LANES];
        self.fill(ctx, sample, &mut lanes);
        for layer in 0..LAYERS {
            let mut points: [Option<Point>; LANES] = [None; LANES];
            let mut any = false;
            let mut nearest: [Option<Hit>; LANES] = [None; LANES];
            if layer == 0 {
                trace::<S>(ctx, &lanes, &mut nearest);
            }
            for (i, (lane, point)) in lanes.iter_mut().zip(&mut points).enumerate() {
                let Some(active) = lane else { continue };
                self.rays += 1;
                let hit = match nearest[i] {
                    None if layer == 0 => None,
                    Some(hit) if is_seen(ctx, &active.ray, None, &hit) => Some(hit),
                    _ => next_seen::<S>(ctx, active),
                };
                let Some(hit) = hit else {
                    *lane = None;
                    continue;
                };
                active.last = Some(hit);
                *point = Some(shade(ctx, &active.ray, &hit));
                any = true;
            }
            if !any {
                return;
            }
            self.light::<S>(ctx, &lanes, &mut points);
            self.take(&mut lanes, &points, layer == 0);
        }
    }

    /// The camera rays of one sample.
    fn fill(&self, ctx: &FrameContext<'_>, sample: u32, lanes: &mut [Option<Lane>; LANES]) {
        let (jitter_x, jitter_y) = subpixel(sample);
        for y in self.rows.clone() {
            for x in self.columns.clone() {
                let ray = ctx.rays.ray(x as f32 + jitter_x, y as f32 + jitter_y);
                let random = PixelSampler::new(ctx.settings.seed, ctx.settings.frame, y * ctx.size[0] + x, sample);
                let pixel = lane(x - self.left, y - self.top);
                lanes[pixel] = Some(Lane { ray, last: None, through: 1.0, random, pixel });
            }
        }
    }

    /// Traces the secondary rays of every point: the first of each, then the second of each, and so on.
    #[inline(always)]
    fn light<S: Simd>(
        &mut self,
        ctx: &FrameContext<'_>,
        lanes: &[Option<Lane>; LANES],
        points: &mut [Option<Point>; LANES],
    ) {
        for number in 0..probe_count(ctx) {
            let mut probes = [Probe::NONE; LANES];
            let mut owners = [0; LANES];
            let mut count = 0;
            for (i, (lane, point)) in lanes.iter().zip(points.iter()).enumerate() {
                let (Some(lane), Some(point)) = (lane, point) else { continue };
                let Some(probe) = point.probe(ctx, number, &lane.random) else { continue };
                (probes[count], owners[count]) = (probe, i);
                count += 1;
            }
            self.rays += count as u64;
            let arriving = transmittances::<S>(ctx, &probes[..count]);
            for i in 0..count {
                if let Some(point) = &mut points[owners[i]] {
                    *point.color() += probes[i].light * arriving[i];
                }
            }
        }
    }

    /// Adds shaded points to their pixels; lanes that need no further layer end.
    fn take(&mut self, lanes: &mut [Option<Lane>; LANES], points: &[Option<Point>; LANES], first: bool) {
        for (lane, point) in lanes.iter_mut().zip(points) {
            let (Some(active), Some(point)) = (lane.as_mut(), point) else { continue };
            let pixel = &mut self.pixels[active.pixel];
            if first && let Some(hit) = active.last.filter(|hit| hit.t < pixel.depth) {
                (pixel.depth, pixel.instance) = (hit.t, hit.instance.0 + 1);
            }
            let (color, alpha) = point.result();
            pixel.color += color * (alpha * active.through);
            pixel.coverage += alpha * active.through;
            active.through *= 1.0 - alpha;
            if active.through < OPAQUE {
                *lane = None;
            }
        }
    }
}

impl Point {
    fn probe(&self, ctx: &FrameContext<'_>, number: usize, random: &PixelSampler) -> Option<Probe> {
        match self {
            Self::Lit(point) => point.probe(ctx, number, random),
            Self::Plain(point) => point.probe(ctx, number, random),
        }
    }

    fn color(&mut self) -> &mut Vec3 {
        match self {
            Self::Lit(point) => &mut point.color,
            Self::Plain(point) => &mut point.color,
        }
    }

    fn result(&self) -> (Vec3, f32) {
        match self {
            Self::Lit(point) => (point.color, point.alpha),
            Self::Plain(point) => (point.color, 1.0),
        }
    }
}

/// Secondary rays a point.
fn probe_count(ctx: &FrameContext<'_>) -> usize {
    if ctx.settings.shading.is_lit() { ctx.lights.len() } else { PlainPoint::probe_count(ctx.settings.shading) }
}

fn shade(ctx: &FrameContext<'_>, ray: &Ray, hit: &Hit) -> Point {
    if ctx.settings.shading.is_lit() {
        Point::Lit(ShadePoint::new(ctx, ray, hit))
    } else {
        Point::Plain(PlainPoint::new(ctx, ray, hit))
    }
}

/// The nearest hit of every camera ray, whether it counts or not: nearly always it does.
#[inline(always)]
fn trace<S: Simd>(ctx: &FrameContext<'_>, lanes: &[Option<Lane>; LANES], nearest: &mut [Option<Hit>; LANES]) {
    let mut rays = [Probe::NONE.ray; LANES];
    let mut owners = [0; LANES];
    let mut count = 0;
    for (i, lane) in lanes.iter().enumerate() {
        if let Some(lane) = lane {
            (rays[count], owners[count]) = (lane.ray, i);
            count += 1;
        }
    }
    let mut hits = [None; LANES];
    ctx.world.nearest_hits::<S>(&rays[..count], &mut hits[..count]);
    for i in 0..count {
        nearest[owners[i]] = hits[i];
    }
}

/// The next thing that a camera ray sees where the nearest hit does not count: a culled face, a hole, a layer already met.
///
/// The range is closed and layers up to the last are refused, so none is lost and none is met twice.
#[inline(always)]
fn next_seen<S: Simd>(ctx: &FrameContext<'_>, lane: &Lane) -> Option<Hit> {
    let after = lane.last.as_ref().map(Layer::new);
    let rest = Ray { t_near: lane.last.map_or(lane.ray.t_near, |hit| hit.t), ..lane.ray };
    ctx.world.closest_hit::<S, _>(&rest, &|hit: &Hit| is_seen(ctx, &lane.ray, after.as_ref(), hit))
}

/// The part of each probe's light that arrives.
///
/// Blended layers dim it in order of (t, instance, prim), so that the product does not depend on the order in which a
/// structure finds them.
#[inline(always)]
fn transmittances<S: Simd>(ctx: &FrameContext<'_>, probes: &[Probe]) -> [f32; LANES] {
    let mut arriving = [1.0; LANES];
    if ctx.pierced {
        for (arriving, probe) in arriving.iter_mut().zip(probes) {
            let layers = Cell::new(Layers::default());
            let stopped = ctx.world.is_occluded::<S, _>(&probe.ray, &|hit: &Hit| ctx.stops(probe.width, hit, &layers));
            *arriving = if stopped { 0.0 } else { layers.into_inner().transmittance() };
        }
        return arriving;
    }
    let mut rays = [Probe::NONE.ray; LANES];
    for (ray, probe) in rays.iter_mut().zip(probes) {
        *ray = probe.ray;
    }
    let blocked = ctx.world.blocked::<S>(&rays[..probes.len()]);
    for (i, arriving) in arriving.iter_mut().enumerate() {
        if (blocked >> i) & 1 == 1 {
            *arriving = 0.0;
        }
    }
    arriving
}
