//! The pixel sampler: where in the pixel, on the light and over the hemisphere each sample falls.
//!
//! Positions are counted in 32-bit fractions of one, so wrap-around is exact.

/// Steps of the R2 sequence in 32-bit fractions: `1/g`, `1/g^2` with `g` the real root of `g^3 = g + 1`.
///
/// # Source
/// Martin Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
const STEP: [u32; 2] = [0xC13F_A9A9, 0x91E1_0DA6];

/// A 32-bit fraction as a number in `[0, 1)`.
#[inline(always)]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Mixes a number to 32 well-spread bits.
///
/// # Source
/// The finaliser of Steele, Lea and Flood's "Fast Splittable Pseudorandom Number Generators", 2014.
#[inline(always)]
pub(crate) fn hash(x: u64) -> u32 {
    let mut z = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    let [_, _, _, _, upper @ ..] = (z ^ (z >> 31)).to_le_bytes();
    u32::from_le_bytes(upper)
}

/// Point `index` of the R2 sequence begun at `start`.
#[inline(always)]
fn r2(index: u32, start: [u32; 2]) -> (f32, f32) {
    let at = |axis: usize| unit(start[axis].wrapping_add(STEP[axis].wrapping_mul(index)));
    (at(0), at(1))
}

/// Where within the pixel sample `index` falls, in `[0, 1)` squared. All pixels share the pattern, whose prefixes are evenly spread.
///
/// Samples come in pairs, each the other mirrored at the pixel's centre: the mean of an even number lies there, so that a picture of few samples
/// is not shifted.
#[inline(always)]
pub(crate) fn subpixel(index: u32) -> (f32, f32) {
    // Half a step from the centre, so that the two of a pair are a step apart.
    let [x, y] = STEP.map(|step| (0x8000_0000 + step / 2).wrapping_add(step.wrapping_mul(index / 2)));
    if index.is_multiple_of(2) { (unit(x), unit(y)) } else { (unit(x.wrapping_neg()), unit(y.wrapping_neg())) }
}

/// Where a single sample falls.
pub(crate) const CENTRE: (f32, f32) = (0.5, 0.5);

/// What decides the random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSampler {
    key: u64,
    sample: u32,
}

impl PixelSampler {
    /// The numbers of sample `sample` of pixel `pixel` in frame `frame` under `seed`.
    #[inline(always)]
    pub(crate) fn new(seed: u64, frame: u64, pixel: u32, sample: u32) -> Self {
        let scene = seed.wrapping_mul(0xD6E8_FEB8_6659_FD93) ^ frame.wrapping_mul(0xA076_1D64_78BD_642F);
        Self { key: scene ^ (u64::from(pixel) << 20), sample }
    }

    /// Point `index` of `count` on the unit square for `purpose`; the samples of a pixel together continue one
    /// evenly spread sequence.
    #[inline(always)]
    pub(crate) fn square(&self, purpose: u32, index: u32, count: u32) -> (f32, f32) {
        let key = self.key ^ (u64::from(purpose) << 56);
        let start = [hash(key), hash(key ^ 0x5555_0000_0000)];
        r2(self.sample.wrapping_mul(count).wrapping_add(index), start)
    }
}

/// The samplers of a block of pixels, made where one is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samplers {
    pub(crate) seed: u64,
    pub(crate) frame: u64,
    /// Number of the block's first pixel, of pixels in a row of the picture, and of those in a row of the block.
    pub(crate) first: u32,
    pub(crate) stride: u32,
    pub(crate) columns: u32,
    /// Number of the sample in each pixel's pattern.
    pub(crate) sample: u32,
}

impl Samplers {
    /// That of a pixel of the block, row by row.
    #[inline(always)]
    pub(crate) fn at(&self, lane: usize) -> PixelSampler {
        #[expect(clippy::cast_possible_truncation, reason = "at most 16")]
        let lane = lane as u32;
        let pixel = self.first.wrapping_add(lane / self.columns * self.stride + lane % self.columns);
        PixelSampler::new(self.seed, self.frame, pixel, self.sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_number_of_samples_lies_around_the_pixel_centre() {
        for pair in 0..500 {
            let ((x, y), (u, v)) = (subpixel(2 * pair), subpixel(2 * pair + 1));
            assert!((x + u - 1.0).abs() < 1e-6 && (y + v - 1.0).abs() < 1e-6, "{pair}: {x} {y}, {u} {v}");
        }
    }

    /// No two of four, or of eight, share a row or a column of as many.
    #[test]
    fn few_samples_fall_into_all_rows_and_columns() {
        for (count, all) in [(4, 0xf), (8, 0xff)] {
            let mut lines = [0; 2];
            for (x, y) in (0..count).map(subpixel) {
                lines[0] |= 1 << (x * count as f32) as u32;
                lines[1] |= 1 << (y * count as f32) as u32;
            }
            assert_eq!(lines, [all; 2]);
        }
    }

    #[test]
    fn the_first_16_samples_fill_a_4_by_4_grid_well() {
        let mut cells = [0; 16];
        for i in 0..16 {
            let (x, y) = subpixel(i);
            assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
            cells[(x * 4.0) as usize + 4 * (y * 4.0) as usize] += 1;
        }
        assert!(cells.iter().filter(|&&c| c > 0).count() >= 11, "{cells:?}");
    }

    #[test]
    fn neighbouring_pixels_and_frames_draw_different_numbers() {
        let base = PixelSampler::new(0, 0, 10, 0).square(0, 0, 1);
        assert_ne!(base, PixelSampler::new(0, 0, 11, 0).square(0, 0, 1));
        assert_ne!(base, PixelSampler::new(0, 1, 10, 0).square(0, 0, 1));
        assert_ne!(base, PixelSampler::new(1, 0, 10, 0).square(0, 0, 1));
        assert_ne!(base, PixelSampler::new(0, 0, 10, 0).square(1, 0, 1));
    }

    #[test]
    fn samples_of_two_renders_continue_one_sequence() {
        let all: Vec<_> = (0..8).map(|s| PixelSampler::new(3, 5, 7, s).square(1, 0, 1)).collect();
        let late: Vec<_> = (4..8).map(|s| PixelSampler::new(3, 5, 7, s).square(1, 0, 1)).collect();
        assert_eq!(all[4..], late[..]);
    }
}
