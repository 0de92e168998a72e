//! The options of `render` as typed.

use std::path::PathBuf;

use clap::{Args, builder::TypedValueParser};
use kinora::{
    dynamics::RebuildPolicy,
    output::{Chroma, ExrColor, Fps, FrameList},
    render::Shading,
};

use crate::cli::{
    scene::{ANIMATION_HELP, SCENE_HELP},
    values,
};

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
    #[arg(long, value_name = "LIST", value_parser = frames, allow_hyphen_values = true)]
    pub(super) frames: Option<FrameList>,
    /// Frames a second; frame k is the moment k/fps seconds. A number or a fraction such as 30000/1001
    #[arg(long, value_name = "N", default_value_t = Fps::DEFAULT, allow_hyphen_values = true)]
    pub(super) fps: Fps,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = values::size)]
    pub(super) size: (u32, u32),
    /// Samples a pixel
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = values::samples(),
        allow_negative_numbers = true)]
    pub(super) samples: u32,
    /// Seed of the sample pattern
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(super) seed: u64,
    /// What a pixel shows
    #[arg(long, value_name = "NAME", default_value = "direct", value_parser = values::shading())]
    pub(super) shading: Shading,
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
    /// Numbers of the colour layer of .exr
    #[arg(long, value_name = "KIND", default_value = "half", value_parser = exr_color())]
    pub(super) exr_color: ExrColor,
    /// Colour resolution of .y4m
    #[arg(long, value_name = "KIND", default_value = "420", value_parser = chroma())]
    pub(super) chroma: Chroma,
    /// How structures are kept good: async, auto (looks at the animation beforehand), refit, rebuild or swap-every=K; changes no pixel
    #[arg(long, value_name = "NAME", default_value = "async", value_parser = values::policy)]
    pub(super) policy: RebuildPolicy,
    /// Print one JSON object with counts and times
    #[arg(long)]
    pub(super) json: bool,
}

fn frames(text: &str) -> Result<FrameList, String> {
    text.parse()
}

fn exr_color() -> impl TypedValueParser<Value = ExrColor> {
    values::named([("half", ExrColor::Half), ("float", ExrColor::Float)])
}

fn chroma() -> impl TypedValueParser<Value = Chroma> {
    values::named([("420", Chroma::C420), ("444", Chroma::C444)])
}
