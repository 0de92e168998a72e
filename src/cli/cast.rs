//! `kinora cast`: batch ray queries from files, timed.

use std::path::PathBuf;

use clap::Args;

use super::{error::CliError, settings::Settings};

/// Arguments of `cast`.
#[derive(Debug, Args)]
pub(crate) struct CastArgs {
    /// Geometry files; each after the first is the next frame of the same triangles
    #[arg(value_name = "GEOMETRY", required = true)]
    geometry: Vec<PathBuf>,
    /// Rays to cast (.rays)
    #[arg(long, value_name = "FILE")]
    rays: PathBuf,
}

/// Casts the rays.
///
/// # Errors
/// When a file cannot be read or written.
pub(crate) fn run(args: &CastArgs, _settings: &Settings) -> Result<(), CliError> {
    Err(CliError::usage(format!("{}: cannot read; {} files", args.rays.display(), args.geometry.len())))
}
