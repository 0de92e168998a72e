//! Animated GIF: a palette a frame, looping for ever, the stamp in a comment.

use std::io::BufRead;

use gif::{AnyExtension, DecodeOptions, Encoder, Extension, Frame, MemoryLimit, Repeat};

use super::{
    FilmSettings, Fps, FrameSlot,
    resume::{Expected, Unfit},
    stamp::KEYWORD,
};

/// Palette search looks at every n-th pixel, n = 1 to 30, at this many or more. On rendered pictures of 720p,
/// n = 30 loses nothing to smaller ones (`benches/records/2026-11-22-png.md`); small pictures need all their pixels.
const LOOKED_AT: usize = 16_384;

/// The n for a number of pixels.
fn sampling(pixels: usize) -> i32 {
    i32::try_from(pixels / LOOKED_AT).map_or(30, |n| n.clamp(1, 30))
}

/// Everything before the first frame.
///
/// # Errors
/// When a side is over 65535.
pub(super) fn header(film: &FilmSettings) -> Result<Vec<u8>, String> {
    let (width, height) = size(film)?;
    let wrong = |e: gif::EncodingError| e.to_string();
    let mut encoder = Encoder::new(Vec::new(), width, height, &[]).map_err(wrong)?;
    encoder.set_repeat(Repeat::Infinite).map_err(wrong)?;
    let comment = format!("{KEYWORD} {}", film.stamp);
    encoder.write_raw_extension(AnyExtension(Extension::Comment as u8), &[comment.as_bytes()]).map_err(wrong)?;
    without_trailer(encoder)
}

/// One frame, into the slot's bytes.
pub(super) fn frame(film: &FilmSettings, slot: &mut FrameSlot) -> Result<(), String> {
    let (width, height) = size(film)?;
    slot.film.to_srgb8(&mut slot.rgba);
    let mut frame = Frame::from_rgba_speed(width, height, &mut slot.rgba, sampling(slot.film.color.len()));
    frame.delay = delay(film.fps, slot.ordinal);
    frame.make_lzw_pre_encoded();
    let mut buffer = std::mem::take(&mut slot.bytes);
    buffer.clear();
    let wrong = |e: gif::EncodingError| e.to_string();
    let mut encoder = Encoder::new(buffer, width, height, &[]).map_err(wrong)?;
    let start = encoder.get_ref().len();
    encoder.write_lzw_pre_encoded_frame(&frame).map_err(wrong)?;
    slot.bytes = without_trailer(encoder)?;
    slot.bytes.drain(..start);
    Ok(())
}

/// The byte that ends the file.
pub(super) fn trailer() -> Vec<u8> {
    vec![0x3b]
}

fn size(film: &FilmSettings) -> Result<(u16, u16), String> {
    match (u16::try_from(film.width), u16::try_from(film.height)) {
        (Ok(width), Ok(height)) => Ok((width, height)),
        _ => Err("a GIF is at most 65535 pixels wide and high".to_owned()),
    }
}

fn without_trailer(encoder: Encoder<Vec<u8>>) -> Result<Vec<u8>, String> {
    let mut bytes = encoder.into_inner().map_err(|e| e.to_string())?;
    bytes.pop();
    Ok(bytes)
}

/// Hundredths of a second that frame `ordinal` stays, so that no error adds up over the film.
fn delay(fps: Fps, ordinal: u64) -> u16 {
    let (num, den) = (u128::from(fps.num()), u128::from(fps.den()));
    let end_of = |count: u64| (200 * u128::from(count) * den + num) / (2 * num);
    u16::try_from(end_of(ordinal + 1) - end_of(ordinal)).unwrap_or(u16::MAX)
}

/// Decodes to the end and compares what the file says with `expected`.
pub(super) fn check(file: impl BufRead, bytes: &[u8], expected: &Expected<'_>) -> Result<(), Unfit> {
    let broken = |e: gif::DecodingError| Unfit::Broken(e.to_string());
    let mut options = DecodeOptions::new();
    options.set_memory_limit(MemoryLimit::Unlimited);
    let mut decoder = options.read_info(file).map_err(broken)?;
    let mut frames = 0;
    while decoder.read_next_frame().map_err(broken)?.is_some() {
        frames += 1;
    }
    let (width, height) = (u32::from(decoder.width()), u32::from(decoder.height()));
    if bytes.last() != trailer().last() {
        return Err(Unfit::Broken("the end is missing".to_owned()));
    }
    expected.compare(comment(bytes).as_deref(), width, height, frames)
}

/// The stamp in the comment, which stands before the first frame.
fn comment(bytes: &[u8]) -> Option<String> {
    let mark = format!("{KEYWORD} ");
    let head = &bytes[..bytes.len().min(1024)];
    let at = head.windows(mark.len()).position(|w| w == mark.as_bytes())?;
    let length = usize::from(*head.get(at.checked_sub(1)?)?);
    let text = bytes.get(at + mark.len()..at + length)?;
    String::from_utf8(text.to_vec()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_add_up_to_the_film_time() {
        for text in ["30", "24", "29.97", "60", "12.5", "50"] {
            let fps: Fps = text.parse().unwrap();
            let sum: u64 = (0..1000).map(|i| u64::from(delay(fps, i))).sum();
            let want = 100_000.0 / fps.as_f64();
            assert!((sum as f64 - want).abs() <= 0.5, "{text}: {sum} for {want}");
        }
    }
}
