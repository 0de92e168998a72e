//! Pictures that go to files.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use crate::output::{self, Unfinished, atomic};

use super::request::StillFile;

/// Numbers that a file name may carry.
const MOST_NUMBERS: u32 = 9999;

/// Writes an 8-bit sRGB picture (4 bytes a pixel, alpha unused, rows top down) as PNG; the file it went to.
///
/// A file appears complete or not at all, and a numbered one never replaces another.
///
/// # Errors
/// When the picture is empty or the file cannot be written, in words that name the file.
pub(super) fn write(
    file: &StillFile,
    rgba: &[u8],
    width: u32,
    height: u32,
    unfinished: &Unfinished,
) -> Result<PathBuf, String> {
    let bytes = encode(rgba, width, height).map_err(|e| format!("cannot make a PNG of {width}x{height}: {e}"))?;
    match file {
        StillFile::Exact(path) => {
            atomic::write_file(path, &bytes, unfinished).map_err(|e| e.to_string())?;
            Ok(path.clone())
        }
        StillFile::Numbered(stem) => write_numbered(Path::new("."), stem, &bytes),
    }
}

fn encode(rgba: &[u8], width: u32, height: u32) -> Result<Vec<u8>, String> {
    let (mut rgb, mut bytes) = (Vec::new(), Vec::new());
    output::drop_alpha(rgba, &mut rgb);
    output::encode_rgb(width, height, &rgb, None, &mut bytes)?;
    Ok(bytes)
}

fn write_numbered(folder: &Path, stem: &str, bytes: &[u8]) -> Result<PathBuf, String> {
    let failed = |e: &io::Error| format!("{}: cannot write: {e}", folder.join(stem).display());
    let mut temporary = tempfile::NamedTempFile::new_in(folder).map_err(|e| failed(&e))?;
    temporary.write_all(bytes).map_err(|e| failed(&e))?;
    for number in 1..=MOST_NUMBERS {
        let path = folder.join(format!("{stem}_{number:04}.png"));
        match temporary.persist_noclobber(&path) {
            Ok(_) => return Ok(path),
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => temporary = error.file,
            Err(error) => return Err(failed(&error.error)),
        }
    }
    Err(format!("{stem}_0001.png to {stem}_{MOST_NUMBERS}.png are all there"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_pictures_fill_the_first_gap_and_replace_nothing() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a_0001.png"), "mine").unwrap();
        std::fs::write(folder.path().join("a_0003.png"), "mine").unwrap();
        let names: Vec<_> = (0..2).map(|_| write_numbered(folder.path(), "a", b"new").unwrap()).collect();
        assert!(names[0].ends_with("a_0002.png") && names[1].ends_with("a_0004.png"), "{names:?}");
        assert_eq!(std::fs::read(folder.path().join("a_0001.png")).unwrap(), b"mine");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4, "nothing else is left");
    }

    #[test]
    fn written_picture_decodes_to_the_same_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let rgba = [1, 2, 3, 255, 250, 251, 252, 255];
        write(&StillFile::Exact(path.clone()), &rgba, 2, 1, &Unfinished::default()).unwrap();
        assert_eq!(image::open(path).unwrap().to_rgba8().into_raw(), rgba);
    }

    #[test]
    fn missing_folder_and_empty_picture_are_errors() {
        let file = StillFile::Exact("no/such/folder/a.png".into());
        assert!(write(&file, &[0; 4], 1, 1, &Unfinished::default()).unwrap_err().contains("no/such/folder"));
        assert!(write(&file, &[], 0, 0, &Unfinished::default()).is_err());
    }
}
