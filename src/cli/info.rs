//! `kinora info`: what a file holds and what it needs.

use clap::Args;

use super::{
    error::CliError,
    scene::{self, SCENE_HELP},
    settings::Settings,
    stdout,
};

/// Arguments of `info`.
#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Name the built-in scenes, one a line
    #[arg(long)]
    list_builtin: bool,
}

/// Prints the summary.
///
/// # Errors
/// When the scene cannot be loaded or stdout cannot be written.
pub(crate) fn run(args: &InfoArgs, settings: &Settings) -> Result<(), CliError> {
    let scene = scene::load(args.scene.as_deref(), settings)?;
    stdout::write(format!("{}\n", scene.file).as_bytes())
}
