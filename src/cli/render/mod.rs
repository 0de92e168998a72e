//! `kinora render`: frames to files.
//!
//! Arguments and scene become a checked [`Plan`] before anything is written; [`existing`] says which frames are
//! still to do; [`shoot`] traces them while encoder threads write; [`summary`] adds up.

mod args;
mod existing;
mod plan;
mod shoot;
mod summary;

use kinora::output::{Unfinished, atomic};

pub(crate) use args::RenderArgs;

use super::{error::CliError, scene, settings::Settings, signals::Signals, stdout};
use plan::{Plan, Request};

/// Renders the frames.
///
/// # Errors
/// Usage errors before anything is written; failures to write; a signal.
pub(crate) fn run(args: &RenderArgs, settings: &Settings) -> Result<(), CliError> {
    let request = Request::check(args)?;
    let unfinished = Unfinished::default();
    let signals = Signals::watch(&unfinished)?;
    let loaded = scene::load_with_digest(args.scene.as_deref(), settings)?;
    let plan = Plan::new(args, request, loaded, settings)?;
    let to_do = existing::remaining(&plan, settings)?;
    signals.check()?;
    let kept = plan.frames.len() - to_do.len();
    tracing::info!("{} frames to render, {kept} kept; precision {}", to_do.len(), settings.precision);
    if let Some(file) = to_do.first().and_then(|&f| plan.target.file(f)) {
        atomic::prepare(&file)?;
    }
    let summary = shoot::shoot(&plan, &to_do, settings, &signals, &unfinished)?;
    if args.json {
        stdout::write_json(&summary)?;
    } else if settings.verbosity.shows_progress() {
        eprintln!("{}", summary.line());
    }
    Ok(())
}
