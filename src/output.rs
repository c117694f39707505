//! Folders that results go to: nothing that this program did not make is overwritten without being told to.

use crate::record::{FILE_NAME, Record};
use anyhow::{Context, Result, bail};
use eagpt_scene::files;
use std::collections::HashSet;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

/// Whether an earlier result may be replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Replace {
    /// No: stop with an error.
    Refuse,
    /// Yes: the files that its record lists go.
    Allow,
}

impl Replace {
    /// The choice behind a `--force` flag.
    pub(crate) fn from_flag(force: bool) -> Self {
        if force { Self::Allow } else { Self::Refuse }
    }
}

/// Finds out whether `files` (relative to `dir`) may be written, before any work and without touching anything.
///
/// # Errors
/// If the folder holds another result or one of the files is there and `replace` forbids it; if two files have one name; if
/// a file is one of `inputs`, which is never replaced.
pub(crate) fn check(
    dir: &Path,
    files: &[PathBuf],
    inputs: &[&Path],
    replace: Replace,
) -> Result<()> {
    let mut seen = HashSet::new();
    if let Some(twice) = files.iter().find(|file| !seen.insert(file.as_path())) {
        bail!(
            "{}: two results would have this name: a view is called like a folder of results",
            dir.join(twice).display()
        );
    }
    let inputs: HashSet<PathBuf> = inputs
        .iter()
        .filter_map(|path| path.canonicalize().ok())
        .collect();
    for path in files.iter().map(|file| dir.join(file)) {
        // What cannot be resolved does not exist, and then it is no input.
        if path.canonicalize().is_ok_and(|real| inputs.contains(&real)) {
            bail!("{}: --out would replace an input", path.display());
        }
    }
    if replace == Replace::Allow {
        return Ok(());
    }
    let others = std::iter::once(Path::new(FILE_NAME)).chain(files.iter().map(PathBuf::as_path));
    for file in others {
        if dir.join(file).exists() {
            bail!(
                "{}: {}: is there already: --force replaces it, --out names another folder",
                dir.display(),
                file.display()
            );
        }
    }
    Ok(())
}

/// Makes the folder ready: removes the earlier result, if it may be replaced, and makes sure that files can be written.
///
/// # Errors
/// If the folder cannot be created or written to.
pub(crate) fn prepare(dir: &Path, replace: Replace) -> Result<()> {
    if replace == Replace::Allow {
        remove_earlier(dir)?;
    }
    files::create_dir(dir)?;
    // An unwritable folder should be found before hours of work, not after.
    let probe = dir.join(".eagpt-probe");
    files::write_bytes_atomic(&probe, b"")?;
    remove(&probe)
}

/// Removes the files that a record lists, the record first: without one, what is left is known to be incomplete.
fn remove_earlier(dir: &Path) -> Result<()> {
    let path = dir.join(FILE_NAME);
    if !path.exists() {
        return Ok(());
    }
    let earlier: Option<Record> = serde_json::from_slice(&files::read(&path)?).ok();
    remove(&path)?;
    for output in earlier.into_iter().flat_map(|record| record.outputs) {
        let relative = Path::new(&output);
        let inside = relative
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
        // A record is a file like any other: it does not get to name files elsewhere.
        if inside && !output.is_empty() {
            remove(&dir.join(relative))?;
        }
    }
    Ok(())
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("{}: remove", path.display()))
        }
        _ => Ok(()),
    }
}

/// Creates the folder of `dir/file`, whose name may contain "/", and returns the full path.
///
/// # Errors
/// If the folder cannot be created.
pub(crate) fn place(dir: &Path, file: &Path) -> Result<PathBuf> {
    let path = dir.join(file);
    if let Some(parent) = path.parent() {
        files::create_dir(parent)?;
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::RecordBuilder;

    fn names(files: &[&str]) -> Vec<PathBuf> {
        files.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn an_earlier_result_stays_unless_told_otherwise() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path().join("out");
        prepare(&dir, Replace::Refuse).unwrap();
        for (path, name) in [
            (root.path(), "outside"),
            (&dir, "old.exr"),
            (&dir, "mine.txt"),
        ] {
            std::fs::write(path.join(name), "").unwrap();
        }
        let mut builder = RecordBuilder::begin("render", &()).unwrap();
        builder.record.outputs = vec!["old.exr".into(), "../outside".into()];
        builder.write(&dir).unwrap();
        let refused = check(&dir, &names(&["new.exr"]), &[], Replace::Refuse);
        assert!(refused.unwrap_err().to_string().contains("record.json"));
        check(&dir, &names(&["new.exr"]), &[], Replace::Allow).unwrap();
        prepare(&dir, Replace::Allow).unwrap();
        let mut left: Vec<_> = std::fs::read_dir(&dir)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["mine.txt"]);
        assert!(root.path().join("outside").exists());
    }

    #[test]
    fn inputs_and_double_names_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let input = dir.path().join("a.exr");
        std::fs::write(&input, "").unwrap();
        let check = |files: &[&str]| {
            check(dir.path(), &names(files), &[&input], Replace::Allow)
                .unwrap_err()
                .to_string()
        };
        assert!(check(&["b.exr", "a.exr"]).contains("an input"));
        assert!(check(&["b.exr", "b.exr"]).contains("two results"));
    }
}
