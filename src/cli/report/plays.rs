//! What `report frames` plays: scenes, and sequences of .tris files.

use std::{path::Path, sync::Arc};

use kinora::report::frames::Play;

use crate::cli::{error::CliError, geometry, scene, settings::Settings};

/// Reads all arguments: a folder is the sequence of its frame_*.tris, several .tris of one folder that follow each other are one sequence.
///
/// # Errors
/// A usage error naming the file or folder.
pub(super) fn read(arguments: &[String], settings: &Settings) -> Result<Vec<Play>, CliError> {
    let mut plays = Vec::new();
    let mut rest = arguments;
    while let Some(first) = rest.first() {
        let together = rest.iter().take_while(|file| is_tris(file) && folder(file) == folder(first)).count().max(1);
        let (now, later) = rest.split_at(together);
        rest = later;
        plays.push(if Path::new(first).is_dir() {
            sequence(super::name(first, arguments), &frames_of(first)?, settings)?
        } else if geometry::is_mesh(first) {
            let inside = folder(first).and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
            let name = inside.filter(|_| now.len() > 1).unwrap_or_else(|| super::name(first, arguments).to_owned());
            sequence(&name, now, settings)?
        } else {
            Play::scene(super::name(first, arguments), Arc::new(scene::load(Some(first), settings)?))
        });
    }
    Ok(plays)
}

fn is_tris(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|e| e.eq_ignore_ascii_case("tris"))
}

fn folder(file: &str) -> Option<&Path> {
    Path::new(file).parent()
}

/// The frame_*.tris of a folder, by name.
fn frames_of(folder: &str) -> Result<Vec<String>, CliError> {
    let wrong = |reason: String| CliError::usage(format!("{folder}: {reason}"));
    let entries = std::fs::read_dir(folder).map_err(|e| wrong(format!("cannot read: {e}")))?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut files: Vec<String> = names
        .filter(|name| name.starts_with("frame_") && is_tris(name))
        .map(|name| Path::new(folder).join(name).to_string_lossy().into_owned())
        .collect();
    files.sort_unstable();
    if files.is_empty() { Err(wrong("no frame_*.tris in it".to_owned())) } else { Ok(files) }
}

fn sequence(name: &str, files: &[String], settings: &Settings) -> Result<Play, CliError> {
    let frames = geometry::read(files, settings)?;
    Ok(Play::sequence(name, &frames.positions, frames.indices)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_frames_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_string_lossy().into_owned();
        let error = frames_of(&path).expect_err("no frames").to_string();
        assert!(error.contains(&path) && error.contains("frame_*.tris"), "{error}");
        for name in ["frame_0001.tris", "frame_0000.tris", "other.tris", "frame_0002.obj"] {
            std::fs::write(folder.path().join(name), b"").expect("written");
        }
        let files = frames_of(&path).expect("frames");
        assert!(files.len() == 2 && files[0].ends_with("frame_0000.tris") && files[1].ends_with("frame_0001.tris"));
    }
}
