//! Still and sequence writers, frame lists, resume.
//!
//! [`Target`] says where frames go, [`FrameList`] which they are; a file appears under its name only when it
//! is complete ([`atomic`]).

pub mod atomic;
mod error;
mod frames;
mod pattern;
mod pos_file;

pub use atomic::{AtomicFile, Unfinished};
pub use error::OutputError;
pub use frames::{Fps, FrameList, MAX_FRAME, MAX_FRAMES, Shard};
pub use pattern::{FilmFormat, Pattern, StillFormat, Target};
pub use pos_file::{PosClips, write_pos};
