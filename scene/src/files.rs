//! Files that results consist of: written so that nobody ever sees half of one, known by their
//! digests, and listed in a ledger while a result is under way.

pub mod digest;
mod key;
pub mod ledger;
mod lock;
mod sealed;

pub use key::Key;
pub use ledger::Ledger;
pub use lock::FolderLock;
pub use sealed::SealedFormat;

use crate::error::{Result, SceneError};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs::File;
use std::hash::{BuildHasher, RandomState};
use std::io::{BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Creates `dir` and its parents.
///
/// # Errors
/// [`SceneError::Io`] with the folder's name.
pub fn create_dir(dir: &Path) -> Result<()> {
    std::fs::create_dir_all(dir).map_err(|e| SceneError::io(dir, "create folder", e))
}

/// Creates the folder that `path` is to lie in.
///
/// # Errors
/// As [`create_dir`].
pub fn create_parent(path: &Path) -> Result<()> {
    path.parent().map_or(Ok(()), create_dir)
}

/// First bytes of the text that Git has in place of a large file that was not fetched.
const LFS_POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";
/// Longest such text, with room for keys of extensions.
const MAX_LFS_POINTER: u64 = 1024;

/// Opens a file for reading.
///
/// # Errors
/// [`SceneError::Io`] with the file's name; [`SceneError::Invalid`] if it is a pointer of Git LFS.
pub fn open(path: &Path) -> Result<File> {
    let io = |e| SceneError::io(path, "read", e);
    let mut file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() <= MAX_LFS_POINTER {
        let mut first = Vec::new();
        let mut start = (&mut file).take(LFS_POINTER.len() as u64);
        start.read_to_end(&mut first).map_err(io)?;
        refuse_pointer(path, &first)?;
        file.rewind().map_err(io)?;
    }
    Ok(file)
}

fn refuse_pointer(path: &Path, bytes: &[u8]) -> Result<()> {
    if bytes.starts_with(LFS_POINTER) {
        let problem = "a pointer of Git LFS and not the file itself: `git lfs pull` fetches it";
        return Err(SceneError::invalid(path, "content", problem));
    }
    Ok(())
}

/// Reads a whole file.
///
/// # Errors
/// As [`open`].
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let bytes = std::fs::read(path).map_err(|e| SceneError::io(path, "read", e))?;
    refuse_pointer(path, &bytes)?;
    Ok(bytes)
}

/// Reads a JSON file.
///
/// # Errors
/// As [`open`]; [`SceneError::Invalid`] if it is no JSON, or has other keys or values than a `T`.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_slice(&read(path)?)
        .map_err(|error| SceneError::invalid(path, "JSON", error.to_string()))
}

/// Paths of all files and folders in a folder, in the order of their names.
///
/// # Errors
/// [`SceneError::NotThere`] without such a folder, [`SceneError::Io`] if it cannot be read.
pub fn list(dir: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(dir).and_then(|entries| {
        let paths = entries.map(|entry| Ok(entry?.path()));
        paths.collect::<std::io::Result<Vec<PathBuf>>>()
    });
    let mut paths = entries.map_err(|e| SceneError::io(dir, "read folder", e))?;
    paths.sort();
    Ok(paths)
}

/// Paths of all files in a folder and in those up to `depth` below it, in the order of their names.
///
/// # Errors
/// As [`list`].
pub fn list_below(dir: &Path, depth: usize) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in list(dir)? {
        if !path.is_dir() {
            files.push(path);
        } else if depth > 0 {
            files.extend(list_below(&path, depth - 1)?);
        }
    }
    Ok(files)
}

/// The name of a file relative to a folder that it is in, with `/` on every system.
pub fn relative_name(dir: &Path, path: &Path) -> String {
    let relative = path.strip_prefix(dir).unwrap_or(path);
    let parts = relative.iter().map(OsStr::to_string_lossy);
    parts.collect::<Vec<_>>().join("/")
}

/// Writes `path` through a temporary file in the same folder, flushed to disk and renamed at the
/// end: a reader sees the old content or the new, also after a crash. On an error the temporary
/// file is removed.
///
/// # Errors
/// [`SceneError::Io`] with the file's name, or whatever `write` returns.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>,
) -> Result<()> {
    let temporary = temporary_name(path);
    let outcome = write_and_sync(&temporary, path, write).and_then(|()| {
        std::fs::rename(&temporary, path).map_err(|e| SceneError::io(path, "write", e))
    });
    if outcome.is_err()
        && temporary.exists()
        && let Err(error) = std::fs::remove_file(&temporary)
    {
        tracing::warn!("{}: could not remove: {error}", temporary.display());
    }
    outcome
}

/// Writes `bytes` to `path` as [`write_atomic`] does.
///
/// # Errors
/// As [`write_atomic`].
pub fn write_bytes_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomic(path, |file| {
        file.write_all(bytes)
            .map_err(|e| SceneError::io(path, "write", e))
    })
}

/// Writes `value` as JSON for people, with a newline at its end, as [`write_atomic`] does.
///
/// # Errors
/// As [`write_atomic`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_vec_pretty(value)
        .map_err(|error| SceneError::invalid(path, "JSON", error.to_string()))?;
    text.push(b'\n');
    write_bytes_atomic(path, &text)
}

fn write_and_sync(
    temporary: &Path,
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<()>,
) -> Result<()> {
    let file = File::create(temporary).map_err(|e| SceneError::io(path, "write", e))?;
    let mut buffered = BufWriter::with_capacity(1 << 20, &file);
    write(&mut buffered)?;
    buffered
        .flush()
        .map_err(|e| SceneError::io(path, "write", e))?;
    drop(buffered);
    file.sync_all()
        .map_err(|e| SceneError::io(path, "write", e))
}

/// A name that no other process takes for the same file, nor one of another machine that shares the
/// folder.
fn temporary_name(path: &Path) -> PathBuf {
    // Numbers of processes are alike on several machines, and in containers most of all.
    static OURS: LazyLock<u32> =
        LazyLock::new(|| RandomState::new().hash_one(std::process::id()) as u32);
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{:08x}.tmp", *OURS));
    path.with_file_name(name)
}

/// Removes what processes have left that were killed while they wrote one of `paths`, or files
/// below it if it is a folder. Nothing else may be writing there.
///
/// # Errors
/// [`SceneError::Io`] if a folder cannot be read, or a file not removed.
pub fn remove_temporaries(paths: impl IntoIterator<Item = impl AsRef<Path>>) -> Result<()> {
    let mut files = BTreeMap::<PathBuf, BTreeSet<String>>::new();
    for path in paths {
        let path = path.as_ref();
        if path.is_dir() {
            sweep(path, None)?;
        } else if let Some(name) = path.file_name().and_then(OsStr::to_str) {
            // A bare name is in the current folder.
            let folder = path.parent().filter(|path| !path.as_os_str().is_empty());
            let folder = folder.unwrap_or(Path::new("."));
            files
                .entry(folder.to_owned())
                .or_default()
                .insert(name.to_owned());
        }
    }
    for (folder, names) in files.iter().filter(|(folder, _)| folder.is_dir()) {
        sweep(folder, Some(names))?;
    }
    Ok(())
}

/// Removes temporary files of `only` these names; without them, of all names, and in folders below
/// too.
fn sweep(folder: &Path, only: Option<&BTreeSet<String>>) -> Result<()> {
    for path in list(folder)? {
        let name = path.file_name().and_then(OsStr::to_str);
        let written = name.and_then(written_name);
        if path.is_dir() && !path.is_symlink() {
            if only.is_none() {
                sweep(&path, only)?;
            }
        } else if written.is_some_and(|name| only.is_none_or(|only| only.contains(name))) {
            remove_if_there(&path)?;
        }
    }
    Ok(())
}

/// The name that a temporary file would have got, as [`temporary_name`] has it; `None` of another
/// file.
fn written_name(name: &str) -> Option<&str> {
    let (name, tag) = name.strip_suffix(".tmp")?.rsplit_once('.')?;
    (tag.len() == 8 && tag.bytes().all(|byte| byte.is_ascii_hexdigit())).then_some(name)
}

/// Removes a file, or a folder with everything in it; nothing there is fine.
///
/// # Errors
/// [`SceneError::Io`] if it is there and cannot be removed.
pub fn remove_if_there(path: &Path) -> Result<()> {
    let outcome = if path.is_dir() {
        std::fs::remove_dir_all(path)
    } else {
        std::fs::remove_file(path)
    };
    match outcome {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(SceneError::io(path, "remove", error))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bin");
        write_bytes_atomic(&path, b"old").unwrap();
        let outcome = write_atomic(&path, |file| {
            file.write_all(b"half").unwrap();
            Err(SceneError::invalid(&path, "x", "stopped on purpose"))
        });
        assert!(outcome.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_a_killed_process_left_goes_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir(at("deep")).unwrap();
        for name in [
            "a.exr",
            "a.exr.0b9d304f.tmp",
            "b.exr.00000000.tmp",
            "deep/c.png.abcdef01.tmp",
            "kept.tmp",
            "kept.0b9d304.tmp",
        ] {
            std::fs::write(at(name), b"half").unwrap();
        }
        remove_temporaries([at("a.exr")]).unwrap();
        assert!(at("a.exr").exists() && !at("a.exr.0b9d304f.tmp").exists());
        assert!(at("b.exr.00000000.tmp").exists());
        remove_temporaries([dir.path()]).unwrap();
        assert!(!at("b.exr.00000000.tmp").exists() && !at("deep/c.png.abcdef01.tmp").exists());
        assert!(at("kept.tmp").exists() && at("kept.0b9d304.tmp").exists());
        remove_temporaries([at("gone/a.exr")]).unwrap();
    }

    #[test]
    fn pointers_of_git_lfs_are_no_files() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 9\n";
        write_bytes_atomic(&path, pointer.as_bytes()).unwrap();
        for outcome in [read(&path).map(|_| ()), open(&path).map(|_| ())] {
            let message = outcome.unwrap_err().to_string();
            assert!(
                message.contains("a.exr: content: a pointer of Git LFS"),
                "{message}"
            );
        }
        // Another small file is read from its start, and a missing one is named.
        write_bytes_atomic(&path, b"version 2").unwrap();
        let mut text = String::new();
        open(&path).unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "version 2");
        let message = open(&dir.path().join("b.exr")).unwrap_err().to_string();
        assert!(message.ends_with("b.exr: no such file"), "{message}");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let path = Path::new("/nonexistent-folder/a.bin");
        let message = write_bytes_atomic(path, b"x").unwrap_err().to_string();
        assert!(message.contains("/nonexistent-folder/a.bin"), "{message}");
    }
}
