//! PNG stills: 8-bit sRGB without alpha, the stamp in a text chunk.

use std::io::{BufRead, Seek};

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Filter, SrgbRenderingIntent};

use super::{
    FrameSlot,
    resume::{Expected, Unfit},
    stamp::{KEYWORD, Stamp},
};

/// Encodes the slot's picture into its bytes.
///
/// # Errors
/// Words on what PNG does not allow (a side of 0 or over 2^31 - 1).
pub(super) fn encode(slot: &mut FrameSlot, stamp: &Stamp) -> Result<(), String> {
    slot.film.to_srgb8(&mut slot.rgba);
    let FrameSlot { film, rgba, scratch, bytes, .. } = slot;
    drop_alpha(rgba, scratch);
    bytes.clear();
    encode_rgb(film.width, film.height, scratch, Some(stamp), bytes)
}

/// Writes a PNG of `rgb` (3 bytes a pixel, rows top down) to the end of `out`.
///
/// Filter and level were chosen by measurement: `benches/records/2026-11-22-png.md`.
pub(crate) fn encode_rgb(
    width: u32,
    height: u32,
    rgb: &[u8],
    stamp: Option<&Stamp>,
    out: &mut Vec<u8>,
) -> Result<(), String> {
    let wrong = |e: png::EncodingError| e.to_string();
    let mut encoder = Encoder::new(out, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    encoder.set_filter(Filter::Paeth);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    if let Some(stamp) = stamp {
        encoder.add_text_chunk("Software".to_owned(), super::SOFTWARE.to_owned()).map_err(wrong)?;
        encoder.add_text_chunk(KEYWORD.to_owned(), stamp.to_string()).map_err(wrong)?;
    }
    let mut writer = encoder.write_header().map_err(wrong)?;
    writer.write_image_data(rgb).map_err(wrong)?;
    writer.finish().map_err(wrong)
}

/// Keeps the first three of every four bytes.
pub(crate) fn drop_alpha(rgba: &[u8], rgb: &mut Vec<u8>) {
    rgb.clear();
    rgb.resize(rgba.len() / 4 * 3, 0);
    for (to, from) in rgb.chunks_exact_mut(3).zip(rgba.chunks_exact(4)) {
        to.copy_from_slice(&from[..3]);
    }
}

/// Decodes a still or an animated PNG to its end and compares what it says with `expected`.
pub(super) fn check(file: impl BufRead + Seek, expected: &Expected<'_>) -> Result<(), Unfit> {
    let broken = |e: png::DecodingError| Unfit::Broken(e.to_string());
    let mut reader = Decoder::new(file).read_info().map_err(broken)?;
    let info = reader.info();
    let stamp = info.uncompressed_latin1_text.iter().find(|t| t.keyword == KEYWORD).map(|t| t.text.clone());
    let frames = info.animation_control.map_or(1, |a| u64::from(a.num_frames));
    expected.compare(stamp.as_deref(), info.width, info.height, frames)?;
    let size = reader.output_buffer_size().ok_or_else(|| Unfit::Broken("too large".to_owned()))?;
    let mut pixels = vec![0; size];
    for _ in 0..frames {
        reader.next_frame(&mut pixels).map_err(broken)?;
    }
    reader.finish().map_err(broken)
}
