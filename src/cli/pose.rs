//! `kinora pose`: the world-space vertices of every mesh part at one time.

use std::path::PathBuf;

use clap::Args;

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
};

/// Arguments of `pose`.
#[derive(Debug, Args)]
pub(crate) struct PoseArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
    /// Time on the animation's clock in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    time: f64,
    /// File to write
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
}

/// Writes the file.
///
/// # Errors
/// When the scene cannot be loaded or the file cannot be written.
pub(crate) fn run(args: &PoseArgs, settings: &Settings) -> Result<(), CliError> {
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let clips = scene::select_clips(&scene, args.animation.as_deref())?;
    let _active = scene::at_time(&clips, args.time);
    Err(CliError::failed(format!("{}: cannot write", args.output.display())))
}
