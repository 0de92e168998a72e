//! Where frames go: a numbered sequence, one still, one animated file, or a stream to stdout.

use std::path::{Path, PathBuf};

/// Format of a file that holds one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StillFormat {
    /// 8-bit sRGB PNG.
    Png,
    /// OpenEXR with colour, depth and instance layers.
    Exr,
}

/// Format of a file that holds all frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// Animated PNG.
    Apng,
    /// Animated GIF.
    Gif,
    /// Uncompressed YUV4MPEG2.
    Y4m,
}

/// What `--output` names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// One file a frame.
    Sequence(Pattern, StillFormat),
    /// One file for the only frame.
    Still(PathBuf, StillFormat),
    /// One file for all frames.
    Film(PathBuf, FilmFormat),
    /// A `.y4m` stream to stdout.
    Stdout,
}

impl Target {
    /// Reads an output pattern: one run of `#` in the file name is the frame number, the extension is the format,
    /// `-` is stdout.
    ///
    /// # Errors
    /// Words on what is wrong: unknown extension, several runs of `#`, a `#` where one file holds all frames.
    pub fn parse(text: &Path) -> Result<Self, String> {
        if text.as_os_str() == "-" {
            return Ok(Self::Stdout);
        }
        let Some(name) = text.file_name() else {
            return Err("no file name".to_owned());
        };
        let name = name.to_str().ok_or_else(|| "the file name is not UTF-8".to_owned())?;
        let extension = Path::new(name).extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let pattern = Pattern::split(text, name)?;
        match (extension.as_str(), pattern) {
            ("png", Some(pattern)) => Ok(Self::Sequence(pattern, StillFormat::Png)),
            ("exr", Some(pattern)) => Ok(Self::Sequence(pattern, StillFormat::Exr)),
            ("png", None) => Ok(Self::Still(text.to_owned(), StillFormat::Png)),
            ("exr", None) => Ok(Self::Still(text.to_owned(), StillFormat::Exr)),
            ("apng" | "gif" | "y4m", Some(_)) => {
                Err(format!("one .{extension} file holds all frames: leave the # out"))
            }
            ("apng", None) => Ok(Self::Film(text.to_owned(), FilmFormat::Apng)),
            ("gif", None) => Ok(Self::Film(text.to_owned(), FilmFormat::Gif)),
            ("y4m", None) => Ok(Self::Film(text.to_owned(), FilmFormat::Y4m)),
            _ => Err("expected a name that ends in .png, .exr, .apng, .gif or .y4m, or - for stdout".to_owned()),
        }
    }

    /// The file of a frame; `None` for stdout.
    pub fn file(&self, frame: u64) -> Option<PathBuf> {
        match self {
            Self::Sequence(pattern, _) => Some(pattern.file(frame)),
            Self::Still(path, _) | Self::Film(path, _) => Some(path.clone()),
            Self::Stdout => None,
        }
    }

    /// True when all frames go into one file or stream.
    pub fn holds_all_frames(&self) -> bool {
        matches!(self, Self::Film(..) | Self::Stdout)
    }
}

/// A path whose file name has one run of `#`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    folder: PathBuf,
    before: String,
    digits: usize,
    after: String,
}

impl Pattern {
    fn split(path: &Path, name: &str) -> Result<Option<Self>, String> {
        let Some(start) = name.find('#') else {
            return Ok(None);
        };
        let digits = name[start..].bytes().take_while(|&b| b == b'#').count();
        let after = &name[start + digits..];
        if after.contains('#') {
            return Err("more than one run of #: one run is the frame number".to_owned());
        }
        if digits > 20 {
            return Err("a run of more than 20 #".to_owned());
        }
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        Ok(Some(Self { folder, before: name[..start].to_owned(), digits, after: after.to_owned() }))
    }

    /// The file of a frame: its number with leading zeros, longer than the run where it must be.
    pub fn file(&self, frame: u64) -> PathBuf {
        self.folder.join(format!("{}{frame:0width$}{}", self.before, self.after, width = self.digits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Target, String> {
        Target::parse(Path::new(text))
    }

    #[test]
    fn the_run_of_hashes_is_the_padded_frame_number() {
        let target = parse("out/f_####.png").unwrap();
        assert_eq!(target.file(7), Some(PathBuf::from("out/f_0007.png")));
        assert_eq!(target.file(123_456), Some(PathBuf::from("out/f_123456.png")));
        assert_eq!(parse("#.EXR").unwrap().file(3), Some(PathBuf::from("3.EXR")));
        assert_eq!(parse("a##b.png").unwrap().file(3), Some(PathBuf::from("a03b.png")));
    }

    #[test]
    fn hashes_in_folders_are_letters_like_others() {
        assert_eq!(parse("shot#1/f_#.png").unwrap().file(2), Some(PathBuf::from("shot#1/f_2.png")));
        assert!(matches!(parse("shot#1/f.png"), Ok(Target::Still(..))));
    }

    #[test]
    fn the_extension_picks_the_format() {
        assert!(matches!(parse("a.png"), Ok(Target::Still(_, StillFormat::Png))));
        assert!(matches!(parse("a.exr"), Ok(Target::Still(_, StillFormat::Exr))));
        assert!(matches!(parse("a.apng"), Ok(Target::Film(_, FilmFormat::Apng))));
        assert!(matches!(parse("a.gif"), Ok(Target::Film(_, FilmFormat::Gif))));
        assert!(matches!(parse("a.y4m"), Ok(Target::Film(_, FilmFormat::Y4m))));
        assert_eq!(parse("-"), Ok(Target::Stdout));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for text in ["a.jpg", "a", ".png", "", "a_#_#.png", "a_#.gif", "a_#.y4m", "dir/", "..", "a.png#", "/"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
