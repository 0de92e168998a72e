//! `kinora info`: what a file holds and what it needs.

mod summary;
mod text;

use clap::Args;
use kinora::scene::builtin;
use serde_json::json;

use self::summary::Summary;
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
    #[arg(long, conflicts_with = "scene")]
    list_builtin: bool,
}

/// Prints the summary.
///
/// # Errors
/// When the scene cannot be loaded or stdout cannot be written.
pub(crate) fn run(args: &InfoArgs, settings: &Settings) -> Result<(), CliError> {
    if args.list_builtin {
        return list_builtin(args.json);
    }
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let summary = Summary::new(&scene);
    if args.json { stdout::write_json(&summary) } else { stdout::write(text::format(&summary).as_bytes()) }
}

fn list_builtin(as_json: bool) -> Result<(), CliError> {
    let names: Vec<_> = builtin::names().iter().chain(builtin::generated_names()).copied().collect();
    if as_json {
        return stdout::write_json(&json!({ "builtin": names }));
    }
    let lines: String = names.into_iter().flat_map(|name| [name, "\n"]).collect();
    stdout::write(lines.as_bytes())
}
