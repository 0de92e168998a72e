use std::fmt::Display;

/// Why a file could not be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file, or a file it names, could not be read.
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
    /// The file requires an extension that the importer does not know.
    #[error("{file}: extensionsRequired: {extension} is not supported: {advice}")]
    Unsupported {
        /// File as the caller named it.
        file: String,
        /// The extension's name.
        extension: String,
        /// What the user can do.
        advice: String,
    },
    /// Decoding would need far more memory than a file of this size should.
    #[error(
        "{file}: {place}: needs {needed} bytes more when {left} of {limit} allowed for a file of this size are left"
    )]
    TooLarge {
        /// File as the caller named it.
        file: String,
        /// Place in the file that asks for the memory.
        place: String,
        /// Bytes asked for there.
        needed: u64,
        /// Bytes left of the limit.
        left: u64,
        /// Bytes that the whole import may use.
        limit: u64,
    },
}

/// An [`ImportError`] that does not know its file yet.
#[derive(Clone, Debug)]
pub(super) enum Problem {
    Invalid { place: String, reason: String },
    Unsupported { extension: String, advice: String },
    TooLarge { place: String, needed: u64, left: u64, limit: u64 },
}

impl Problem {
    /// Something at `place` is not valid glTF.
    pub(super) fn at(place: impl Display, reason: impl Display) -> Self {
        Self::Invalid { place: one_line(&place.to_string()), reason: one_line(&reason.to_string()) }
    }

    /// The place in the file.
    pub(super) fn place(&self) -> &str {
        match self {
            Self::Invalid { place, .. } | Self::TooLarge { place, .. } => place,
            Self::Unsupported { .. } => "extensionsRequired",
        }
    }

    /// The reason without the file.
    pub(super) fn reason(&self) -> String {
        match self {
            Self::Invalid { reason, .. } => reason.clone(),
            Self::Unsupported { extension, advice } => format!("{extension} is not supported: {advice}"),
            Self::TooLarge { needed, left, .. } => format!("needs {needed} bytes where {left} are left"),
        }
    }

    pub(super) fn in_file(self, file: &str) -> ImportError {
        let file = file.to_owned();
        match self {
            Self::Invalid { place, reason } => ImportError::Invalid { file, place, reason },
            Self::Unsupported { extension, advice } => ImportError::Unsupported { file, extension, advice },
            Self::TooLarge { place, needed, left, limit } => ImportError::TooLarge { file, place, needed, left, limit },
        }
    }
}

/// Most characters of a place, reason or warning: a file may put its own text into them.
const MAX_TEXT: usize = 400;

/// `text` on one line, control characters escaped, cut after [`MAX_TEXT`] characters.
pub(super) fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len().min(MAX_TEXT));
    for (i, c) in text.chars().enumerate() {
        if i == MAX_TEXT {
            line.push_str("...");
            break;
        }
        if c.is_control() { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line
}

/// Result of an import step.
pub(super) type Step<T> = Result<T, Problem>;
