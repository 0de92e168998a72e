//! Bands of the picture: the unit of parallel work. Each is entered once through the SIMD dispatch.

use std::ops::Range;

use glam::Vec3;

use super::{
    block::{Block, SIDE, lane},
    context::FrameContext,
    sky::backdrop,
    tone::filmic,
};
use crate::simd::{Simd, Task};

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
        let mut block = Block::new(left, top, &columns, &rows);
        let settings = &ctx.settings;
        for sample in (0..settings.samples).map(|s| settings.first_sample.wrapping_add(s)) {
            block.add_sample::<S>(ctx, sample);
        }
        self.store(&block, columns, &rows);
        block.rays
    }

    /// Writes a block's pixels over the background.
    fn store(&mut self, block: &Block, columns: Range<u32>, rows: &Range<u32>) {
        let scale = 1.0 / self.ctx.settings.samples as f32;
        for y in rows.clone() {
            let behind = background(self.ctx, y);
            for x in columns.clone() {
                let pixel = &block.pixels[lane(x - block.left, y - block.top)];
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
    }
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
