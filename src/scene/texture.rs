use std::sync::Arc;

use super::ImageId;

/// An image with the way it is sampled.
#[derive(Clone, Debug)]
pub struct Texture {
    /// The image; `None` when the file names none that can be read (drawn white).
    pub image: Option<ImageId>,
    /// Filter and wrap modes.
    pub sampler: TexSampler,
}

/// Filter and wrap modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexSampler {
    /// Filter when magnified: nearest or linear.
    pub mag: Filter,
    /// Filter when minified.
    pub min: Filter,
    /// Filter between mip levels; `None` uses the finest level only.
    pub mip: Option<Filter>,
    /// Wrap along u.
    pub wrap_u: Wrap,
    /// Wrap along v.
    pub wrap_v: Wrap,
}

impl Default for TexSampler {
    fn default() -> Self {
        Self {
            mag: Filter::Linear,
            min: Filter::Linear,
            mip: Some(Filter::Linear),
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
        }
    }
}

/// Reconstruction between texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Nearest texel.
    Nearest,
    /// Linear blend.
    Linear,
}

/// What lies outside the unit square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Repeat.
    Repeat,
    /// Repeat, every second copy mirrored.
    Mirror,
    /// The edge texel.
    Clamp,
}

/// A decoded image, 8 bits RGBA, rows top down (v = 0 is the first row).
#[derive(Clone, Debug)]
pub struct Image {
    /// Name or URI, for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub rgba: Arc<[u8]>,
}
