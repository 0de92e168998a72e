//! `kinora play`: a scene in a window.

use clap::Args;

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
};

/// Arguments of `play`.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
}

/// Opens the window and plays until it is closed.
///
/// # Errors
/// When the scene cannot be loaded or there is no display.
pub(crate) fn run(args: &PlayArgs, settings: &Settings) -> Result<(), CliError> {
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let _clips = scene::select_clips(&scene, args.animation.as_deref())?;
    Err(CliError::failed("no display; use `kinora render`"))
}
