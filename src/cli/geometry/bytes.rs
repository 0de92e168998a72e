//! Reading binary files piece by piece, with checked lengths.

use std::path::Path;

use crate::cli::error::CliError;

/// Reads a whole file.
///
/// # Errors
/// A usage error naming the file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, CliError> {
    std::fs::read(path).map_err(|e| CliError::usage(format!("{}: cannot read: {e}", path.display())))
}

/// A usage error about a file's content.
pub(crate) fn invalid(path: &Path, reason: impl std::fmt::Display) -> CliError {
    CliError::usage(format!("{}: {reason}", path.display()))
}

/// The records after a header of a magic word and a count; the file must end with them.
///
/// # Errors
/// A usage error when magic or length are wrong.
pub(crate) fn records<'a>(path: &Path, bytes: &'a [u8], magic: &str, size: usize) -> Result<&'a [u8], CliError> {
    let header = bytes.split_at_checked(8).filter(|(head, _)| head.starts_with(magic.as_bytes()));
    let Some((head, rest)) = header else {
        return Err(invalid(path, format!("does not begin with `{magic}` and a count")));
    };
    let count = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
    if count.checked_mul(size) != Some(rest.len()) {
        let found = rest.len();
        return Err(invalid(
            path,
            format!("{count} records of {size} bytes announced, {found} bytes found after byte 8"),
        ));
    }
    Ok(rest)
}

/// All f32 of a slice whose length is a multiple of 4.
pub(crate) fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> + '_ {
    bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b))
}
