//! The picture: what rays found, before it becomes bytes.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    tone::{Srgb8, filmic},
    wide::{LANES, V3, put3},
};
use crate::simd::{Lanes, Simd, SimdLevel, Task, dispatch};

/// A picture being made: linear colour with coverage, depth and instance of the first surface. Rows top down.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear Rec. 709 RGB over the background, and coverage by surfaces in [0, 1]; one a pixel.
    pub color: Vec<[f32; 4]>,
    /// Distance along the view axis to the first surface in metres (the nearest over a pixel's samples);
    /// infinite for the background.
    pub depth: Vec<f32>,
    /// Instance of the first surface plus 1 (of the nearest sample); 0 for the background.
    pub instance: Vec<u32>,
    /// True when `color` is meant for the display as it is (every shading but the lit ones): [`Film::to_srgb8`]
    /// then applies no tone curve.
    pub display: bool,
    /// SIMD level that rendered it and encodes it.
    pub(crate) simd: SimdLevel,
}

impl Film {
    /// An empty picture of the given size.
    pub fn new(width: u32, height: u32) -> Self {
        let mut film = Self::default();
        film.resize(width, height);
        film
    }

    /// Changes the size; content is unspecified until the next render. Allocates only to grow.
    pub fn resize(&mut self, width: u32, height: u32) {
        let n = width as usize * height as usize;
        (self.width, self.height) = (width, height);
        self.color.resize(n, [0.0; 4]);
        self.depth.resize(n, f32::INFINITY);
        self.instance.resize(n, 0);
    }

    /// Tone-mapped 8-bit sRGB with opaque alpha into `rgba` (4 bytes a pixel), resized as needed.
    ///
    /// The bytes depend on `color` and `display` alone. In parallel when called inside a rayon pool.
    pub fn to_srgb8(&self, rgba: &mut Vec<u8>) {
        rgba.resize(self.color.len() * 4, 255);
        let rows = (self.width as usize).max(1) * 8;
        let table = Srgb8::get();
        let display = self.display;
        if rayon::current_thread_index().is_some() {
            rgba.par_chunks_mut(rows * 4)
                .zip(self.color.par_chunks(rows))
                .for_each(|(bytes, colors)| dispatch(self.simd, Encode { table, display, colors, bytes }));
        } else {
            dispatch(self.simd, Encode { table, display, colors: &self.color, bytes: rgba });
        }
    }
}

/// Encodes pixels; runs of one colour (the background) are encoded once.
struct Encode<'a> {
    table: &'a Srgb8,
    display: bool,
    colors: &'a [[f32; 4]],
    bytes: &'a mut [u8],
}

impl Task for Encode<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        // The last pixel's bits and its bytes.
        let mut last = None;
        for (colors, out) in self.colors.chunks(S::F::LEN).zip(self.bytes.chunks_mut(4 * S::F::LEN)) {
            if let Some((bits, pixel)) = last
                && colors.iter().all(|c| c.map(f32::to_bits) == bits)
            {
                out.as_chunks_mut().0.fill(pixel);
                continue;
            }
            let mut rows = [[0.0; LANES]; 3];
            for (lane, color) in colors.iter().enumerate() {
                put3(&mut rows, lane & (LANES - 1), Vec3::new(color[0], color[1], color[2]));
            }
            if !self.display {
                rows = filmic(V3::<S::F>::load(&rows)).rows();
            }
            let pixels = out.as_chunks_mut().0;
            for (lane, pixel) in pixels.iter_mut().enumerate() {
                let lane = lane & (LANES - 1);
                let [r, g, b] = [rows[0][lane], rows[1][lane], rows[2][lane]];
                *pixel = [self.table.encode(r), self.table.encode(g), self.table.encode(b), 255];
            }
            if let (Some(color), Some(&pixel)) = (colors.last(), pixels.last()) {
                last = Some((color.map(f32::to_bits), pixel));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_the_same_inside_and_outside_a_pool() {
        let mut film = Film::new(37, 21);
        for (i, c) in film.color.iter_mut().enumerate() {
            let x = (i / 3) as f32 * 0.01;
            *c = [x, x * x, f32::NAN, 1.0];
        }
        let (mut a, mut b) = (Vec::new(), vec![7; 12]);
        film.to_srgb8(&mut a);
        rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap().install(|| film.to_srgb8(&mut b));
        assert_eq!(a, b);
        assert!(a.chunks(4).all(|p| p[3] == 255));
    }

    #[test]
    fn display_colour_is_encoded_without_the_curve() {
        let mut film = Film::new(1, 1);
        film.color[0] = [0.5, 0.0, 1.0, 1.0];
        film.display = true;
        let mut bytes = Vec::new();
        film.to_srgb8(&mut bytes);
        assert_eq!(bytes, [188, 0, 255, 255]);
    }

    #[test]
    fn a_film_without_pixels_has_no_bytes() {
        let mut bytes = vec![1, 2, 3];
        Film::new(0, 5).to_srgb8(&mut bytes);
        assert!(bytes.is_empty());
    }
}
