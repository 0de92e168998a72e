//! The window: plays a scene, takes keys and pointer, shows what the render thread makes.
//!
//! Only `window.rs` names a window type; everything else works without a display. The window thread
//! never waits for a frame: it posts what should be seen, the render thread makes the newest request into a
//! picture and wakes the window. While a clip runs, pictures have one sample a pixel at a resolution that holds
//! the frame rate; while it stands, they are refined at full size.

mod adapt;
mod canvas;
mod clock;
mod controls;
mod draw;
mod engine;
mod font;
mod input;
mod orbit;
mod overlay;
mod playlist;
mod request;
mod script;
mod scrub;
mod state;
mod still;
#[cfg(test)]
mod tests;
mod view;
mod window;
mod worker;

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    dynamics::FrameConfig,
    output::Unfinished,
    render::Shading,
    scene::{ClipId, NodeId, Scene},
    simd::SimdLevel,
};
use engine::TraceEngine;

/// Loads a file that was dropped on the window; runs on a thread of its own. The error is one clear line.
pub type LoadFile = Arc<dyn Fn(&Path) -> Result<Arc<Scene>, String> + Send + Sync>;

/// True when the program was asked to stop; looked at every tenth of a second.
pub type Stop = Box<dyn Fn() -> bool>;

/// Why playing ended.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlayError {
    /// There is no display to open a window on; the system's reason.
    #[error("no display ({0}); use `kinora render` to write frames to files")]
    NoDisplay(String),
    /// The window, the first frame or the screenshot failed.
    #[error("{0}")]
    Failed(String),
}

/// The view that playing begins with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartCamera {
    /// The first camera placed in the scene, else framed.
    #[default]
    Auto,
    /// All of the animation framed.
    Framed,
    /// The camera at this node of the scene; framed when there is none.
    Node(NodeId),
}

/// How to play.
#[derive(Clone, Debug)]
pub struct PlayOptions {
    /// Clips to begin with, together; `None` is the first that can be played.
    pub clips: Option<Vec<ClipId>>,
    /// Clip seconds a second; negative plays backwards.
    pub speed: f64,
    /// Holds this clip time in seconds instead of playing.
    pub at_s: Option<f64>,
    /// Where it is seen from at the beginning.
    pub camera: StartCamera,
    /// What a pixel shows.
    pub shading: Shading,
    /// Structure over triangles, as `bvh2` or with settings.
    pub structure: String,
    /// Structures to walk through.
    pub structures: Vec<String>,
    /// Width and height of the window in pixels.
    pub size: (u32, u32),
    /// Most pictures a second while playing; positive.
    pub fps_limit: f64,
    /// Closes this many seconds after the first picture.
    pub exit_after_s: Option<f64>,
    /// Writes a picture here when a held time is refined, or at the end.
    pub screenshot: Option<PathBuf>,
    /// Samples a pixel of pictures that are written to files.
    pub still_samples: u32,
}

/// The controls: what to press, and what it does.
pub fn controls() -> &'static [(&'static str, &'static str)] {
    &input::HELP
}

/// What playing draws on.
pub struct Services {
    /// How worlds are made (the structure is that of the options), and the pool all parallel work runs in.
    pub frames: FrameConfig,
    /// SIMD level; changes no picture.
    pub simd: SimdLevel,
    /// Reads files that are dropped on the window.
    pub load: LoadFile,
    /// Asks whether to stop.
    pub stop: Stop,
    /// Where pictures that are being written are listed.
    pub unfinished: Unfinished,
}

impl fmt::Debug for Services {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Services").field("frames", &self.frames).field("simd", &self.simd).finish_non_exhaustive()
    }
}

/// Opens the window and plays `scene` until it is closed or `services.stop` says so.
///
/// # Errors
/// When there is no display, the first frame cannot be made, or the screenshot of `options` cannot be written.
pub fn play(scene: Arc<Scene>, options: &PlayOptions, services: Services) -> Result<(), PlayError> {
    let Services { frames, simd, load, stop, unfinished } = services;
    let display = window::Display::connect()?;
    let engine = TraceEngine::new(frames, simd, options.still_samples, unfinished);
    display.run(scene, options, engine, load, stop)
}
