//! What ends a command, and with which exit code.

use std::fmt;

use kinora::{
    accel::BuildError, dynamics::FrameError, output::OutputError, render::RenderError, scene::import::ImportError,
};

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum CliError {
    /// Wrong arguments, or input that is missing, unreadable or invalid: exit code 2.
    Usage(String),
    /// The work failed after valid input: exit code 1.
    Failed(String),
    /// A signal asked for the end; its number: exit code 128 + number.
    Signal(i32),
}

impl CliError {
    /// A [`CliError::Usage`].
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }

    /// A [`CliError::Failed`].
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self::Failed(message.into())
    }

    /// The program's exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Failed(_) => 1,
            Self::Signal(number) => u8::try_from(128 + number).unwrap_or(1),
        }
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(message) | Self::Failed(message) => f.write_str(message),
            Self::Signal(number) => write!(f, "stopped by signal {number}; only whole files are left"),
        }
    }
}

impl From<ImportError> for CliError {
    fn from(error: ImportError) -> Self {
        Self::Usage(error.to_string())
    }
}

impl From<RenderError> for CliError {
    fn from(error: RenderError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<BuildError> for CliError {
    fn from(error: BuildError) -> Self {
        match error {
            BuildError::Spec(_) => Self::Usage(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<FrameError> for CliError {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::Build(error) => error.into(),
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<OutputError> for CliError {
    fn from(error: OutputError) -> Self {
        Self::Failed(error.to_string())
    }
}
