//! YUV4MPEG2: 8-bit Y'`CbCr` with the BT.709 matrix in limited range, 4:2:0 or 4:4:4.
//!
//! In 4:2:0 a chroma sample is the mean of its 2 x 2 pixels, so it sits in their middle, which the header calls
//! `420jpeg`. The header has no word for the matrix: players take BT.709 from the size, or are told. `FFmpeg` reads
//! headers of up to 95 characters, so the stamp is a short one, left out where even that is too long.

use super::{
    FilmSettings, FrameSlot,
    resume::{Expected, Unfit},
};

/// Resolution of colour against brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Chroma {
    /// Half in both directions; what every player takes.
    #[default]
    C420,
    /// Full.
    C444,
}

/// Longest line that `FFmpeg` reads, without its end.
const MAX_LINE: usize = 95;

/// What comes before the stamp in the header.
const STAMP: &str = "XK=";

const FRAME_MARK: &[u8] = b"FRAME\n";

/// The line before the first frame.
pub(super) fn header(film: &FilmSettings) -> Vec<u8> {
    let chroma = match film.chroma {
        Chroma::C420 => "420jpeg",
        Chroma::C444 => "444",
    };
    let FilmSettings { width, height, fps, stamp, .. } = film;
    let (num, den) = (fps.num(), fps.den());
    let mut line = format!("YUV4MPEG2 W{width} H{height} F{num}:{den} Ip A1:1 C{chroma} XCOLORRANGE=LIMITED");
    let stamp = format!(" {STAMP}{}", stamp.short());
    if line.len() + stamp.len() <= MAX_LINE {
        line += &stamp;
    }
    line.push('\n');
    line.into_bytes()
}

/// One frame, into the slot's bytes.
pub(super) fn frame(film: &FilmSettings, slot: &mut FrameSlot) {
    slot.film.to_srgb8(&mut slot.rgba);
    slot.bytes.clear();
    slot.bytes.extend_from_slice(FRAME_MARK);
    let width = film.width as usize;
    slot.bytes.extend(slot.rgba.chunks_exact(4).map(|p| luma(sum(p))));
    for weights in [&CB, &CR] {
        match film.chroma {
            Chroma::C444 => slot.bytes.extend(slot.rgba.chunks_exact(4).map(|p| chroma::<1>(weights, sum(p)))),
            Chroma::C420 => halved_plane(weights, &slot.rgba, width, &mut slot.bytes),
        }
    }
}

/// Bytes of a frame, mark included.
fn frame_bytes(film: &Expected<'_>, chroma: Chroma) -> u64 {
    let (w, h) = (u64::from(film.width), u64::from(film.height));
    let planes = match chroma {
        Chroma::C444 => 3 * w * h,
        Chroma::C420 => w * h + 2 * w.div_ceil(2) * h.div_ceil(2),
    };
    planes + FRAME_MARK.len() as u64
}

const KR: f64 = 0.2126;
const KB: f64 = 0.0722;
const KG: f64 = 1.0 - KR - KB;

/// Bits of the fixed-point weights.
const BITS: u32 = 20;

/// A weight for the limited range in fixed point, rounded to nearest.
#[expect(clippy::cast_possible_truncation, reason = "weights are below 1 and BITS below 31")]
const fn weight(value: f64, range: f64) -> i32 {
    let scaled = value * range / 255.0 * (1 << BITS) as f64;
    (if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 }) as i32
}

const Y: [i32; 3] = [weight(KR, 219.0), weight(KG, 219.0), weight(KB, 219.0)];
/// Chroma weights of R, G and B; the last of each makes the sum 0, so that grey is exactly 128.
const CB: [i32; 3] = {
    let (r, g) = (weight(-KR / (2.0 * (1.0 - KB)), 224.0), weight(-KG / (2.0 * (1.0 - KB)), 224.0));
    [r, g, -r - g]
};
const CR: [i32; 3] = {
    let (g, b) = (weight(-KG / (2.0 * (1.0 - KR)), 224.0), weight(-KB / (2.0 * (1.0 - KR)), 224.0));
    [-g - b, g, b]
};

#[inline(always)]
fn sum(pixel: &[u8]) -> [i32; 3] {
    [i32::from(pixel[0]), i32::from(pixel[1]), i32::from(pixel[2])]
}

#[inline(always)]
fn dot(a: &[i32; 3], b: [i32; 3]) -> i32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "16 to 235 by the weights")]
fn luma(rgb: [i32; 3]) -> u8 {
    ((dot(&Y, rgb) + (1 << (BITS - 1))) >> BITS) as u8 + 16
}

/// Chroma of the mean of `N` pixels, N = 1 or 4, whose sum is `rgb`.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "16 to 240 by the weights")]
fn chroma<const N: u32>(weights: &[i32; 3], rgb: [i32; 3]) -> u8 {
    let bits = BITS + N.trailing_zeros();
    (((dot(weights, rgb) + (1 << (bits - 1))) >> bits) + 128) as u8
}

/// A chroma plane at half size; at odd edges the last row and column count twice.
fn halved_plane(weights: &[i32; 3], rgba: &[u8], width: usize, out: &mut Vec<u8>) {
    let rows: Vec<&[u8]> = rgba.chunks_exact(4 * width).collect();
    for pair in rows.chunks(2) {
        let (above, below) = (pair[0], pair[pair.len() - 1]);
        out.extend(above.chunks(8).zip(below.chunks(8)).map(|(a, b)| {
            let corners = [&a[..4], &a[a.len() - 4..], &b[..4], &b[b.len() - 4..]].map(sum);
            let total = corners.iter().fold([0; 3], |t, c| [t[0] + c[0], t[1] + c[1], t[2] + c[2]]);
            chroma::<4>(weights, total)
        }));
    }
}

/// Compares the header with `expected`, the length with the header, and the frame marks with both.
pub(super) fn check(bytes: &[u8], expected: &Expected<'_>) -> Result<(), Unfit> {
    let broken = |why: &str| Unfit::Broken(why.to_owned());
    let end = bytes.iter().position(|&b| b == b'\n').ok_or_else(|| broken("no header"))?;
    let line = std::str::from_utf8(&bytes[..end]).map_err(|_| broken("no header"))?;
    let field = |name: &str| line.split(' ').skip(1).find_map(|w| w.strip_prefix(name));
    let number = |name: &str| field(name).and_then(|t| t.parse().ok()).ok_or_else(|| broken("no size"));
    if !line.starts_with("YUV4MPEG2 ") {
        return Err(broken("no header"));
    }
    let chroma = if field("C") == Some("444") { Chroma::C444 } else { Chroma::C420 };
    let (width, height) = (number("W")?, number("H")?);
    let stamp = field(STAMP).filter(|&s| s == expected.stamp.short()).map(|_| expected.stamp.as_str());
    expected.compare(stamp, width, height, expected.frames)?;
    let data = &bytes[end + 1..];
    let size = usize::try_from(frame_bytes(expected, chroma)).map_err(|_| broken("too large"))?;
    let whole = data.len().is_multiple_of(size) && data.chunks(size).all(|f| f.starts_with(FRAME_MARK));
    if whole && (data.len() / size) as u64 == expected.frames { Ok(()) } else { Err(broken("frames are missing")) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn exact(rgb: [i32; 3]) -> [f64; 3] {
        let [r, g, b] = rgb.map(|c| f64::from(c) / 255.0);
        let y = KR * r + KG * g + KB * b;
        let (cb, cr) = ((b - y) / (2.0 * (1.0 - KB)), (r - y) / (2.0 * (1.0 - KR)));
        [16.0 + 219.0 * y, 128.0 + 224.0 * cb, 128.0 + 224.0 * cr]
    }

    #[test]
    fn known_colours_have_their_bt709_codes() {
        let code = |rgb| [luma(rgb), chroma::<1>(&CB, rgb), chroma::<1>(&CR, rgb)];
        assert_eq!(code([0, 0, 0]), [16, 128, 128]);
        assert_eq!(code([255, 255, 255]), [235, 128, 128]);
        assert_eq!(code([255, 0, 0]), [63, 102, 240]);
        assert_eq!(code([0, 255, 0]), [173, 42, 26]);
        assert_eq!(code([0, 0, 255]), [32, 240, 118]);
    }

    proptest! {
        #[test]
        fn codes_are_the_nearest_to_the_standard(rgb in prop::array::uniform3(0i32..=255)) {
            let code = [luma(rgb), chroma::<1>(&CB, rgb), chroma::<1>(&CR, rgb)];
            for (got, want) in code.iter().zip(exact(rgb)) {
                prop_assert!((f64::from(*got) - want).abs() < 0.501, "{:?}: {:?} for {:?}", rgb, code, exact(rgb));
            }
            prop_assert_eq!(chroma::<4>(&CB, rgb.map(|c| 4 * c)), code[1]);
        }

        #[test]
        fn greys_have_no_colour(v in 0i32..=255) {
            prop_assert_eq!([chroma::<1>(&CB, [v; 3]), chroma::<1>(&CR, [v; 3])], [128, 128]);
        }
    }

    #[test]
    fn odd_sizes_round_chroma_up_and_repeat_the_edge() {
        let red = [255, 0, 0, 255];
        let grey = [9, 9, 9, 255];
        let rgba: Vec<u8> = [red, red, grey, red, red, grey, grey, grey, red].concat();
        let mut plane = Vec::new();
        halved_plane(&CR, &rgba, 3, &mut plane);
        assert_eq!(plane, [240, 128, 128, 240]);
    }
}
