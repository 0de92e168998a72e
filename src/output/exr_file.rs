//! OpenEXR stills: linear colour with coverage, depth, and instance numbers as three layers.
//!
//! The first layer is named `color` (R, G, B, A, half or float), then `depth` (Z, float metres along the view
//! axis, infinite for the background) and `instance` (ID, 32-bit whole numbers: instance plus 1, 0 for the
//! background). Every layer carries
//! the stamp, the only attribute of its kind: with more, their order in the file would be random.

use std::io::{Cursor, Read, Seek};

use exr::prelude::{
    AttributeValue, Blocks, Compression, Encoding, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes,
    LineOrder, ReadChannels, ReadLayers, SpecificChannels, Text, Vec2, WritableImage, f16,
};

use super::{
    Fps, FrameSlot,
    resume::{Expected, Unfit},
    stamp::{KEYWORD, Stamp},
};

/// Numbers of the colour layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrColor {
    /// 16-bit floats; what lies beyond their range is clamped to 65504.
    #[default]
    Half,
    /// 32-bit floats.
    Float,
}

/// Encodes the slot's picture into its bytes.
///
/// # Errors
/// Words on what OpenEXR does not allow.
pub(super) fn encode(slot: &mut FrameSlot, stamp: &Stamp, color: ExrColor, fps: Fps) -> Result<(), String> {
    let FrameSlot { film, bytes, .. } = slot;
    bytes.clear();
    let size = Vec2(film.width as usize, film.height as usize);
    let at = |Vec2(x, y): Vec2<usize>| y * size.0 + x;
    let depth = SpecificChannels::build().with_channel("Z").with_pixel_fn(|p| (film.depth[at(p)],));
    let instance = SpecificChannels::build().with_channel("ID").with_pixel_fn(|p| (film.instance[at(p)],));
    let depth = Layer::new(size, named("depth", stamp, fps), ENCODING, depth);
    let instance = Layer::new(size, named("instance", stamp, fps), ENCODING, instance);

    let image = Image::empty(ImageAttributes::new(IntegerBounds::from_dimensions(size)));
    let out = Cursor::new(bytes);
    match color {
        ExrColor::Half => {
            let pixels = SpecificChannels::rgba(|p| {
                let [r, g, b, a] = film.color[at(p)].map(half);
                (r, g, b, a)
            });
            let layer = Layer::new(size, named("color", stamp, fps), ENCODING, pixels);
            image.with_layer(layer).with_layer(depth).with_layer(instance).write().non_parallel().to_buffered(out)
        }
        ExrColor::Float => {
            let pixels = SpecificChannels::rgba(|p| {
                let [r, g, b, a] = film.color[at(p)];
                (r, g, b, a)
            });
            let layer = Layer::new(size, named("color", stamp, fps), ENCODING, pixels);
            image.with_layer(layer).with_layer(depth).with_layer(instance).write().non_parallel().to_buffered(out)
        }
    }
    .map_err(|e| e.to_string())
}

const ENCODING: Encoding =
    Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };

fn named(name: &str, stamp: &Stamp, fps: Fps) -> LayerAttributes {
    let mut attributes = LayerAttributes::named(name);
    attributes.software_name = Some(Text::from(super::SOFTWARE));
    attributes.other.insert(Text::from(KEYWORD), AttributeValue::Text(Text::from(stamp.as_str())));
    if let Ok(num) = i32::try_from(fps.num()) {
        attributes.frames_per_second = Some((num, fps.den()));
    }
    attributes
}

fn half(value: f32) -> f16 {
    let largest = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-largest, largest) } else { value })
}

/// Decodes every layer and compares what the file says with `expected`.
pub(super) fn check(file: impl Read + Seek, expected: &Expected<'_>) -> Result<(), Unfit> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)
        .map_err(|e| Unfit::Broken(e.to_string()))?;
    let mut layers = image.layer_data.iter();
    let stamp = layers.find_map(|l| match l.attributes.other.get(KEYWORD.as_bytes()) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    });
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let size = image.attributes.display_window.size;
    expected.compare(stamp.as_deref(), side(size.0), side(size.1), 1)
}
