//! Blocks of pixels, a lane each: their rays are traced together, then shaded, then lit.
//!
//! Everything but the look-ups in meshes and textures is done for all lanes at once, with the operations of a single
//! point in their order, so that a pixel does not depend on how many lanes there are.

use std::{cell::Cell, ops::Range};

use glam::Vec3;

use super::{
    context::FrameContext,
    filter::{Layer, Layers, is_seen},
    found::{Maps, Spots},
    material::Coverage,
    pattern::{CENTRE, Samplers, subpixel},
    plain::{self, PlainPoints},
    probe::{NO_RAY, Points, Probes},
    shade::LitPoints,
    surface::Surface,
    wide::{Bits, Floats, LANES, V3, row},
};
use crate::{
    accel::LanePacket,
    geom::{Hit, Ray},
    simd::{Lanes, Simd},
};

/// Width of a block in pixels; its height is what the lanes of a level fill.
pub(crate) const COLUMNS: u32 = 4;
/// Most blended layers of a pixel.
const LAYERS: usize = 32;
/// Light that still passes below which further layers are not looked for.
const OPAQUE: f32 = 1.0 / 512.0;

/// Rows of a block.
#[inline(always)]
pub(crate) fn block_rows<S: Simd>() -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "at most 16")]
    let lanes = S::F::LEN as u32;
    lanes / COLUMNS
}

/// The pixels of a block while they are made.
#[derive(Debug)]
pub(crate) struct Block<F> {
    left: u32,
    top: u32,
    /// Lanes that are rendered.
    pub(crate) mask: u32,
    /// Sums over the samples.
    pub(crate) color: V3<F>,
    pub(crate) coverage: F,
    /// Of the nearest sample.
    pub(crate) depth: [f32; LANES],
    pub(crate) instance: [u32; LANES],
    /// Rays traced.
    pub(crate) rays: u64,
}

/// The camera rays of a sample.
struct CameraRays<F> {
    rays: [Ray; LANES],
    dir: V3<F>,
    random: Samplers,
}

impl<F: Floats> Block<F> {
    /// An empty block at (`left`, `top`), of which only `columns` x `rows` are rendered.
    #[inline(always)]
    pub(crate) fn new(left: u32, top: u32, columns: &Range<u32>, rows: &Range<u32>) -> Self {
        let mut mask = 0;
        for y in rows.clone() {
            for x in columns.clone() {
                mask |= 1 << ((y - top) * COLUMNS + (x - left));
            }
        }
        Self {
            left,
            top,
            mask,
            color: V3::zero(),
            coverage: F::splat(0.0),
            depth: [f32::INFINITY; LANES],
            instance: [0; LANES],
            rays: 0,
        }
    }

    /// The pixel of a lane.
    #[inline(always)]
    pub(crate) fn pixel(&self, lane: usize) -> (u32, u32) {
        #[expect(clippy::cast_possible_truncation, reason = "at most 16")]
        let lane = lane as u32;
        (self.left + lane % COLUMNS, self.top + lane / COLUMNS)
    }

    /// Adds one sample of every pixel.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn add_sample<S: Simd<F = F>>(&mut self, ctx: &FrameContext<'_>, packet: &mut LanePacket, sample: u32) {
        let camera = self.camera_rays(ctx, sample);
        let mut seen = [None; LANES];
        ctx.world.nearest_hits_with::<S>(packet, &camera.rays[..F::LEN], &mut seen);
        self.rays += u64::from(self.mask.count_ones());
        let mut spots = Spots::new(ctx, &seen);
        let passed = unseen(ctx, &spots, &camera, &seen);
        if passed != 0 {
            for lane in Bits(passed) {
                seen[lane] = next_seen::<S>(ctx, &camera.rays[lane], None);
            }
            spots = Spots::new(ctx, &seen);
        }
        self.meet(spots.mask, &seen);
        let mut through = F::splat(1.0);
        for _ in 1..LAYERS {
            if spots.mask == 0 {
                return;
            }
            through = self.shade::<S>(ctx, packet, &spots, &camera, through);
            let active = spots.mask & F::splat(OPAQUE).le(through);
            if active == 0 {
                return;
            }
            self.rays += u64::from(active.count_ones());
            let mut next = [None; LANES];
            for lane in Bits(active) {
                next[lane] = next_seen::<S>(ctx, &camera.rays[lane], seen[lane].as_ref());
            }
            seen = next;
            spots = Spots::new(ctx, &seen);
        }
        if spots.mask != 0 {
            self.shade::<S>(ctx, packet, &spots, &camera, through);
        }
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn camera_rays(&self, ctx: &FrameContext<'_>, sample: u32) -> CameraRays<F> {
        let alone = sample == 0 && ctx.settings.samples == 1;
        let (jitter_x, jitter_y) = if alone { CENTRE } else { subpixel(sample) };
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..F::LEN {
            let (column, row) = self.pixel(lane);
            (x[lane], y[lane]) = (column as f32 + jitter_x, row as f32 + jitter_y);
        }
        let random = Samplers {
            seed: ctx.settings.seed,
            frame: ctx.settings.frame,
            first: self.top * ctx.size[0] + self.left,
            stride: ctx.size[0],
            columns: COLUMNS,
            sample,
        };
        let [origin, dir] = ctx.rays.lines(F::load(&x), F::load(&y));
        let ([ox, oy, oz], [dx, dy, dz]) = (origin.rows(), dir.rows());
        let [t_near, t_far] = ctx.rays.range();
        let mut rays = [NO_RAY; LANES];
        for lane in Bits(self.mask) {
            rays[lane] = Ray {
                origin: Vec3::new(ox[lane], oy[lane], oz[lane]),
                dir: Vec3::new(dx[lane], dy[lane], dz[lane]),
                t_near,
                t_far,
            };
        }
        CameraRays { rays, dir, random }
    }

    /// Adds the shaded points at `spots`, of which `through` still shows; returns what shows of things behind.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn shade<'a, S: Simd<F = F>>(
        &mut self,
        ctx: &FrameContext<'a>,
        packet: &mut LanePacket,
        spots: &Spots<'a>,
        camera: &CameraRays<F>,
        through: F,
    ) -> F {
        let mut patch = spots.patch::<F>();
        if ctx.pierced || spots.lanes(|spot| !spot.material.is_plain()) != 0 {
            patch = patch.with_steps(&ctx.rays, camera.dir, spots.t());
        }
        let mut maps = Maps::new(spots, &patch);
        let surface = Surface::new(ctx, spots, &patch, &mut maps, camera.dir);
        if ctx.settings.shading.is_lit() {
            let points = LitPoints::new(ctx, spots, &patch, maps, &surface);
            self.light::<S, _>(ctx, packet, spots.mask, points, camera, through)
        } else {
            let points = PlainPoints::new(ctx, spots, &surface);
            self.light::<S, _>(ctx, packet, spots.mask, points, camera, through)
        }
    }

    /// Traces the secondary rays of every point, the first of each, then the second of each, and so on; then adds the
    /// points as [`Block::shade`].
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn light<S: Simd<F = F>, P: Points<F>>(
        &mut self,
        ctx: &FrameContext<'_>,
        packet: &mut LanePacket,
        mask: u32,
        mut points: P,
        camera: &CameraRays<F>,
        through: F,
    ) -> F {
        for number in 0..probe_count(ctx) {
            let probes = points.probes(ctx, number, &camera.random);
            if probes.mask != 0 {
                self.rays += u64::from(probes.mask.count_ones());
                let arriving = transmittances::<S>(ctx, packet, &probes);
                points.add(probes.mask, probes.light * arriving);
            }
        }
        let one = F::splat(1.0);
        let (color, alpha) = points.result();
        let share = alpha * through;
        self.color = V3::select(mask, self.color + color * share, self.color);
        self.coverage = F::select(mask, self.coverage + share, self.coverage);
        F::select(mask, through * (one - alpha), F::splat(0.0))
    }

    /// Notes depth and instance of first layers.
    #[inline(always)]
    fn meet(&mut self, mask: u32, hits: &[Option<Hit>; LANES]) {
        for lane in Bits(mask) {
            if let Some(hit) = hits[lane].filter(|hit| hit.t < self.depth[lane]) {
                (self.depth[lane], self.instance[lane]) = (hit.t, hit.instance.0 + 1);
            }
        }
    }
}

/// Secondary rays a point.
#[inline(always)]
fn probe_count(ctx: &FrameContext<'_>) -> usize {
    if ctx.settings.shading.is_lit() { ctx.lights.len() } else { plain::probe_count(ctx.settings.shading) }
}

/// The lanes whose nearest hit does not count, as [`is_seen`] says of each.
#[cfg_attr(not(debug_assertions), inline(always))]
fn unseen<'a, F: Floats>(
    ctx: &FrameContext<'a>,
    spots: &Spots<'a>,
    camera: &CameraRays<F>,
    hits: &[Option<Hit>; LANES],
) -> u32 {
    let sides = spots.lanes(|spot| !spot.material.double_sided);
    let mut passed = 0;
    if sides != 0 {
        let away = F::splat(0.0).lt(spots.cross().dot(camera.dir));
        passed = sides & (away ^ spots.lanes(|spot| spot.info.mirrored));
    }
    if ctx.pierced {
        for lane in Bits(spots.lanes(|spot| spot.material.coverage != Coverage::Opaque) & !passed) {
            if hits[lane].is_some_and(|hit| !is_seen(ctx, &camera.rays[lane], None, &hit)) {
                passed |= 1 << lane;
            }
        }
    }
    passed
}

/// The next thing that a camera ray sees where the nearest hit does not count: a culled face, a hole, a layer already met.
///
/// The range is closed and layers up to the last are refused, so none is lost and none is met twice.
#[cfg_attr(not(debug_assertions), inline(always))]
fn next_seen<S: Simd>(ctx: &FrameContext<'_>, ray: &Ray, last: Option<&Hit>) -> Option<Hit> {
    let after = last.map(Layer::new);
    let rest = Ray { t_near: last.map_or(ray.t_near, |hit| hit.t), ..*ray };
    ctx.world.closest_hit::<S, _>(&rest, &|hit: &Hit| is_seen(ctx, ray, after.as_ref(), hit))
}

/// The part of each probe's light that arrives.
///
/// Blended layers dim it in order of (t, instance, prim), so that the product does not depend on the order in which a
/// structure finds them.
#[cfg_attr(not(debug_assertions), inline(always))]
fn transmittances<S: Simd>(ctx: &FrameContext<'_>, packet: &mut LanePacket, probes: &Probes<S::F>) -> S::F {
    let rays = probes.rays();
    if !ctx.pierced {
        let blocked = ctx.world.blocked_with::<S>(packet, &rays[..S::F::LEN]);
        return S::F::select(blocked, S::F::splat(0.0), S::F::splat(1.0));
    }
    let widths = row(probes.width);
    let mut arriving = [1.0; LANES];
    for lane in Bits(probes.mask) {
        let layers = Cell::new(Layers::default());
        let width = widths[lane];
        let stopped = ctx.world.is_occluded::<S, _>(&rays[lane], &|hit: &Hit| ctx.stops(width, hit, &layers));
        arriving[lane] = if stopped { 0.0 } else { layers.into_inner().transmittance() };
    }
    S::F::load(&arriving)
}
