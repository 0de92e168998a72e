//! Images: PNG, JPEG and WebP, decoded in parallel within the memory budget.

use std::{io::Cursor, sync::Arc};

use image::{ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use super::{
    super::Image,
    buffers::Files,
    context::{Context, check_index},
    error::{Problem, Step},
    json, textures, uri,
};

/// Longest side of an image.
const MAX_SIDE: u32 = 1 << 15;
/// Bytes that reading an image's header may take.
const MAX_HEADER: u64 = 32 << 20;
/// Bytes that images being decoded at the same time may take beside the results.
const MAX_IN_FLIGHT: u64 = 96 << 20;

/// All images and whether each could be read; one that could not is a white texel and a warning.
pub(super) fn import(cx: &Context<'_>, files: &mut Files<'_>) -> Step<(Vec<Image>, Vec<bool>)> {
    cx.budget.take(cx.doc.images.len(), size_of::<Image>() + 64, "images")?;
    let mut sources = Vec::with_capacity(cx.doc.images.len());
    for (i, image) in cx.doc.images.iter().enumerate() {
        sources.push(Source::find(cx, files, i, image)?);
    }
    let mut decoded: Vec<Option<Result<Arc<[u8]>, String>>> = sources.iter().map(|_| None).collect();
    for batch in batches(&sources) {
        let pixels: Vec<_> = batch.par_iter().map(|&i| (i, sources[i].decode())).collect();
        for (i, result) in pixels {
            decoded[i] = Some(result);
        }
    }
    let mut readable = vec![false; sources.len()];
    let mut images = Vec::with_capacity(sources.len());
    for (i, (source, result)) in sources.into_iter().zip(decoded).enumerate() {
        match (source.state, result) {
            (Ok(found), Some(Ok(rgba))) => {
                readable[i] = true;
                images.push(Image { name: source.name, width: found.width, height: found.height, rgba });
            }
            (Err(why), _) | (_, Some(Err(why))) => {
                cx.warnings.add(format_args!("images[{i}]"), format_args!("{why}; drawn white"));
                images.push(textures::blank(source.name));
            }
            (Ok(_), None) => images.push(textures::blank(source.name)),
        }
    }
    Ok((images, readable))
}

/// Encoded bytes of an image.
enum Encoded<'c> {
    View(&'c [u8]),
    File(Arc<Vec<u8>>),
}

impl Encoded<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::View(bytes) => bytes,
            Self::File(bytes) => bytes,
        }
    }
}

struct Found<'c> {
    encoded: Encoded<'c>,
    format: ImageFormat,
    width: u32,
    height: u32,
    /// Bytes that decoding takes beside the result.
    in_flight: u64,
}

struct Source<'c> {
    name: String,
    state: Result<Found<'c>, String>,
}

impl<'c> Source<'c> {
    fn find(cx: &'c Context<'_>, files: &mut Files<'_>, index: usize, image: &json::Image) -> Step<Self> {
        let place = format!("images[{index}]");
        let name = image.name.as_deref().or(image.uri.as_deref().filter(|u| !u.starts_with("data:")));
        let name = name.unwrap_or_default().to_owned();
        let encoded = match (image.buffer_view, &image.uri) {
            (Some(view), _) => {
                let place = format!("{place}.bufferView");
                check_index(view.index(), cx.doc.buffer_views.len(), &place, "bufferView")?;
                let bytes = cx.buffers.view(cx.doc, view.index(), cx.budget, &place);
                bytes.map(Encoded::View).map_err(|p| p.reason())
            }
            (None, Some(uri)) => files.load(uri, cx.budget).map(Encoded::File),
            (None, None) => Err("has neither uri nor bufferView".to_owned()),
        };
        let state = encoded.and_then(|encoded| probe(cx, encoded, &place));
        if let Ok(found) = &state {
            check_media_type(cx, image, found.format, &place);
        }
        Ok(Self { name, state })
    }

    fn decode(&self) -> Result<Arc<[u8]>, String> {
        let Ok(found) = &self.state else { return Err(String::new()) };
        let broken = |error| format!("cannot be decoded: {error}");
        let bytes = u64::from(found.width) * u64::from(found.height) * 4;
        let mut limits = Limits::default();
        limits.max_alloc = Some(found.in_flight + bytes);
        let mut reader = ImageReader::with_format(Cursor::new(found.encoded.bytes()), found.format);
        reader.limits(limits);
        let image = reader.decode().map_err(broken)?;
        if (image.width(), image.height()) != (found.width, found.height) {
            return Err("changes its size while decoding".to_owned());
        }
        Ok(image.into_rgba8().into_raw().into())
    }
}

/// Format and size, and memory set aside; nothing is decoded yet.
fn probe<'c>(cx: &Context<'_>, encoded: Encoded<'c>, place: &str) -> Result<Found<'c>, String> {
    let format = format_of(encoded.bytes()).ok_or("is no PNG, JPEG or WebP")?;
    let (width, height, in_flight) = {
        let mut reader = ImageReader::with_format(Cursor::new(encoded.bytes()), format);
        // Room for headers and their compressed parts only.
        let mut limits = Limits::default();
        limits.max_alloc = Some(MAX_HEADER);
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(|error| format!("cannot be decoded: {error}"))?;
        let (width, height) = decoder.dimensions();
        (width, height, decoder.total_bytes())
    };
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("is {width} x {height} texels; 1 to {MAX_SIDE} a side can be read"));
    }
    // The decoder's own rows and windows, and the conversion to RGBA.
    let in_flight = in_flight.saturating_mul(2).saturating_add(1 << 20);
    let pixels = usize::try_from(u64::from(width) * u64::from(height)).map_err(|_| "is too large")?;
    let needed = (pixels as u64).saturating_mul(4).saturating_add(in_flight.saturating_sub(MAX_IN_FLIGHT));
    if needed > cx.budget.left() {
        return Err(format!("is {width} x {height} texels; that needs more memory than a file of this size may use"));
    }
    cx.budget.take(pixels, 4, place).map_err(|p: Problem| p.reason())?;
    Ok(Found { encoded, format, width, height, in_flight })
}

fn format_of(bytes: &[u8]) -> Option<ImageFormat> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some(ImageFormat::Png)
    } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
        Some(ImageFormat::Jpeg)
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        Some(ImageFormat::WebP)
    } else {
        None
    }
}

/// Groups of images that may be decoded at the same time.
fn batches(sources: &[Source<'_>]) -> Vec<Vec<usize>> {
    let mut batches: Vec<Vec<usize>> = Vec::new();
    let mut room = 0;
    for (i, source) in sources.iter().enumerate() {
        let Ok(found) = &source.state else { continue };
        if let Some(batch) = batches.last_mut().filter(|_| found.in_flight <= room) {
            room -= found.in_flight;
            batch.push(i);
        } else {
            room = MAX_IN_FLIGHT.saturating_sub(found.in_flight);
            batches.push(vec![i]);
        }
    }
    batches
}

fn check_media_type(cx: &Context<'_>, image: &json::Image, format: ImageFormat, place: &str) {
    let actual = format.to_mime_type();
    if let Some(named) = image.mime_type.as_deref().filter(|&m| m != actual) {
        let text = format!("{}, but the data is {actual}", uri::shorten(named));
        cx.warnings.add(format_args!("{place}.mimeType"), text);
    }
}
