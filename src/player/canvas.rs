//! Drawing into the window's pixels: scaled pictures, rectangles, text. Clipped everywhere, no allocation.

use super::font;

/// A packed colour, `0x00RRGGBB`, sRGB.
pub(super) type Rgb = u32;

/// Pixels of the window, rows top down.
#[derive(Debug)]
pub(super) struct Canvas<'a> {
    width: usize,
    height: usize,
    pixels: &'a mut [Rgb],
}

/// A rectangle in pixels from the top left; parts outside the canvas are not drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rect {
    /// Left edge.
    pub(super) x: i32,
    /// Top edge.
    pub(super) y: i32,
    /// Width; nothing when not positive.
    pub(super) width: i32,
    /// Height; nothing when not positive.
    pub(super) height: i32,
}

/// `color` over `under` with opacity `alpha` in 0..=256.
fn mix(under: Rgb, color: Rgb, alpha: u32) -> Rgb {
    // Red and blue, then green, each with room for the product.
    let keep = 256 - alpha;
    let red_blue = ((under & 0x00ff_00ff) * keep + (color & 0x00ff_00ff) * alpha) >> 8 & 0x00ff_00ff;
    let green = ((under & 0xff00) * keep + (color & 0xff00) * alpha) >> 8 & 0xff00;
    red_blue | green
}

fn pack(rgba: [u8; 4]) -> Rgb {
    u32::from_be_bytes([0, rgba[0], rgba[1], rgba[2]])
}

impl<'a> Canvas<'a> {
    /// A canvas over `pixels`.
    ///
    /// # Panics
    /// When there are not `width * height` pixels.
    pub(super) fn new(width: usize, height: usize, pixels: &'a mut [Rgb]) -> Self {
        assert_eq!(pixels.len(), width * height, "pixels of a {width} x {height} canvas");
        Self { width, height, pixels }
    }

    /// Width in pixels.
    pub(super) fn width(&self) -> i32 {
        i32::try_from(self.width).unwrap_or(i32::MAX)
    }

    /// Height in pixels.
    pub(super) fn height(&self) -> i32 {
        i32::try_from(self.height).unwrap_or(i32::MAX)
    }

    /// Fills the canvas with a picture of `width` x `height` pixels (4 bytes each, alpha unused), bilinearly when
    /// the sizes differ. An empty picture gives black.
    pub(super) fn picture(&mut self, rgba: &[u8], width: usize, height: usize) {
        let texels = &rgba.as_chunks::<4>().0[..width * height];
        if texels.is_empty() {
            self.pixels.fill(0);
        } else if (width, height) == (self.width, self.height) {
            for (pixel, &texel) in self.pixels.iter_mut().zip(texels) {
                *pixel = pack(texel);
            }
        } else {
            self.scaled_picture(texels, width, height);
        }
    }

    fn scaled_picture(&mut self, texels: &[[u8; 4]], width: usize, height: usize) {
        if self.pixels.is_empty() {
            return;
        }
        let columns = Axis::new(width, self.width);
        let rows = Axis::new(height, self.height);
        for (y, line) in self.pixels.chunks_exact_mut(self.width).enumerate() {
            let (row, next_row, down) = rows.at(y);
            let upper = &texels[row * width..][..width];
            let lower = &texels[next_row * width..][..width];
            for (x, pixel) in line.iter_mut().enumerate() {
                let (left, right, along) = columns.at(x);
                let top = mix(pack(upper[left]), pack(upper[right]), along);
                let bottom = mix(pack(lower[left]), pack(lower[right]), along);
                *pixel = mix(top, bottom, down);
            }
        }
    }

    /// Fills a rectangle with opacity `alpha` in 0..=256.
    pub(super) fn rect(&mut self, rect: Rect, color: Rgb, alpha: u32) {
        let clip = |start: i32, length: i32, end: usize| {
            let from = usize::try_from(start).unwrap_or(0).min(end);
            let to = usize::try_from(start.saturating_add(length)).unwrap_or(0).min(end);
            from..to.max(from)
        };
        let (columns, rows) = (clip(rect.x, rect.width, self.width), clip(rect.y, rect.height, self.height));
        for y in rows {
            for pixel in &mut self.pixels[y * self.width..][columns.clone()] {
                *pixel = mix(*pixel, color, alpha.min(256));
            }
        }
    }

    /// Draws one line of text with its top left at (`x`, `y`), each font pixel `scale` pixels wide, over a shadow.
    pub(super) fn text(&mut self, x: i32, y: i32, text: &str, color: Rgb, scale: i32) {
        for (offset, color, alpha) in [(scale, 0, 160), (0, color, 256)] {
            font::for_each_pixel(text, |dx, dy| {
                let place = |start: i32, d: usize| {
                    start
                        .saturating_add(i32::try_from(d).unwrap_or(i32::MAX).saturating_mul(scale))
                        .saturating_add(offset)
                };
                self.rect(Rect { x: place(x, dx), y: place(y, dy), width: scale, height: scale }, color, alpha);
            });
        }
    }
}

/// Width of a text in pixels.
pub(super) fn text_width(text: &str, scale: i32) -> i32 {
    i32::try_from(text.chars().count() * font::CELL_WIDTH).unwrap_or(i32::MAX).saturating_mul(scale)
}

/// Height of a line in pixels.
pub(super) fn line_height(scale: i32) -> i32 {
    i32::try_from(font::LINE_HEIGHT).unwrap_or(i32::MAX).saturating_mul(scale)
}

/// Where each place on a scaled axis falls between two texels, as fixed-point steps.
struct Axis {
    step: u64,
    last: usize,
}

impl Axis {
    /// From `texels` stretched or shrunk to `pixels`, both positive.
    fn new(texels: usize, pixels: usize) -> Self {
        Self { step: ((texels as u64) << 16) / pixels as u64, last: texels - 1 }
    }

    /// The two texels next to a pixel's centre and the weight (0..=256) of the second.
    fn at(&self, pixel: usize) -> (usize, usize, u32) {
        let place = (pixel as u64 * self.step + self.step / 2).saturating_sub(1 << 15);
        let left = usize::try_from(place >> 16).unwrap_or(usize::MAX).min(self.last);
        let weight = (place >> 8 & 0xff) as u32;
        (left, (left + 1).min(self.last), weight)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const RED: [u8; 4] = [255, 0, 0, 255];
    const BLUE: [u8; 4] = [0, 0, 255, 255];

    #[test]
    fn picture_of_the_same_size_is_copied_top_row_first() {
        let mut pixels = [0; 4];
        Canvas::new(2, 2, &mut pixels).picture([RED, BLUE, BLUE, BLUE].as_flattened(), 2, 2);
        assert_eq!(pixels, [0xff_0000, 0xff, 0xff, 0xff]);
    }

    #[test]
    fn enlarged_picture_keeps_its_corners_and_blends_between() {
        let mut pixels = [0; 64];
        Canvas::new(8, 8, &mut pixels).picture([RED, BLUE, RED, BLUE].as_flattened(), 2, 2);
        assert_eq!((pixels[0], pixels[7]), (0xff_0000, 0x00_00ff));
        let reds: Vec<_> = pixels[..8].iter().map(|p| p >> 16).collect();
        assert!(reds.is_sorted_by(|a, b| a >= b) && reds[3] > 0 && reds[3] < 255, "{reds:?}");
    }

    #[test]
    fn one_colour_stays_that_colour_at_any_size() {
        for (width, height) in [(1, 1), (3, 5), (100, 7)] {
            let mut pixels = vec![0; width * height];
            Canvas::new(width, height, &mut pixels).picture([[7, 99, 255, 0]; 6].as_flattened(), 3, 2);
            assert!(pixels.iter().all(|&p| p == 0x07_63ff), "{width} x {height}");
        }
    }

    #[test]
    fn empty_picture_is_black() {
        let mut pixels = [5; 4];
        Canvas::new(2, 2, &mut pixels).picture(&[], 0, 0);
        assert_eq!(pixels, [0; 4]);
    }

    #[test]
    fn text_leaves_pixels_outside_its_cells_alone() {
        let mut pixels = vec![0x11_2233; 40 * 40];
        let mut canvas = Canvas::new(40, 40, &mut pixels);
        canvas.text(10, 10, "Hj", 0xff_ffff, 1);
        let lit = |x: usize, y: usize| pixels[y * 40 + x] == 0xff_ffff;
        assert!(lit(10, 10), "the H's upper left corner");
        for (i, _) in pixels.iter().enumerate().filter(|(_, p)| **p != 0x11_2233) {
            assert!((10..23).contains(&(i % 40)) && (10..21).contains(&(i / 40)), "{} {}", i % 40, i / 40);
        }
    }

    proptest! {
        #[test]
        fn drawing_anywhere_never_leaves_the_canvas(
            x in any::<i32>(), y in any::<i32>(), width in any::<i32>(), height in any::<i32>()
        ) {
            let mut pixels = vec![0; 12];
            let mut canvas = Canvas::new(4, 3, &mut pixels);
            let rect = Rect { x, y, width, height };
            canvas.rect(rect, 0xff_ffff, 256);
            canvas.text(x, y, "a~", 0xff_ffff, 2);
            let mut filled = vec![0; 12];
            Canvas::new(4, 3, &mut filled).rect(rect, 1, 256);
            for (i, &pixel) in (0i32..).zip(&filled) {
                let inside = |at: i32, start: i32, length: i32| (start..start.saturating_add(length)).contains(&at);
                let expected = inside(i % 4, x, width) && inside(i / 4, y, height);
                prop_assert_eq!(pixel == 1, expected);
            }
        }
    }
}
