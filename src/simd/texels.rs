//! Texels of many places at once.

use super::{Array, Lanes, Scalar, Simd};

/// Lanes of texels' channels.
pub trait Texels: Lanes<Elem = f32> {
    /// The level whose code these lanes are made for.
    type Level: Simd;

    /// Texels of bytes: lane i gets that at `places[i]`, or the last where that is beyond. The first three channels are those entries of `table`, the
    /// fourth is a 255th of the byte.
    ///
    /// Panics without texels and with more than 2^30.
    fn of_bytes(texels: &[[u8; 4]], table: &[f32; 256], places: &[u32; 16]) -> [Self; 4];

    /// Texels of 16 bits a channel, each a 65535th; otherwise as [`Texels::of_bytes`], of at most 2^29.
    fn of_words(texels: &[[u16; 4]], places: &[u32; 16]) -> [Self; 4];
}

/// The last texel's place. Places in words are below 2^31.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "checked")]
pub(super) fn last<T>(texels: &[T]) -> u32 {
    let (len, most) = (texels.len(), (1 << 32) / size_of::<T>());
    assert!(len > 0 && len <= most, "textures have some texels, at most {most}");
    (len - 1) as u32
}

impl<const N: usize> Texels for Array<f32, N> {
    type Level = Scalar;

    #[inline(always)]
    fn of_bytes(texels: &[[u8; 4]], table: &[f32; 256], places: &[u32; 16]) -> [Self; 4] {
        let last = last(texels);
        let mut rows = [[0.0; N]; 4];
        for lane in 0..N {
            let [r, g, b, a] = texels[places[lane].min(last) as usize];
            let [red, green, blue, alpha] = &mut rows;
            (red[lane], green[lane], blue[lane]) =
                (table[usize::from(r)], table[usize::from(g)], table[usize::from(b)]);
            alpha[lane] = f32::from(a) * (1.0 / 255.0);
        }
        rows.map(|row| Self::load(&row))
    }

    #[inline(always)]
    fn of_words(texels: &[[u16; 4]], places: &[u32; 16]) -> [Self; 4] {
        let last = last(texels);
        let mut rows = [[0.0; N]; 4];
        for lane in 0..N {
            let texel = texels[places[lane].min(last) as usize];
            for (row, word) in rows.iter_mut().zip(texel) {
                row[lane] = f32::from(word) * (1.0 / 65535.0);
            }
        }
        rows.map(|row| Self::load(&row))
    }
}
