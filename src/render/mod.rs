//! Camera rays, shading, film. Reads a finished world; never builds one.

use crate::{simd::SimdLevel, world::World};

mod camera;
mod film;

pub use camera::CameraView;
pub use film::Film;

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

/// Settings that decide a frame's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// What a pixel shows.
    pub shading: Shading,
    /// Samples a pixel, at least 1.
    pub samples: u32,
    /// Number of the first sample in a pixel's pattern, so that the mean of several renders continues the
    /// pattern: those of samples 0..4 and 4..8 are together the 8 samples of one. 0 for a picture in one go;
    /// sample 0 is the pixel centre when `samples` is 1 and this is 0.
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

/// Renders `world` seen by `camera` into `film` (whose size decides the picture's), in parallel over tiles in
/// the current rayon pool. Returns the number of rays traced.
pub fn render(_world: &World, _camera: &CameraView, _settings: &RenderSettings, _film: &mut Film) -> u64 {
    0
}
