use crate::{
    accel::BuildError, dynamics::FrameError, output::OutputError, render::RenderError, scene::import::ImportError,
};

/// Why a report was not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The [`Monitor`](super::Monitor) asked for the end.
    #[error("stopped before the report was complete")]
    Stopped,
    /// A scene could not be imported.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// A structure that everything is compared with could not be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A frame could not be made.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A picture could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A generated scene does not exist in the size asked for.
    #[error("{scene}: {reason}")]
    Scene {
        /// The scene.
        scene: String,
        /// What is wrong.
        reason: String,
    },
    /// No threads could be started for timed work.
    #[error("cannot start a thread: {0}")]
    Threads(String),
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// An earlier report cannot be compared with.
    #[error("{file}: {reason}")]
    Baseline {
        /// The file.
        file: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A plot could not be drawn.
    #[error("plot {plot}: {reason}")]
    Plot {
        /// The plot's file name.
        plot: String,
        /// What the drawing code says.
        reason: String,
    },
}
