//! One error for the top layers; each module has its own, folded in here.

use crate::{
    accel::BuildError, dynamics::FrameError, output::OutputError, render::RenderError, scene::import::ImportError,
    simd::FloatModeError,
};

/// What any of kinora's layers may report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene could not be imported.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// An acceleration structure could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The frame loop failed.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A picture could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Foreign code changed how a thread computes.
    #[error(transparent)]
    FloatMode(#[from] FloatModeError),
    /// Frames could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A result with kinora's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;
