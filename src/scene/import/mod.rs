//! From glTF bytes to a [`Scene`](super::Scene). The only user of the glTF crate.

use std::path::Path;

use super::Scene;

/// Why a file could not be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file could not be read.
    #[error("{file}: cannot read: {reason}")]
    Read {
        /// File as the caller named it.
        file: String,
        /// The system's reason.
        reason: String,
    },
    /// The content is not valid glTF.
    #[error("{file}: {place}: {reason}")]
    Invalid {
        /// File as the caller named it.
        file: String,
        /// Place in the file, as `accessors[3].count`.
        place: String,
        /// What is wrong and what to do.
        reason: String,
    },
}

/// Imports a `.gltf` or `.glb` file with everything it refers to.
///
/// # Errors
/// When the file or a file it names cannot be read, or its content is not valid.
pub fn from_path(path: &Path) -> Result<Scene, ImportError> {
    Err(ImportError::Read { file: path.display().to_string(), reason: "importer is being written".into() })
}

/// Imports from memory; `resolve` is asked for the bytes behind each relative URI (percent-decoded).
///
/// # Errors
/// As [`from_path`].
pub fn from_bytes(
    name: &str,
    _bytes: &[u8],
    _resolve: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<Scene, ImportError> {
    Err(ImportError::Read { file: name.to_owned(), reason: "importer is being written".into() })
}
