//! What several test files need.
#![allow(dead_code, reason = "each test file uses its share")]

use std::path::{Path, PathBuf};

/// The folder of shared assets, references and hard cases; `None` (with a note) when it is not there.
///
/// # Panics
/// When it is not there and `KINORA_REQUIRE_SHARED` is set.
pub(crate) fn shared_dir() -> Option<PathBuf> {
    let dir = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared"));
    if dir.is_dir() {
        return Some(dir.to_owned());
    }
    assert!(std::env::var_os("KINORA_REQUIRE_SHARED").is_none(), "{} is not there", dir.display());
    println!("skipped: {} is not there", dir.display());
    None
}
