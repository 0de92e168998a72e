//! `kinora render`: frames to files.

use clap::Args;

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
};

/// Arguments of `render`.
#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
}

/// Renders the frames.
///
/// # Errors
/// When the scene cannot be loaded or a file cannot be written.
pub(crate) fn run(args: &RenderArgs, settings: &Settings) -> Result<(), CliError> {
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let _clips = scene::select_clips(&scene, args.animation.as_deref())?;
    Ok(())
}
