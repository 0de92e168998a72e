//! What the window asks of the render thread, and what comes back.

use std::{path::PathBuf, sync::Arc, time::Duration};

use crate::{
    dynamics::{LoopCounts, StageTimes},
    geom::Aabb,
    render::{CameraView, Shading},
    scene::{ClipId, NodeId, Scene},
};

/// The camera that is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ViewSpec {
    /// The camera at a node.
    Node(NodeId),
    /// All of the animation, from the default direction.
    Framed,
    /// A free camera.
    Fixed(CameraView),
}

/// Everything that decides a picture's pixels at the window's full size.
#[derive(Clone, Debug)]
pub(super) struct Shot {
    /// The scene.
    pub(super) scene: Arc<Scene>,
    /// Clips that play together.
    pub(super) clips: Arc<[ClipId]>,
    /// Their common time in seconds.
    pub(super) time_s: f64,
    /// Where it is seen from.
    pub(super) view: ViewSpec,
    /// What a pixel shows.
    pub(super) shading: Shading,
    /// Acceleration structure, as on the command line.
    pub(super) structure: Arc<str>,
    /// Width of the window in pixels.
    pub(super) width: u32,
    /// Height of the window in pixels.
    pub(super) height: u32,
}

impl PartialEq for Shot {
    /// Scenes are the same when they are one object.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.scene, &other.scene)
            && self.clips == other.clips
            && self.time_s.to_bits() == other.time_s.to_bits()
            && self.view == other.view
            && self.shading == other.shading
            && self.structure == other.structure
            && (self.width, self.height) == (other.width, other.height)
    }
}

/// How a picture for the window is made. A newer one replaces an older one that has not begun.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Job {
    /// One sample a pixel at the window's size over `divisor`.
    Draft(Shot, u32),
    /// Full size, then more and more samples, a picture after each pass, until another job comes.
    Refine(Shot),
}

/// A picture for a file; always made, in order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StillJob {
    /// What is seen.
    pub(super) shot: Shot,
    /// Where it goes.
    pub(super) file: StillFile,
}

/// The file of a still.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum StillFile {
    /// This file, replaced when it is there.
    Exact(PathBuf),
    /// The first free `STEM_0001.png`, `STEM_0002.png`, ... in the current folder.
    Numbered(String),
}

/// Wall time of each stage of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct FrameTimes {
    /// Pose, deform and refit; zero when the world was kept.
    pub(super) stages: StageTimes,
    /// Shooting rays and shading.
    pub(super) trace: Duration,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// Tone-mapped sRGB, 4 bytes a pixel, rows top down.
    pub(super) rgba: Vec<u8>,
    /// Width in pixels.
    pub(super) width: u32,
    /// Height in pixels.
    pub(super) height: u32,
    /// What it shows.
    pub(super) shot: Shot,
    /// Divisor of the window's size it was traced at.
    pub(super) divisor: u32,
    /// Samples a pixel so far.
    pub(super) samples: u32,
    /// True when no more samples will be added.
    pub(super) is_final: bool,
    /// Where the time went.
    pub(super) times: FrameTimes,
    /// Rays of the last pass.
    pub(super) rays: u64,
    /// Swaps and quality so far.
    pub(super) counts: LoopCounts,
    /// The camera used.
    pub(super) view: CameraView,
    /// What the world's triangles fill at this time.
    pub(super) bounds: Aabb,
}

/// What the render thread reports.
#[derive(Debug)]
pub(super) enum Report {
    /// A picture to show.
    Picture(Box<Picture>),
    /// A job for the window could not be done; the reason.
    Failed(String),
    /// A still was written to this file, or why not.
    Still(Result<PathBuf, String>),
}
