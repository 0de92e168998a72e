use std::sync::Arc;

use glam::Vec4;

use crate::{
    render::{
        tone::linear_from_srgb8,
        wide::{Floats, LANES, One, only},
    },
    scene::Image,
};

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
    /// First texel in `coarse`, 0 for level 0.
    pub(crate) first: u32,
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
        let first = u32::try_from(self.coarse.len()).expect("fewer texels than the finest level, whose number fits");
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

    /// A texel in linear RGBA; row 0 is the top.
    pub(crate) fn texel(&self, level: usize, x: u32, y: u32) -> Vec4 {
        let Level { width, first, .. } = self.levels[level];
        let mut places = [0; LANES];
        places[0] = y * width + x + first;
        Vec4::from(self.texels::<One>(&places, 1, u32::from(level == 0)).map(only))
    }

    /// The texels of the lanes of `mask` in linear RGBA, where a place is a level's first texel with those before it in rows and columns; `finest` are the lanes
    /// that read level 0.
    #[inline(always)]
    pub(crate) fn texels<F: Floats>(&self, places: &[u32; LANES], mask: u32, finest: u32) -> [F; 4] {
        if mask & finest == 0 {
            return F::of_words(&self.coarse, places);
        }
        let fine = F::of_bytes(self.fine.as_chunks().0, self.table, places);
        if mask & !finest == 0 {
            return fine;
        }
        let mut out = F::of_words(&self.coarse, places);
        for i in 0..4 {
            out[i] = F::select(finest, fine[i], out[i]);
        }
        out
    }

    /// Bytes that the coarser levels take.
    pub(crate) fn coarse_bytes(&self) -> usize {
        self.coarse.len() * size_of::<[u16; 4]>()
    }
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
        assert_eq!(
            pyramid.level(last),
            Level { width: 1, height: 1, first: u32::try_from(pyramid.coarse.len() - 1).unwrap() }
        );
        assert_eq!(pyramid.coarse_bytes(), 8 * (3 * 2 + 1));
    }
}
