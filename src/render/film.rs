//! The picture: what rays found, before it becomes bytes.

use glam::Vec3;
use rayon::prelude::*;

use super::tone::{Srgb8, filmic};

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
        if rayon::current_thread_index().is_some() {
            rgba.par_chunks_mut(rows * 4)
                .zip(self.color.par_chunks(rows))
                .for_each(|(bytes, colors)| encode(table, self.display, colors, bytes));
        } else {
            encode(table, self.display, &self.color, rgba);
        }
    }
}

/// Encodes pixels; runs of one colour (the background) are encoded once.
fn encode(table: &Srgb8, display: bool, colors: &[[f32; 4]], bytes: &mut [u8]) {
    let mut last = ([0u32; 3], table_bytes(table, display, Vec3::ZERO));
    for (color, out) in colors.iter().zip(bytes.chunks_exact_mut(4)) {
        let key = [color[0].to_bits(), color[1].to_bits(), color[2].to_bits()];
        if key != last.0 {
            last = (key, table_bytes(table, display, Vec3::new(color[0], color[1], color[2])));
        }
        out.copy_from_slice(&last.1);
    }
}

#[inline(always)]
fn table_bytes(table: &Srgb8, display: bool, color: Vec3) -> [u8; 4] {
    let shown = if display { color } else { filmic(color) };
    [table.encode(shown.x), table.encode(shown.y), table.encode(shown.z), 255]
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
