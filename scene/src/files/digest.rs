//! BLAKE3 digests of files, hexadecimal.

use super::list_below;
use crate::error::{Result, SceneError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Digest of some bytes.
pub fn of_bytes(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Digest of a file.
///
/// # Errors
/// [`SceneError::Io`] if it cannot be read.
pub fn of_file(path: &Path) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    File::open(path)
        .and_then(|file| hasher.update_reader(file).map(|_| ()))
        .map_err(|e| SceneError::io(path, "read", e))?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// Digests of files that were read once, trusted as long as size and time of change stay.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Digests {
    files: BTreeMap<PathBuf, KnownFile>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct KnownFile {
    num_bytes: u64,
    changed_ns: u128,
    blake3: String,
}

impl Digests {
    /// Digest of a file, or of all files of a folder with their names. Records are left out, since
    /// they hold times, and so are hidden files.
    ///
    /// # Errors
    /// [`SceneError::Io`] if something cannot be read.
    pub fn of(&mut self, path: &Path) -> Result<String> {
        if !path.is_dir() {
            return self.of_file(path);
        }
        let mut hasher = blake3::Hasher::new();
        for file in list_below(path, usize::MAX)? {
            let own_name = file.file_name().unwrap_or_default().to_string_lossy();
            if own_name.ends_with("record.json") || own_name.starts_with('.') {
                continue;
            }
            let name = file.strip_prefix(path).unwrap_or(&file);
            hasher.update(format!("{}\0{}\0", name.display(), self.of_file(&file)?).as_bytes());
        }
        Ok(hasher.finalize().to_hex().to_string())
    }

    fn of_file(&mut self, path: &Path) -> Result<String> {
        let metadata = std::fs::metadata(path).map_err(|e| SceneError::io(path, "read", e))?;
        let changed = (metadata.modified()).map_err(|e| SceneError::io(path, "read", e))?;
        let since = changed.duration_since(UNIX_EPOCH).unwrap_or_default();
        let (num_bytes, changed_ns) = (metadata.len(), since.as_nanos());
        if let Some(known) = self.files.get(path)
            && (known.num_bytes, known.changed_ns) == (num_bytes, changed_ns)
        {
            return Ok(known.blake3.clone());
        }
        let blake3 = of_file(path)?;
        let known = KnownFile {
            num_bytes,
            changed_ns,
            blake3: blake3.clone(),
        };
        self.files.insert(path.to_owned(), known);
        Ok(blake3)
    }

    /// Takes over what another one knows.
    pub fn extend(&mut self, other: Self) {
        self.files.extend(other.files);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The digest of "abc" in the test vectors of BLAKE3's authors.
    const ABC: &str = "6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85";

    #[test]
    fn files_and_folders_have_digests_of_their_content() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("a");
        std::fs::write(&file, b"abc").unwrap();
        let mut digests = Digests::default();
        assert_eq!(digests.of(&file).unwrap(), ABC);
        let folder = digests.of(root.path()).unwrap();
        std::fs::write(root.path().join("record.json"), b"{}").unwrap();
        assert_eq!(digests.of(root.path()).unwrap(), folder);
        std::fs::write(&file, b"abcd").unwrap();
        assert_ne!(digests.of(root.path()).unwrap(), folder);
        assert!(digests.of(&root.path().join("b")).is_err());
    }
}
