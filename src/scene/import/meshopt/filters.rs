//! What is undone after the attribute codec.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "values are rounded, and what lies outside the type's range saturates"
)]

/// A filter, checked against the stride.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl Filter {
    /// The filter of this name for elements of `stride` bytes.
    pub(super) fn named(name: &str, stride: usize) -> Result<Self, String> {
        let (filter, fits) = match name {
            "NONE" => (Self::None, true),
            "OCTAHEDRAL" => (Self::Octahedral, stride == 4 || stride == 8),
            "QUATERNION" => (Self::Quaternion, stride == 8),
            "EXPONENTIAL" => (Self::Exponential, stride.is_multiple_of(4)),
            "COLOR" => (Self::Color, stride == 4 || stride == 8),
            other => return Err(format!("filter `{}` is unknown", other.escape_debug())),
        };
        if fits { Ok(filter) } else { Err(format!("filter {name} does not go with byteStride {stride}")) }
    }

    /// Undoes the filter on whole elements.
    pub(super) fn apply(self, bytes: &mut [u8], stride: usize) {
        match self {
            Self::None => {}
            Self::Octahedral if stride == 4 => bytes.chunks_exact_mut(4).for_each(|e| {
                let v = std::array::from_fn(|i| i32::from(e[i].cast_signed()));
                let out = octahedral(v, 127.0);
                (0..3).for_each(|i| e[i] = (out[i] as i8).cast_unsigned());
            }),
            Self::Octahedral => each_i16(bytes, |v| {
                let [x, y, z] = octahedral(v.map(i32::from), 32767.0);
                [x as i16, y as i16, z as i16, v[3]]
            }),
            Self::Quaternion => each_i16(bytes, quaternion),
            Self::Exponential => bytes.chunks_exact_mut(4).for_each(|e| {
                let value = exponential(i32::from_le_bytes([e[0], e[1], e[2], e[3]]));
                e.copy_from_slice(&value.to_le_bytes());
            }),
            Self::Color if stride == 4 => bytes.chunks_exact_mut(4).for_each(|e| {
                let chroma = |i: usize| i32::from(e[i].cast_signed());
                let out = color([i32::from(e[0]), chroma(1), chroma(2), i32::from(e[3])], 255.0);
                (0..4).for_each(|i| e[i] = out[i] as u8);
            }),
            Self::Color => each_i16(bytes, |v| {
                let luma = |v: i16| i32::from(v.cast_unsigned());
                let out = color([luma(v[0]), v[1].into(), v[2].into(), luma(v[3])], 65535.0);
                out.map(|c| (c as u16).cast_signed())
            }),
        }
    }
}

fn each_i16(bytes: &mut [u8], undo: impl Fn([i16; 4]) -> [i16; 4]) {
    for element in bytes.chunks_exact_mut(8) {
        let values = std::array::from_fn(|i| i16::from_le_bytes([element[i * 2], element[i * 2 + 1]]));
        for (pair, value) in element.chunks_exact_mut(2).zip(undo(values)) {
            pair.copy_from_slice(&value.to_le_bytes());
        }
    }
}

/// A unit vector from octahedral coordinates; `v[2]` is what 1 was stored as.
fn octahedral(v: [i32; 4], max: f32) -> [f32; 3] {
    let one = v[2] as f32;
    let (mut x, mut y) = (v[0] as f32 / one, v[1] as f32 / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    x += if x >= 0.0 { fold } else { -fold };
    y += if y >= 0.0 { fold } else { -fold };
    let length = (x * x + y * y + z * z).sqrt();
    // A stored 1 of zero gives NaN, which the conversion to integers turns into 0.
    [x, y, z].map(|c| (c / length * max).round())
}

fn quaternion(v: [i16; 4]) -> [i16; 4] {
    let one = f32::from(v[3] | 3);
    let part = |i: usize| f32::from(v[i]) / one * std::f32::consts::FRAC_1_SQRT_2;
    let (x, y, z) = (part(0), part(1), part(2));
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = usize::from(v[3].cast_unsigned() & 3);
    let mut out = [0; 4];
    for (step, value) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + step) % 4] = (value * 32767.0).round() as i16;
    }
    out
}

/// `mantissa * 2^exponent` with 24 and 8 bits.
fn exponential(v: i32) -> f32 {
    let power = f64::from_bits(((1023 + i64::from(v >> 24)) << 52).cast_unsigned());
    (power * f64::from(v << 8 >> 8)) as f32
}

/// RGBA from luma, orange and green differences, and an alpha whose top bit tells the bits in use.
fn color(v: [i32; 4], max: f32) -> [f32; 4] {
    let [y, co, cg, alpha] = v;
    let ones = (1_i64 << (32 - alpha.leading_zeros())) - 1;
    let alpha = i64::from(alpha) & (ones >> 1);
    let alpha = alpha << 1 | alpha & 1;
    let scale = max / ones as f32;
    let rgb = [y + co - cg, y + cg, y - co - cg];
    let [r, g, b] = rgb.map(|c| (c as f32 * scale).round());
    [r, g, b, (alpha as f32 * scale).round()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(filter: Filter, stride: usize, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        filter.apply(&mut bytes, stride);
        bytes
    }

    fn shorts(values: [i16; 4]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn octahedral_axes_come_back_whole() {
        assert_eq!(apply(Filter::Octahedral, 4, &[0, 0, 127, 9]), [0, 0, 127, 9]);
        assert_eq!(apply(Filter::Octahedral, 4, &[127, 0, 127, 9]), [127, 0, 0, 9]);
        // Both coordinates at their end is the opposite pole; a 1 of 10 bits in 16.
        assert_eq!(apply(Filter::Octahedral, 8, &shorts([511, 511, 511, -5])), shorts([0, 0, -32767, -5]));
    }

    #[test]
    fn quaternions_put_the_largest_component_in_its_place() {
        assert_eq!(apply(Filter::Quaternion, 8, &shorts([0, 0, 0, 0x7fff])), shorts([0, 0, 0, 32767]));
        // Largest is x; y at its greatest makes both 1/sqrt(2).
        let out = apply(Filter::Quaternion, 8, &shorts([32767, 0, 0, 0x7ffc]));
        assert_eq!(out, shorts([23170, 23170, 0, 0]));
    }

    #[test]
    fn exponentials_are_exact() {
        let at = |e: i32, m: i32| exponential(e << 24 | m & 0x00ff_ffff).to_bits();
        assert_eq!(at(0, 5), 5.0_f32.to_bits());
        assert_eq!(at(-3, -12), (-1.5_f32).to_bits());
        assert_eq!(at(100, 1), 2.0_f32.powi(100).to_bits());
    }

    #[test]
    fn colors_scale_to_full_range() {
        // 8 bits in use: grey 255 with alpha of 7 bits all set.
        assert_eq!(apply(Filter::Color, 4, &[255, 0, 0, 255]), [255, 255, 255, 255]);
        // 4 bits in use.
        assert_eq!(apply(Filter::Color, 4, &[15, 0, 0, 15]), [255, 255, 255, 255]);
        assert_eq!(apply(Filter::Color, 4, &[0, 0, 0, 8]), [0, 0, 0, 0]);
    }
}
