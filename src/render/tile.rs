//! Bands of the picture: the unit of parallel work. Each is entered once through the SIMD dispatch.

use std::ops::Range;

use glam::Vec3;

use super::{
    block::{Block, COLUMNS, block_rows},
    context::FrameContext,
    sky::backdrop,
    tone::filmic_of,
    wide::{Bits, Floats, LANES, V3, put3, row},
};
use crate::{
    accel::LanePacket,
    simd::{Simd, Task},
};

/// Rows of a band.
pub(crate) const BAND_ROWS: usize = 8;

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

impl Task for BandTask<'_, '_> {
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(mut self) -> u64 {
        let ctx = self.ctx;
        let width = ctx.size[0];
        #[expect(clippy::cast_possible_truncation, reason = "at most BAND_ROWS")]
        let bottom = self.band.top + (self.band.color.len() / width as usize) as u32;
        let [x0, y0, x1, y1] = ctx.rect;
        let mut behind = [Vec3::ZERO; BAND_ROWS];
        for y in self.band.top..bottom {
            let color = background(ctx, y);
            behind[(y - self.band.top) as usize] = color;
            // Blocks write what lies in the rectangle.
            let (left, right) = if (y0..y1).contains(&y) { (x0, x1.max(x0)) } else { (width, width) };
            self.clear(y, 0..left, color);
            self.clear(y, right..width, color);
        }
        let mut packet = LanePacket::EMPTY;
        let mut rays = 0;
        let mut y = self.band.top;
        while y < bottom {
            let rows = y.max(y0)..(y + block_rows::<S>()).min(bottom).min(y1);
            let mut x = x0 - x0 % COLUMNS;
            while x < x1 && !rows.is_empty() {
                let mut block = Block::<S::F>::new(x, y, &(x.max(x0)..(x + COLUMNS).min(x1)), &rows);
                for sample in 0..ctx.settings.samples {
                    block.add_sample::<S>(ctx, &mut packet, ctx.settings.first_sample.wrapping_add(sample));
                }
                self.store(&block, &behind);
                rays += block.rays;
                x += COLUMNS;
            }
            y += block_rows::<S>();
        }
        rays
    }
}

impl BandTask<'_, '_> {
    /// Fills a part of a row with the background.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn clear(&mut self, y: u32, columns: Range<u32>, behind: Vec3) {
        let part = self.at(columns.start, y)..self.at(columns.end, y);
        self.band.color[part.clone()].fill([behind.x, behind.y, behind.z, 0.0]);
        self.band.depth[part.clone()].fill(f32::INFINITY);
        self.band.instance[part].fill(0);
    }

    /// Place of a pixel in the band.
    #[inline(always)]
    fn at(&self, x: u32, y: u32) -> usize {
        (y - self.band.top) as usize * self.ctx.size[0] as usize + x as usize
    }

    /// Writes a block's pixels, over the colours of `behind` of the band's rows.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn store<F: Floats>(&mut self, block: &Block<F>, behind: &[Vec3; BAND_ROWS]) {
        let mut back = [[0.0; LANES]; 3];
        for lane in Bits(block.mask) {
            let (_, y) = block.pixel(lane);
            put3(&mut back, lane, behind[(y - self.band.top) as usize]);
        }
        let scale = F::splat(1.0 / self.ctx.settings.samples as f32);
        let coverage = block.coverage * scale;
        let color = block.color * scale + V3::load(&back) * (F::splat(1.0) - coverage);
        let ([r, g, b], coverage) = (color.rows(), row(coverage));
        for lane in Bits(block.mask) {
            let (x, y) = block.pixel(lane);
            let at = self.at(x, y);
            self.band.color[at] = [r[lane], g[lane], b[lane], coverage[lane]];
            self.band.depth[at] = block.depth[lane];
            self.band.instance[at] = block.instance[lane];
        }
    }
}

/// Colour behind everything in row `y`.
fn background(ctx: &FrameContext<'_>, y: u32) -> Vec3 {
    let color = backdrop((y as f32 + 0.5) / ctx.size[1] as f32);
    match ctx.settings.shading {
        shading if shading.is_lit() => color,
        super::Shading::Depth => Vec3::ZERO,
        _ => filmic_of(color),
    }
}
