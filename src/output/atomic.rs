//! Files that appear under their name only when they are complete.

use std::{
    collections::BTreeSet,
    fs,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use tempfile::{NamedTempFile, TempPath};

use super::OutputError;

/// The names of files that are being written, so that they can be removed by a thread that ends the program.
///
/// Clones share one list.
#[derive(Clone, Debug, Default)]
pub struct Unfinished(Arc<Mutex<BTreeSet<PathBuf>>>);

impl Unfinished {
    /// Removes every unfinished file and keeps others from being begun or finished as long as the guard lives.
    pub fn remove_all(&self) -> UnfinishedGuard<'_> {
        let guard = self.lock();
        for path in guard.iter() {
            // Nothing is left to do about a file that cannot be removed.
            let _ = fs::remove_file(path);
        }
        UnfinishedGuard(guard)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeSet<PathBuf>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// While it lives no file is begun or finished.
#[derive(Debug)]
pub struct UnfinishedGuard<'a>(#[expect(dead_code, reason = "held, not read")] MutexGuard<'a, BTreeSet<PathBuf>>);

/// A file under a temporary name beside its own; [`AtomicFile::finish`] renames it, dropping it removes it.
///
/// Writes are buffered. The finished file has the permissions that the user's umask gives a new file.
#[derive(Debug)]
pub struct AtomicFile {
    file: BufWriter<fs::File>,
    temporary: Option<TempPath>,
    target: PathBuf,
    unfinished: Unfinished,
}

impl AtomicFile {
    /// Begins `target` in its folder, which must exist.
    ///
    /// # Errors
    /// When the folder does not exist or is not writable.
    pub fn create(target: &Path, unfinished: &Unfinished) -> Result<Self, OutputError> {
        let mut names = unfinished.lock();
        let temporary = temporary_beside(target).map_err(|e| OutputError::write(target, &e))?;
        let (file, temporary) = temporary.into_parts();
        names.insert(temporary.to_path_buf());
        drop(names);
        let file = BufWriter::with_capacity(1 << 16, file);
        Ok(Self { file, temporary: Some(temporary), target: target.to_owned(), unfinished: unfinished.clone() })
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// When the system refuses, naming the target.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        self.file.write_all(bytes).map_err(|e| OutputError::write(&self.target, &e))
    }

    /// Gives the file its name, replacing a file of that name.
    ///
    /// # Errors
    /// When the rest cannot be written or the file not renamed; then nothing is left of it.
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.file.flush().map_err(|e| OutputError::write(&self.target, &e))?;
        let Some(temporary) = self.temporary.take() else { return Ok(()) };
        let mut names = self.unfinished.lock();
        names.remove(temporary.as_os_str().as_ref() as &Path);
        temporary.persist(&self.target).map_err(|e| OutputError::write(&self.target, &e.error))
    }
}

/// Appends; errors do not name the target.
impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(temporary) = self.temporary.take() {
            self.unfinished.lock().remove(temporary.as_os_str().as_ref() as &Path);
        }
    }
}

/// Writes a whole file at once.
///
/// # Errors
/// As [`AtomicFile`]'s steps.
pub fn write_file(target: &Path, bytes: &[u8], unfinished: &Unfinished) -> Result<(), OutputError> {
    let mut file = AtomicFile::create(target, unfinished)?;
    file.write(bytes)?;
    file.finish()
}

/// Makes the folder of `target` when it is missing and checks that a file can be made there.
///
/// # Errors
/// When the folder cannot be made or written, or `target` is a folder.
pub fn prepare(target: &Path) -> Result<(), OutputError> {
    if target.is_dir() {
        return Err(OutputError::Write { file: target.display().to_string(), reason: "is a folder".to_owned() });
    }
    let folder = folder_of(target);
    fs::create_dir_all(folder)
        .map_err(|e| OutputError::Folder { folder: folder.display().to_string(), reason: e.to_string() })?;
    temporary_beside(target).map(drop).map_err(|e| OutputError::write(target, &e))
}

fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn temporary_beside(target: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".kinora-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(target))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |e: io::Result<fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
        let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_only_when_finished() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.png");
        let mut file = AtomicFile::create(&target, &Unfinished::default()).unwrap();
        file.write(b"half").unwrap();
        assert!(!target.exists());
        file.write(b" and half").unwrap();
        file.finish().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"half and half");
        assert_eq!(names(folder.path()), ["a.png"]);
    }

    #[test]
    fn a_dropped_file_leaves_nothing_and_the_old_one_stays() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.png");
        write_file(&target, b"old", &Unfinished::default()).unwrap();
        let mut file = AtomicFile::create(&target, &Unfinished::default()).unwrap();
        file.write(b"new").unwrap();
        drop(file);
        assert_eq!(fs::read(&target).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.png"]);
    }

    #[test]
    fn unfinished_files_can_be_removed_from_outside() {
        let folder = tempfile::tempdir().unwrap();
        let unfinished = Unfinished::default();
        write_file(&folder.path().join("done.png"), b"x", &unfinished).unwrap();
        let _a = AtomicFile::create(&folder.path().join("a.png"), &unfinished).unwrap();
        let _b = AtomicFile::create(&folder.path().join("b.png"), &unfinished).unwrap();
        assert_eq!(names(folder.path()).len(), 3);
        drop(unfinished.remove_all());
        assert_eq!(names(folder.path()), ["done.png"]);
    }

    #[cfg(unix)]
    #[test]
    fn finished_files_have_ordinary_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_file(&ours, b"x", &Unfinished::default()).unwrap();
        fs::write(&plain, b"x").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn preparing_makes_folders_and_names_what_is_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        prepare(&folder.path().join("a/b/c.png")).unwrap();
        assert!(folder.path().join("a/b").is_dir());
        assert_eq!(names(&folder.path().join("a/b")).len(), 0);
        fs::write(folder.path().join("file"), b"").unwrap();
        let error = prepare(&folder.path().join("file/x.png")).unwrap_err().to_string();
        assert!(error.contains("file"), "{error}");
        let error = prepare(&folder.path().join("a/b")).unwrap_err().to_string();
        assert!(error.contains("is a folder"), "{error}");
    }
}
