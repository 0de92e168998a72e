//! Animated PNG. Each frame is compressed by itself, so that encoder threads work on several at once; the
//! chunks are those of the "Animated PNG Specification" 1.0, with one data chunk a frame.
#![expect(clippy::cast_possible_truncation, reason = "frames are at most MAX_FRAMES, chunks below 2^31 bytes")]

use super::{FilmSettings, FrameSlot, png_file, stamp::KEYWORD};

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Signature and every chunk before the first frame.
pub(super) fn header(film: &FilmSettings) -> Vec<u8> {
    let mut out = SIGNATURE.to_vec();
    let [w, h] = [film.width, film.height].map(u32::to_be_bytes);
    chunk(&mut out, *b"IHDR", &[&w, &h, &[8, 2, 0, 0, 0]]);
    chunk(&mut out, *b"sRGB", &[&[0]]);
    chunk(&mut out, *b"tEXt", &[b"Software\0", super::SOFTWARE.as_bytes()]);
    chunk(&mut out, *b"tEXt", &[KEYWORD.as_bytes(), b"\0", film.stamp.as_str().as_bytes()]);
    chunk(&mut out, *b"acTL", &[&(film.frames as u32).to_be_bytes(), &0u32.to_be_bytes()]);
    out
}

/// One frame: its control chunk and its data, into the slot's bytes.
pub(super) fn frame(film: &FilmSettings, slot: &mut FrameSlot) -> Result<(), String> {
    slot.film.to_srgb8(&mut slot.rgba);
    let mut rgb = std::mem::take(&mut slot.bytes);
    png_file::drop_alpha(&slot.rgba, &mut rgb);
    slot.scratch.clear();
    png_file::encode_rgb(film.width, film.height, &rgb, None, &mut slot.scratch)?;
    slot.bytes = rgb;
    let out = &mut slot.bytes;
    out.clear();

    let (delay, per) = delay(film.fps.num(), film.fps.den());
    let [w, h] = [film.width, film.height].map(u32::to_be_bytes);
    let sequence = |n: u64| (n as u32).to_be_bytes();
    let first_number = if slot.ordinal == 0 { 0 } else { 2 * slot.ordinal - 1 };
    let (number, origin, ops) = (sequence(first_number), [0; 8], [0; 2]);
    chunk(out, *b"fcTL", &[&number, &w, &h, &origin, &delay.to_be_bytes(), &per.to_be_bytes(), &ops]);
    let number = sequence(first_number + 1);
    let mut parts: Vec<&[u8]> = Vec::with_capacity(4);
    if slot.ordinal > 0 {
        parts.push(&number);
    }
    parts.extend(chunks(&slot.scratch).filter(|(name, _)| *name == b"IDAT").map(|(_, data)| data));
    chunk(out, if slot.ordinal == 0 { *b"IDAT" } else { *b"fdAT" }, &parts);
    Ok(())
}

/// The chunk that ends the file.
pub(super) fn trailer() -> Vec<u8> {
    let mut out = Vec::new();
    chunk(&mut out, *b"IEND", &[]);
    out
}

/// Seconds a frame as a fraction of 16-bit numbers; exact where one exists, else in milliseconds or seconds.
fn delay(num: u32, den: u32) -> (u16, u16) {
    if let (Ok(delay), Ok(per)) = (u16::try_from(den), u16::try_from(num)) {
        return (delay, per);
    }
    let rounded = |per: u64| (u64::from(den) * per * 2 + u64::from(num)) / (2 * u64::from(num));
    match u16::try_from(rounded(1000)) {
        Ok(delay) => (delay, 1000),
        Err(_) => (u16::try_from(rounded(1)).unwrap_or(u16::MAX), 1),
    }
}

fn chunk(out: &mut Vec<u8>, name: [u8; 4], parts: &[&[u8]]) {
    let length: usize = parts.iter().map(|p| p.len()).sum();
    out.extend((length as u32).to_be_bytes());
    let start = out.len();
    out.extend(name);
    for part in parts {
        out.extend_from_slice(part);
    }
    let crc = crc32fast::hash(&out[start..]);
    out.extend(crc.to_be_bytes());
}

/// Name and data of every chunk of a PNG that we wrote.
fn chunks(mut png: &[u8]) -> impl Iterator<Item = (&[u8; 4], &[u8])> {
    png = png.get(SIGNATURE.len()..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (length, rest) = png.split_first_chunk::<4>()?;
        let (name, rest) = rest.split_first_chunk::<4>()?;
        let (data, rest) = rest.split_at_checked(u32::from_be_bytes(*length) as usize)?;
        png = rest.get(4..)?;
        Some((name, data))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_exact_or_nearest() {
        assert_eq!(delay(30, 1), (1, 30));
        assert_eq!(delay(30000, 1001), (1001, 30000));
        assert_eq!(delay(120_000, 1001), (8, 1000));
        assert_eq!(delay(1, 100_000), (u16::MAX, 1));
        assert_eq!(delay(7, 1_000_000), (u16::MAX, 1));
        assert_eq!(delay(1_000_000, 1), (0, 1000));
    }
}
