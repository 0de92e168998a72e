//! What a finished file says about how it was made, so that a later run can tell whether to keep it.

use std::fmt;

use sha2::{Digest, Sha256};

/// Keyword of the stamp in a file's metadata.
pub(super) const KEYWORD: &str = "kinora";

/// Hash over the scene's bytes and everything that decides the pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingsHash(String);

impl SettingsHash {
    /// The hash in hexadecimal.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// Collects what a [`SettingsHash`] covers. Order counts.
#[derive(Clone, Debug)]
pub struct SettingsHasher(Sha256);

impl Default for SettingsHasher {
    /// Begins with this version of the program, since another may draw otherwise.
    fn default() -> Self {
        let mut hasher = Self(Sha256::new());
        hasher.add("version", env!("CARGO_PKG_VERSION").as_bytes());
        hasher
    }
}

impl SettingsHasher {
    /// Adds a named value.
    pub fn add(&mut self, name: &str, value: &[u8]) {
        for part in [name.as_bytes(), value] {
            self.0.update((part.len() as u64).to_le_bytes());
            self.0.update(part);
        }
    }

    /// The hash of all that was added, to be added to another.
    pub fn digest(self) -> [u8; 32] {
        self.0.finalize().into()
    }

    /// The hash of all that was added.
    pub fn finish(self) -> SettingsHash {
        let hex = |digit: u8| char::from(b"0123456789abcdef"[usize::from(digit)]);
        SettingsHash(self.digest().iter().flat_map(|b| [hex(b >> 4), hex(b & 15)]).collect())
    }
}

/// The stamp of one file: the settings and which frame or how many it holds. Its text has no spaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp(String);

impl Stamp {
    /// Of a file that holds one frame.
    pub fn of_frame(settings: &SettingsHash, frame: u64) -> Self {
        Self(format!("settings={};frame={frame}", settings.0))
    }

    /// Of a file that holds `count` frames; which ones is for the settings to say.
    pub fn of_film(settings: &SettingsHash, count: u64) -> Self {
        Self(format!("settings={};frames={count}", settings.0))
    }

    /// The first 16 digits of the settings' hash, where there is room for no more.
    pub fn short(&self) -> &str {
        self.0.strip_prefix("settings=").and_then(|hash| hash.get(..16)).unwrap_or_default()
    }

    /// The text in the file.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hash(parts: &[(&str, &str)]) -> String {
        let mut hasher = SettingsHasher::default();
        for (name, value) in parts {
            hasher.add(name, value.as_bytes());
        }
        hasher.finish().0
    }

    #[test]
    fn equal_settings_hash_equal_and_others_do_not() {
        assert_eq!(hash(&[("a", "1"), ("b", "2")]), hash(&[("a", "1"), ("b", "2")]));
        assert_ne!(hash(&[("a", "1")]), hash(&[("a", "2")]));
        assert_ne!(hash(&[("a", "1b")]), hash(&[("a1", "b")]));
        assert_ne!(hash(&[("a", ""), ("b", "")]), hash(&[("a", "b")]));
        assert_eq!(hash(&[]).len(), 64);
    }
}
