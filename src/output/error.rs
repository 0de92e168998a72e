use std::path::Path;

/// Why frames could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// A file could not be written.
    #[error("{file}: cannot write: {reason}")]
    Write {
        /// The file.
        file: String,
        /// The system's reason.
        reason: String,
    },
    /// A folder could not be made.
    #[error("{folder}: cannot make the folder: {reason}")]
    Folder {
        /// The folder.
        folder: String,
        /// The system's reason.
        reason: String,
    },
    /// A frame could not be encoded.
    #[error("{file}: cannot encode: {reason}")]
    Encode {
        /// The file.
        file: String,
        /// What the format does not allow.
        reason: String,
    },
    /// An encoder thread could not start or ended early.
    #[error("encoder thread: {0}")]
    Thread(String),
}

impl OutputError {
    pub(super) fn write(file: &Path, error: &std::io::Error) -> Self {
        Self::Write { file: file.display().to_string(), reason: error.to_string() }
    }
}
