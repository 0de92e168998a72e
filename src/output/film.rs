use super::{Chroma, FilmFormat, Fps, FrameSlot, Stamp, apng, gif_film, y4m};

/// What holds for every frame of a film.
#[derive(Clone, Debug)]
pub struct FilmSettings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Rate at which it plays.
    pub fps: Fps,
    /// Number of frames.
    pub frames: u64,
    /// Resolution of colour in `.y4m`.
    pub chroma: Chroma,
    /// Stamp in the metadata.
    pub stamp: Stamp,
}

impl FilmFormat {
    /// Everything before the first frame.
    ///
    /// # Errors
    /// Words on what the format does not allow.
    pub(super) fn header(self, film: &FilmSettings) -> Result<Vec<u8>, String> {
        match self {
            Self::Apng => Ok(apng::header(film)),
            Self::Gif => gif_film::header(film),
            Self::Y4m => Ok(y4m::header(film)),
        }
    }

    /// Encodes the slot's picture into its bytes, whatever the order of frames.
    ///
    /// # Errors
    /// As [`FilmFormat::header`].
    pub(super) fn frame(self, film: &FilmSettings, slot: &mut FrameSlot) -> Result<(), String> {
        match self {
            Self::Apng => apng::frame(film, slot),
            Self::Gif => gif_film::frame(film, slot),
            Self::Y4m => {
                y4m::frame(film, slot);
                Ok(())
            }
        }
    }

    /// Everything after the last frame.
    pub(super) fn trailer(self) -> Vec<u8> {
        match self {
            Self::Apng => apng::trailer(),
            Self::Gif => gif_film::trailer(),
            Self::Y4m => Vec::new(),
        }
    }
}
