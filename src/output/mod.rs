//! Still and sequence writers, frame lists, resume.
//!
//! [`Target`] says where frames go, [`FrameList`] which they are; a file appears under its name only when it
//! is complete ([`atomic`]); a [`Writer`] encodes beside the tracing. Every file carries a [`Stamp`] of the scene and
//! settings it was made of, by which [`check_still`] and [`check_film`] tell a later run what is done.

mod apng;
pub mod atomic;
mod error;
mod exr_file;
mod film;
mod frames;
mod gif_film;
mod pattern;
mod png_file;
mod pos_file;
mod resume;
mod slot;
mod stamp;
mod writer;
mod y4m;

pub use atomic::{AtomicFile, Unfinished};
pub use error::OutputError;
pub use exr_file::ExrColor;
pub use film::FilmSettings;
pub use frames::{Fps, FrameList, MAX_FRAME, MAX_FRAMES, Shard};
pub use pattern::{FilmFormat, Pattern, StillFormat, Target};
#[cfg(feature = "player")]
pub(crate) use png_file::{drop_alpha, encode_rgb};
pub use pos_file::{PosClips, PosFile};
pub use resume::{Expected, Unfit, check_film, check_still};
pub use slot::FrameSlot;
pub use stamp::{SettingsHash, SettingsHasher, Stamp};
pub use writer::{FilmSink, StillSettings, Writer, Written};
pub use y4m::Chroma;

/// Name and version in every file's metadata.
const SOFTWARE: &str = concat!("kinora ", env!("CARGO_PKG_VERSION"));
