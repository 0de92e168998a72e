//! The command line: raw arguments, checked settings, one file per command.
//!
//! Results go to stdout; logs, progress and errors to stderr. Only this module parses arguments, prints,
//! reads the environment or decides the exit code.

mod args;
mod cast;
mod collide;
mod completions;
mod error;
mod geometry;
mod info;
mod logs;
mod man;
#[cfg(feature = "player")]
mod play;
mod pose;
mod progress;
mod render;
mod report;
mod scene;
mod settings;
mod shard;
mod signals;
mod stdout;
mod values;
mod view;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use error::CliError;
use settings::Settings;

/// Runs the program and gives its exit code.
pub(crate) fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // A closed stdout while printing help is no reason to fail.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    logs::init(cli.common.verbosity());
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("kinora: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(cli: &Cli) -> Result<(), CliError> {
    let settings = Settings::check(&cli.common)?;
    match &cli.command {
        #[cfg(feature = "player")]
        Command::Play(args) => play::run(args, &settings),
        Command::Render(args) => render::run(args, &settings),
        Command::Info(args) => info::run(args, &settings),
        Command::Pose(args) => pose::run(args, &settings),
        Command::Cast(args) => cast::run(args, &settings),
        Command::Collide(args) => collide::run(args, &settings),
        Command::Report(args) => report::run(args, &settings),
        Command::Completions(args) => completions::run(args),
        Command::Man(args) => man::run(args),
    }
}
