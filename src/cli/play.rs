//! `kinora play`: a scene in a window.

use std::{
    path::{Path, PathBuf},
    rc::Rc,
    sync::Arc,
};

use clap::Args;
use kinora::{
    accel::AccelKind,
    dynamics::RebuildPolicy,
    output::Unfinished,
    player::{self, PlayError, PlayOptions, Services, StartCamera},
    render::Shading,
    scene::{Scene, import},
};

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
    signals::Signals,
    values,
    view::Viewpoint,
};

/// Longest side of a window in pixels.
const MAX_SIDE: u32 = 16_384;

/// Arguments of `play`.
#[derive(Debug, Args)]
#[command(after_help = controls())]
pub(crate) struct PlayArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
    /// Clip seconds a second; negative plays backwards
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    speed: f64,
    /// Width and height of the window in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = values::size)]
    size: (u32, u32),
    /// What a pixel shows
    #[arg(long, value_name = "NAME", default_value = "direct", value_parser = values::shading())]
    shading: Shading,
    /// Most pictures a second while playing
    #[arg(long, value_name = "N", default_value_t = 60.0)]
    fps_limit: f64,
    /// A camera of the file by index or name; auto takes the first, or frames the whole animation where there is
    /// none; framed does that always
    #[arg(long, value_name = "INDEX|NAME|auto|framed", default_value = "auto")]
    camera: String,
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
    /// Samples a pixel of pictures that are written to files
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = values::samples())]
    samples: u32,
}

/// The controls as part of the help.
fn controls() -> String {
    let rows = player::controls();
    let width = rows.iter().map(|(keys, _)| keys.len()).max().unwrap_or(0);
    let lines: Vec<_> = rows.iter().map(|(keys, what)| format!("  {keys:width$}  {what}")).collect();
    format!("In the window:\n{}", lines.join("\n"))
}

/// Opens the window and plays until it is closed.
///
/// # Errors
/// Usage errors before a window opens; no display; a screenshot that cannot be written; a signal.
pub(crate) fn run(args: &PlayArgs, settings: &Settings) -> Result<(), CliError> {
    check(args)?;
    let unfinished = Unfinished::default();
    let signals = Signals::watch(&unfinished)?;
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let clips = args.animation.as_deref().map(|name| scene::select_clips(&scene, Some(name))).transpose()?;
    let options = PlayOptions {
        clips,
        speed: args.speed,
        at_s: args.at,
        camera: camera(&args.camera, &scene)?,
        shading: args.shading,
        structure: settings.accel.clone(),
        structures: AccelKind::ALL.iter().map(|kind| kind.name().to_owned()).collect(),
        size: args.size,
        fps_limit: args.fps_limit,
        exit_after_s: args.exit_after,
        screenshot: args.screenshot.clone(),
        still_samples: args.samples,
    };
    let signals = Rc::new(signals);
    let watched = Rc::clone(&signals);
    let pool = Arc::clone(&settings.pool);
    let services = Services {
        frames: settings.frame_config(RebuildPolicy::default()),
        simd: settings.simd,
        load: Arc::new(move |file| pool.install(|| open(file))),
        stop: Box::new(move || watched.check().is_err()),
        unfinished,
    };
    player::play(Arc::new(scene), &options, services)?;
    signals.check()
}

/// Loads a file that was dropped on the window.
fn open(file: &Path) -> Result<Arc<Scene>, String> {
    import::from_path(file).map(Arc::new).map_err(|error| error.to_string())
}

fn camera(choice: &str, scene: &Scene) -> Result<StartCamera, CliError> {
    match choice {
        "auto" => Ok(StartCamera::Auto),
        "framed" => Ok(StartCamera::Framed),
        _ => Ok(match Viewpoint::select(scene, choice, &[], 1.0)? {
            Viewpoint::Node(node) => StartCamera::Node(node),
            Viewpoint::Fixed(_) => StartCamera::Framed,
        }),
    }
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
    let (width, height) = args.size;
    if width.max(height) > MAX_SIDE {
        return Err(CliError::usage(format!("--size {width}x{height}: a window's sides are at most {MAX_SIDE}")));
    }
    for (flag, value) in [("at", args.at), ("exit-after", args.exit_after)] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v >= 0.0)) {
            return wrong(flag, value, "seconds, at least 0");
        }
    }
    Ok(())
}

impl From<PlayError> for CliError {
    fn from(error: PlayError) -> Self {
        Self::failed(error.to_string())
    }
}
