use std::sync::Arc;

use glam::Vec4;

use crate::{render::tone::linear_from_srgb8, scene::Image};

/// What the bytes of an image mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Encoding {
    /// Colours in sRGB; alpha is linear.
    Srgb,
    /// Numbers: normals, roughness, occlusion.
    Linear,
}

/// One level of a pyramid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Level {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// First texel in `coarse`; unused for level 0.
    first: usize,
}

/// An image with its coarser versions, each half the size of the one before, rounded down.
#[derive(Clone, Debug)]
pub(crate) struct Pyramid {
    fine: Arc<[u8]>,
    coarse: Vec<[u16; 4]>,
    levels: Vec<Level>,
    encoding: Encoding,
    table: &'static [f32; 256],
}

/// Values of the 256 codes of a linear channel.
fn linear_table() -> &'static [f32; 256] {
    static TABLE: std::sync::OnceLock<[f32; 256]> = std::sync::OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|code| code as f32 / 255.0))
}

impl Pyramid {
    /// The pyramid of `image`; only the finest level when `with_levels` is false.
    ///
    /// Colours are averaged weighted by alpha, so that what shows through the holes of a cut-out does not bleed
    /// into its edges. Cost: O(texels); allocates the coarser levels.
    pub(crate) fn new(image: &Image, encoding: Encoding, with_levels: bool) -> Self {
        let table = match encoding {
            Encoding::Srgb => linear_from_srgb8(),
            Encoding::Linear => linear_table(),
        };
        let levels = vec![Level { width: image.width, height: image.height, first: 0 }];
        let mut pyramid = Self { fine: image.rgba.clone(), coarse: Vec::new(), levels, encoding, table };
        while with_levels && pyramid.halve() {}
        pyramid
    }

    /// Appends the next level; false when the last one is a single texel.
    fn halve(&mut self) -> bool {
        let index = self.levels.len() - 1;
        let above = self.levels[index];
        if above.width <= 1 && above.height <= 1 {
            return false;
        }
        let (width, height) = ((above.width / 2).max(1), (above.height / 2).max(1));
        let first = self.coarse.len();
        self.coarse.reserve(width as usize * height as usize);
        for y in 0..height {
            let (ys, wy) = taps(y, above.height, height);
            for x in 0..width {
                let (xs, wx) = taps(x, above.width, width);
                let texel = self.average(index, xs, wx, ys, wy);
                self.coarse.push(texel);
            }
        }
        self.levels.push(Level { width, height, first });
        true
    }

    fn average(&self, level: usize, xs: [u32; 3], wx: [f32; 3], ys: [u32; 3], wy: [f32; 3]) -> [u16; 4] {
        let (mut plain, mut weighted) = (Vec4::ZERO, Vec4::ZERO);
        for (y, wy) in ys.into_iter().zip(wy) {
            for (x, wx) in xs.into_iter().zip(wx) {
                let weight = wx * wy;
                if weight > 0.0 {
                    let texel = self.texel(level, x, y);
                    plain += texel * weight;
                    weighted += texel * (weight * texel.w);
                }
            }
        }
        let by_alpha = self.encoding == Encoding::Srgb && plain.w > 1e-4;
        let color = if by_alpha { weighted / plain.w } else { plain };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in [0, 65535]")]
        let pack = |x: f32| (x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16;
        [pack(color.x), pack(color.y), pack(color.z), pack(plain.w)]
    }

    /// Number of levels, at least 1.
    #[inline(always)]
    pub(crate) fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Size of a level.
    #[inline(always)]
    pub(crate) fn level(&self, level: usize) -> Level {
        self.levels[level]
    }

    /// A level ready to be read.
    #[inline(always)]
    pub(crate) fn view(&self, level: usize) -> LevelView<'_> {
        let Level { width, height, first } = self.levels[level];
        let texels = if level == 0 {
            Texels::Fine(self.fine.as_chunks().0, self.table)
        } else {
            Texels::Coarse(&self.coarse[first..])
        };
        LevelView { width, height, texels }
    }

    /// A texel in linear RGBA; row 0 is the top.
    #[inline(always)]
    pub(crate) fn texel(&self, level: usize, x: u32, y: u32) -> Vec4 {
        self.view(level).texel(x, y)
    }

    /// Bytes that the coarser levels take.
    pub(crate) fn coarse_bytes(&self) -> usize {
        self.coarse.len() * size_of::<[u16; 4]>()
    }
}

/// The texels of a level, as they are stored.
#[derive(Clone, Copy, Debug)]
enum Texels<'a> {
    Fine(&'a [[u8; 4]], &'static [f32; 256]),
    Coarse(&'a [[u16; 4]]),
}

/// A level of a pyramid, borrowed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelView<'a> {
    pub(crate) width: u32,
    pub(crate) height: u32,
    texels: Texels<'a>,
}

impl LevelView<'_> {
    /// A texel in linear RGBA; row 0 is the top.
    #[inline(always)]
    pub(crate) fn texel(&self, x: u32, y: u32) -> Vec4 {
        let at = y as usize * self.width as usize + x as usize;
        match self.texels {
            Texels::Fine(texels, table) => fine(texels, table, at),
            Texels::Coarse(texels) => coarse(texels[at]),
        }
    }

    /// The texels of two columns in two rows, row by row.
    #[inline(always)]
    pub(crate) fn four(&self, [x0, x1]: [u32; 2], [y0, y1]: [u32; 2]) -> [Vec4; 4] {
        // Numbers past 2^24 are not exact in f32.
        let (x0, x1) = (x0.min(self.width - 1) as usize, x1.min(self.width - 1) as usize);
        let row = |y: u32| y.min(self.height - 1) as usize * self.width as usize;
        let (top, bottom) = (row(y0), row(y1));
        let at = [top + x0, top + x1, bottom + x0, bottom + x1];
        let mut out = [Vec4::ZERO; 4];
        match self.texels {
            Texels::Fine(texels, table) => {
                for i in 0..4 {
                    out[i] = fine(texels, table, at[i]);
                }
            }
            Texels::Coarse(texels) => {
                for i in 0..4 {
                    out[i] = coarse(texels[at[i]]);
                }
            }
        }
        out
    }
}

#[inline(always)]
fn fine(texels: &[[u8; 4]], table: &[f32; 256], at: usize) -> Vec4 {
    let [r, g, b, a] = texels[at];
    Vec4::new(table[usize::from(r)], table[usize::from(g)], table[usize::from(b)], f32::from(a) * (1.0 / 255.0))
}

#[inline(always)]
fn coarse([r, g, b, a]: [u16; 4]) -> Vec4 {
    Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a)) * (1.0 / 65535.0)
}

/// Source texels and weights of texel `i` of `to` averaged from `from` texels: two when `from` is even, three
/// overlapping ones when odd, so that every source texel counts the same.
fn taps(i: u32, from: u32, to: u32) -> ([u32; 3], [f32; 3]) {
    let base = 2 * i;
    if from == to {
        ([i, i, i], [1.0, 0.0, 0.0])
    } else if from.is_multiple_of(2) {
        ([base, base + 1, base], [0.5, 0.5, 0.0])
    } else {
        let scale = 1.0 / from as f32;
        let last = from - 1;
        ([base, base + 1, (base + 2).min(last)], [(to - i) as f32 * scale, to as f32 * scale, (i + 1) as f32 * scale])
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Image {
        let rgba: Vec<u8> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
        Image { name: String::new(), width, height, rgba: rgba.into() }
    }

    #[test]
    fn weights_of_every_source_texel_are_equal() {
        for from in 1..40u32 {
            let to = (from / 2).max(1);
            let mut total = vec![0.0f32; from as usize];
            for i in 0..to {
                let (xs, ws) = taps(i, from, to);
                assert!((ws.iter().sum::<f32>() - 1.0).abs() < 1e-6);
                for (x, w) in xs.into_iter().zip(ws) {
                    total[x as usize] += w;
                }
            }
            let mean = to as f32 / from as f32;
            assert!(total.iter().all(|t| (t - mean).abs() < 1e-5), "{from}: {total:?}");
        }
    }

    #[test]
    fn levels_average_light_not_codes() {
        let checker = image(4, 4, |x, y| if (x + y) % 2 == 0 { [255, 255, 255, 255] } else { [0, 0, 0, 255] });
        let pyramid = Pyramid::new(&checker, Encoding::Srgb, true);
        assert_eq!(pyramid.level_count(), 3);
        assert!((pyramid.texel(2, 0, 0) - Vec4::new(0.5, 0.5, 0.5, 1.0)).abs().max_element() < 1e-4);
    }

    #[test]
    fn transparent_texels_do_not_bleed_their_colour() {
        let cutout = image(2, 1, |x, _| if x == 0 { [255, 0, 0, 255] } else { [0, 255, 0, 0] });
        let pyramid = Pyramid::new(&cutout, Encoding::Srgb, true);
        assert!((pyramid.texel(1, 0, 0) - Vec4::new(1.0, 0.0, 0.0, 0.5)).abs().max_element() < 1e-4);
    }

    #[test]
    fn odd_sizes_keep_the_mean() {
        let odd = image(7, 5, |x, y| [(x * 30) as u8, (y * 50) as u8, ((x * y) % 251) as u8, 255]);
        let pyramid = Pyramid::new(&odd, Encoding::Linear, true);
        let mut mean = Vec4::ZERO;
        for i in 0..35 {
            mean += pyramid.texel(0, i % 7, i / 7) / 35.0;
        }
        let last = pyramid.level_count() - 1;
        assert!((pyramid.texel(last, 0, 0) - mean).abs().max_element() < 1e-4);
        assert_eq!(pyramid.level(last), Level { width: 1, height: 1, first: pyramid.coarse.len() - 1 });
        assert_eq!(pyramid.coarse_bytes(), 8 * (3 * 2 + 1));
    }
}
