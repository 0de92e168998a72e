//! `kinora play`: a scene in a window.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use kinora::{
    accel::AccelKind,
    dynamics::RebuildPolicy,
    player::{self, PlayError, PlayOptions, StartCamera},
    render::Shading,
    scene::import,
};

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
};

/// Samples a pixel of pictures that go to files.
const STILL_SAMPLES: u32 = 1;

/// Arguments of `play`.
#[derive(Debug, Args)]
#[command(after_help = "Press H in the window for its keys.")]
pub(crate) struct PlayArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
    /// Clip seconds a second; negative plays backwards
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    speed: f64,
    /// Width and height of the window in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    size: String,
    /// What a pixel shows: eyelight, normals, depth, ao or direct
    #[arg(long, value_name = "NAME", default_value = "direct")]
    shading: String,
    /// Most pictures a second while playing
    #[arg(long, value_name = "N", default_value_t = 60.0)]
    fps_limit: f64,
    /// Hold this time of the animation instead of playing
    #[arg(long, value_name = "SECONDS")]
    at: Option<f64>,
    /// Close this long after the first picture
    #[arg(long, value_name = "SECONDS")]
    exit_after: Option<f64>,
    /// Write the picture, without overlay and as `render` makes it, to a PNG: with --at as soon as it is refined,
    /// else at the end
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
}

/// Opens the window and plays until it is closed.
///
/// # Errors
/// When the scene cannot be loaded or there is no display.
pub(crate) fn run(args: &PlayArgs, settings: &Settings) -> Result<(), CliError> {
    let size = size(&args.size).ok_or_else(|| CliError::usage(format!("--size {}: expected WxH", args.size)))?;
    let shading = Shading::ALL.into_iter().find(|s| s.name() == args.shading);
    let shading = shading.ok_or_else(|| CliError::usage(format!("--shading {}: unknown", args.shading)))?;
    check(args)?;
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let clips = args.animation.as_deref().map(|name| scene::select_clips(&scene, Some(name))).transpose()?;
    let options = PlayOptions {
        clips,
        speed: args.speed,
        at_s: args.at,
        camera: StartCamera::Auto,
        shading,
        structure: settings.accel.clone(),
        structures: AccelKind::ALL.iter().map(|kind| kind.name().to_owned()).collect(),
        size,
        fps_limit: args.fps_limit,
        exit_after_s: args.exit_after,
        screenshot: args.screenshot.clone(),
        still_samples: STILL_SAMPLES,
    };
    let pool = Arc::clone(&settings.pool);
    let load =
        move |file: &Path| pool.install(|| import::from_path(file)).map(Arc::new).map_err(|error| error.to_string());
    let frames = settings.frame_config(RebuildPolicy::default());
    player::play(Arc::new(scene), &options, frames, settings.simd, Arc::new(load), Box::new(|| false))?;
    Ok(())
}

/// Checks that numbers make sense.
fn check(args: &PlayArgs) -> Result<(), CliError> {
    let wrong =
        |flag: &str, value: f64, expected: &str| Err(CliError::usage(format!("--{flag} {value}: expected {expected}")));
    if !args.speed.is_finite() {
        return wrong("speed", args.speed, "a finite number");
    }
    if !(args.fps_limit.is_finite() && args.fps_limit > 0.0) {
        return wrong("fps-limit", args.fps_limit, "a positive number");
    }
    for (flag, value) in [("at", args.at), ("exit-after", args.exit_after)] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v >= 0.0)) {
            return wrong(flag, value, "seconds, at least 0");
        }
    }
    Ok(())
}

fn size(text: &str) -> Option<(u32, u32)> {
    let (width, height) = text.split_once(['x', 'X'])?;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=16_384).contains(side));
    Some((side(width)?, side(height)?))
}

impl From<PlayError> for CliError {
    fn from(error: PlayError) -> Self {
        Self::failed(error.to_string())
    }
}
