//! Camera rays, shading, film. Reads a finished world; never builds one.

#![cfg_attr(
    test,
    allow(
        clippy::float_cmp,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap,
        reason = "tests compare exact values and cast small numbers"
    )
)]

mod block;
mod brdf;
mod camera;
mod context;
mod departure;
mod exposure;
mod film;
mod filter;
mod found;
mod lights;
mod material;
mod math;
mod offset;
mod patch;
mod pattern;
mod plain;
mod prepared;
mod probe;
mod rays;
mod renderer;
mod shade;
mod sky;
mod starts;
mod surface;
mod texture;
mod tile;
mod tone;
mod vertex_cache;
mod wide;

pub use camera::CameraView;
pub use film::Film;
pub use renderer::Renderer;
pub(crate) use starts::{Leaving, starts};

use crate::simd::{FloatModeError, SimdLevel};

/// Why a picture could not be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// Foreign code changed how a thread computes.
    #[error(transparent)]
    FloatMode(#[from] FloatModeError),
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Cosine between ray and surface.
    Eyelight,
    /// Shading normal as colour.
    Normals,
    /// Distance as grey.
    Depth,
    /// Ambient occlusion.
    Ao,
    /// Materials, lights, shadows, sky.
    #[default]
    Direct,
}

impl Shading {
    /// Every shading, in the order in which a viewer offers them.
    pub const ALL: [Self; 5] = [Self::Direct, Self::Eyelight, Self::Normals, Self::Depth, Self::Ao];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eyelight => "eyelight",
            Self::Normals => "normals",
            Self::Depth => "depth",
            Self::Ao => "ao",
            Self::Direct => "direct",
        }
    }

    /// True when materials and lights count, so that colours are scene-referred.
    pub(crate) fn is_lit(self) -> bool {
        self == Self::Direct
    }
}

/// Settings that decide a frame's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// What a pixel shows.
    pub shading: Shading,
    /// Samples a pixel, at least 1.
    pub samples: u32,
    /// Number of the first sample in a pixel's pattern, so that the mean of several renders continues the
    /// pattern: those of samples 0..4 and 4..8 are together the 8 samples of one. 0 for a picture in one go;
    /// sample 0 is the pixel centre when it is the only one.
    pub first_sample: u32,
    /// Seed of the sample pattern.
    pub seed: u64,
    /// Frame number, so that noise differs from frame to frame.
    pub frame: u64,
    /// SIMD level; changes no byte.
    pub simd: SimdLevel,
}

impl Default for RenderSettings {
    /// One sample of [`Shading::Direct`] at the best SIMD level.
    fn default() -> Self {
        Self { shading: Shading::Direct, samples: 1, first_sample: 0, seed: 0, frame: 0, simd: SimdLevel::best() }
    }
}
