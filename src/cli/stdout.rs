//! Writing results to stdout; a closed pipe is an error, not a panic.

use std::io::{self, Write};

use super::error::CliError;

/// Writes and flushes `bytes`.
///
/// # Errors
/// A failure that names stdout and the reason.
pub(crate) fn write(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|e| CliError::failed(format!("stdout: cannot write: {e}")))
}

/// Writes one JSON object and a line end.
///
/// # Errors
/// As [`write`].
pub(crate) fn write_json(value: &impl serde::Serialize) -> Result<(), CliError> {
    let mut text = serde_json::to_vec(value).map_err(|e| CliError::failed(format!("JSON: {e}")))?;
    text.push(b'\n');
    write(&text)
}
