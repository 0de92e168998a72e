//! Files on disk.

use std::{fs, path::Path};

/// Largest file that is read: offsets in a `.glb` are 32 bits wide.
const MAX_BYTES: u64 = 1 << 32;

/// The scene file itself.
pub(super) fn read_scene(path: &Path) -> Result<Vec<u8>, String> {
    let metadata = fs::metadata(path).map_err(|error| error.to_string())?;
    if metadata.is_dir() {
        return Err("is a folder".to_owned());
    }
    if metadata.len() > MAX_BYTES {
        return Err(format!("has {} bytes; at most {MAX_BYTES} can be read", metadata.len()));
    }
    fs::read(path).map_err(|error| error.to_string())
}

/// A file that the scene names, below the scene's folder.
pub(super) fn read_beside(folder: &Path, uri: &str) -> Result<Vec<u8>, String> {
    let path = folder.join(uri);
    let metadata = fs::metadata(&path).map_err(|error| error.to_string())?;
    // A pipe or a device could hang the import or never end.
    if !metadata.is_file() {
        return Err("is no regular file".to_owned());
    }
    read_scene(&path)
}
