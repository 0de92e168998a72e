//! `kinora man`: manual pages in roff to stdout.

use clap::{Args, CommandFactory};
use clap_mangen::Man;

use super::{args::Cli, error::CliError, stdout};

/// Arguments of `man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// The command to describe [default: the program as a whole]
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

/// Prints the page.
///
/// # Errors
/// When there is no such command, or stdout cannot be written.
pub(crate) fn run(args: &ManArgs) -> Result<(), CliError> {
    let mut root = Cli::command().disable_help_subcommand(true);
    root.build();
    let command = match &args.command {
        None => root,
        Some(name) => root
            .find_subcommand(name)
            .cloned()
            .ok_or_else(|| CliError::usage(format!("no command `{name}`; see kinora --help")))?,
    };
    let mut page = Vec::new();
    Man::new(command).render(&mut page).map_err(|e| CliError::failed(e.to_string()))?;
    stdout::write(&page)
}
