//! Is a file that an earlier run left good enough to keep?

use std::{
    fs::{self, File},
    io::{BufReader, Cursor},
    path::Path,
};

use super::{FilmFormat, Stamp, StillFormat, exr_file, gif_film, png_file, y4m};

/// What a finished file must say and hold.
#[derive(Clone, Copy, Debug)]
pub struct Expected<'a> {
    /// The stamp in its metadata.
    pub stamp: &'a Stamp,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of frames.
    pub frames: u64,
}

impl Expected<'_> {
    pub(super) fn compare(&self, stamp: Option<&str>, width: u32, height: u32, frames: u64) -> Result<(), Unfit> {
        let same = (width, height, frames) == (self.width, self.height, self.frames);
        if stamp == Some(self.stamp.as_str()) && same { Ok(()) } else { Err(Unfit::Different) }
    }
}

/// Why a file is not kept.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// There is no such file.
    #[error("missing")]
    Missing,
    /// It does not decode to its end.
    #[error("broken: {0}")]
    Broken(String),
    /// It was made of another scene or with other settings.
    #[error("made of another scene or with other settings")]
    Different,
}

/// Checks a file of one frame by decoding all of it.
///
/// # Errors
/// Why it is not to be kept.
pub fn check_still(path: &Path, format: StillFormat, expected: &Expected<'_>) -> Result<(), Unfit> {
    let file = BufReader::new(open(path)?);
    match format {
        StillFormat::Png => png_file::check(file, expected),
        StillFormat::Exr => exr_file::check(file, expected),
    }
}

/// Checks a file of many frames by decoding all of it.
///
/// # Errors
/// Why it is not to be kept.
pub fn check_film(path: &Path, format: FilmFormat, expected: &Expected<'_>) -> Result<(), Unfit> {
    if format == FilmFormat::Apng {
        return png_file::check(BufReader::new(open(path)?), expected);
    }
    open(path)?;
    let bytes = fs::read(path).map_err(|e| Unfit::Broken(e.to_string()))?;
    match format {
        FilmFormat::Gif => gif_film::check(Cursor::new(&bytes), &bytes, expected),
        _ => y4m::check(&bytes, expected),
    }
}

fn open(path: &Path) -> Result<File, Unfit> {
    File::open(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Unfit::Missing,
        _ => Unfit::Broken(e.to_string()),
    })
}
