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
    /// Seed of the sample pattern.
    pub seed: u64,
    /// Frame number, so that noise differs from frame to frame.
    pub frame: u64,
    /// SIMD level; changes no byte.
    pub simd: SimdLevel,
}

/// Renders `world` seen by `camera` into `film` (whose size decides the picture's), in parallel over tiles in
/// the current rayon pool. Returns the number of rays traced.
pub fn render(_world: &World, _camera: &CameraView, _settings: &RenderSettings, _film: &mut Film) -> u64 {
    0
}
