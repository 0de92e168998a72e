//! The options of `render` as typed.

use std::path::PathBuf;

use clap::Args;
use kinora::output::Fps;

use crate::cli::scene::{ANIMATION_HELP, SCENE_HELP};

/// Arguments of `render`.
#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    pub(super) scene: Option<String>,
    /// Where frames go: the run of # is the zero-padded frame number; .png, .exr, or one .apng, .gif or .y4m for
    /// all frames; - writes .y4m to stdout
    #[arg(short, long, value_name = "PATTERN", default_value = "frames/frame_####.png")]
    pub(super) output: PathBuf,
    /// Frames, in commas: A, A..=B, A-B, A..B (without B), A-BxSTEP [default: the whole animation]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub(super) frames: Option<String>,
    /// Frames a second; frame k is the moment k/fps seconds. A number or a fraction such as 30000/1001
    #[arg(long, value_name = "N", default_value_t = Fps::DEFAULT)]
    pub(super) fps: Fps,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    pub(super) size: String,
    /// Samples a pixel
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) samples: u32,
    /// Seed of the sample pattern
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// What a pixel shows: eyelight, normals, depth, ao or direct
    #[arg(long, value_name = "NAME", default_value = "direct")]
    pub(super) shading: String,
    /// A camera of the file by index or name; auto takes the first, or frames the whole animation where there is
    /// none; framed does that always
    #[arg(long, value_name = "INDEX|NAME|auto|framed", default_value = "auto")]
    pub(super) camera: String,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    pub(super) animation: Option<String>,
    /// Keep finished frames of the same scene and settings, render the rest
    #[arg(long, conflicts_with = "overwrite")]
    pub(super) resume: bool,
    /// Replace existing files
    #[arg(long)]
    pub(super) overwrite: bool,
    /// Render the I-th of N parts of the list (every N-th frame), or auto for a scheduler's array task
    #[arg(long, value_name = "I/N|auto")]
    pub(super) shard: Option<String>,
    /// Number of array tasks, where the scheduler of --shard auto does not tell
    #[arg(long, value_name = "N", requires = "shard")]
    pub(super) shard_count: Option<usize>,
    /// Numbers of the colour layer of .exr: half or float
    #[arg(long, value_name = "KIND", default_value = "half")]
    pub(super) exr_color: String,
    /// Colour resolution of .y4m: 420 or 444
    #[arg(long, value_name = "KIND", default_value = "420")]
    pub(super) chroma: String,
    /// How structures are kept good: async, refit, rebuild or swap-every=K; changes no pixel
    #[arg(long, value_name = "NAME", default_value = "async")]
    pub(super) policy: String,
    /// Print one JSON object with counts and times
    #[arg(long)]
    pub(super) json: bool,
}
