//! Folders that results go to: nothing that this program did not make is overwritten without being
//! told to.

use crate::record::{FILE_NAME, Record};
use anyhow::{Result, anyhow, bail};
use eagpt_scene::files;
use std::collections::HashSet;
use std::iter;
use std::path::{Component, Path, PathBuf};

/// Treatment of an earlier result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Replace {
    /// No: stop with an error.
    Refuse,
    /// Yes: the files that its record lists go.
    Allow,
    /// A complete one not, but what unfinished work on the same result has left.
    Continue,
}

impl Replace {
    /// The choice behind a `--force` flag.
    pub(crate) fn from_flag(force: bool) -> Self {
        if force { Self::Allow } else { Self::Refuse }
    }
}

/// A folder that a command wants to put its results into.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target<'a> {
    /// The folder.
    pub(crate) dir: &'a Path,
    /// File name of the result's record: `record.json` but where results share a folder.
    pub(crate) record: &'a str,
    /// Name of the command, as in its record: `--force` replaces results of the same command only.
    pub(crate) command: &'a str,
    /// Files that the command reads: they are never replaced nor removed.
    pub(crate) inputs: &'a [PathBuf],
    /// Treatment of an earlier result.
    pub(crate) replace: Replace,
}

impl<'a> Target<'a> {
    /// A folder of its own for the result of `command`, which `--force` replaces.
    pub(crate) fn new(dir: &'a Path, command: &'a str, inputs: &'a [PathBuf], force: bool) -> Self {
        Self {
            dir,
            record: FILE_NAME,
            command,
            inputs,
            replace: Replace::from_flag(force),
        }
    }

    /// Finds out whether `files` (relative to the folder) may be written, before any work and
    /// without touching anything.
    ///
    /// # Errors
    /// If the folder holds another result or one of the files is there and may not be replaced; if
    /// two files have one name; if a file is an input.
    pub(crate) fn check(&self, files: &[PathBuf]) -> Result<()> {
        let mut seen = HashSet::new();
        if let Some(twice) = files.iter().find(|file| !seen.insert(file.as_path())) {
            bail!(
                "{}: two results would have this name: a view is called like a folder of results, or named twice",
                self.dir.join(twice).display()
            );
        }
        let inputs = self.resolved_inputs();
        for path in files.iter().map(|file| self.dir.join(file)) {
            if is_input(&path, &inputs) {
                bail!("{}: --out would replace an input", path.display());
            }
        }
        let files = match self.replace {
            Replace::Allow => return self.earlier().map(|_| ()),
            Replace::Continue => &[],
            Replace::Refuse => files,
        };
        let others = iter::once(Path::new(self.record)).chain(files.iter().map(PathBuf::as_path));
        for file in others {
            if self.dir.join(file).exists() {
                bail!(
                    "{}: {}: is there already: --force replaces it, --out names another folder",
                    self.dir.display(),
                    file.display()
                );
            }
        }
        Ok(())
    }

    /// Makes the folder ready: removes the earlier result, if it may be replaced, and makes sure
    /// that files can be written.
    ///
    /// # Errors
    /// If the folder cannot be created or written to.
    pub(crate) fn prepare(&self) -> Result<()> {
        if self.replace == Replace::Allow
            && let Some(earlier) = self.earlier()?
        {
            self.remove_earlier(&earlier)?;
        }
        files::create_dir(self.dir)?;
        // An unwritable folder should be found before hours of work, not after.
        let probe = self.dir.join(".eagpt-probe");
        files::write_bytes_atomic(&probe, b"")?;
        Ok(files::remove_if_there(&probe)?)
    }

    /// The record of the result that may be replaced, if there is one.
    fn earlier(&self) -> Result<Option<Record>> {
        let path = self.dir.join(self.record);
        if !path.exists() {
            return Ok(None);
        }
        read_record(&path, self.command).map(Some)
    }

    /// Removes the files that a record lists, the record first: without one, what is left is known
    /// to be incomplete.
    fn remove_earlier(&self, earlier: &Record) -> Result<()> {
        let inputs = self.resolved_inputs();
        files::remove_if_there(&self.dir.join(self.record))?;
        for relative in earlier.outputs.iter().map(Path::new) {
            let path = self.dir.join(relative);
            // A record is a file like any other: it does not get to name files elsewhere.
            let inside = relative
                .components()
                .all(|part| matches!(part, Component::Normal(_)));
            if inside && path.is_file() && !is_input(&path, &inputs) {
                files::remove_if_there(&path)?;
            }
        }
        Ok(())
    }

    fn resolved_inputs(&self) -> HashSet<PathBuf> {
        // A path that cannot be resolved does not exist.
        let resolved = self
            .inputs
            .iter()
            .filter_map(|path| path.canonicalize().ok());
        resolved.collect()
    }
}

fn is_input(path: &Path, inputs: &HashSet<PathBuf>) -> bool {
    path.canonicalize().is_ok_and(|real| inputs.contains(&real))
}

/// The record of a result that is a file: `E.record.json` beside `E.ply`, so that many may share a
/// folder.
pub(crate) fn record_path(out: &Path) -> PathBuf {
    out.with_extension("record.json")
}

/// Finds out whether `command` may write the file `out` and its record, without touching anything.
///
/// # Errors
/// If one of them is an input, or there already and not to be replaced: what is there has to be a
/// result of the same command.
pub(crate) fn check_file(
    out: &Path,
    command: &str,
    inputs: &[&Path],
    replace: Replace,
) -> Result<()> {
    let record = record_path(out);
    for path in [out, &record] {
        check_part(path, inputs, replace)?;
    }
    if !out.exists() && !record.exists() {
        return Ok(());
    }
    // A trained scene takes hours: no slip of --out may cost it.
    read_record(&record, command).map(|_| ())
}

/// Finds out whether a result may have the file `path`, without touching anything.
///
/// # Errors
/// If it is an input, or there already and not to be replaced.
pub(crate) fn check_part(path: &Path, inputs: &[&Path], replace: Replace) -> Result<()> {
    let real = path.canonicalize().ok();
    if real.is_some() && inputs.iter().any(|input| input.canonicalize().ok() == real) {
        bail!("{}: --out would replace an input", path.display());
    }
    if path.exists() && replace == Replace::Refuse {
        bail!(
            "{}: is there already: --force replaces it, --out names another file",
            path.display()
        );
    }
    Ok(())
}

/// The record of an earlier result that `--force` of `command` may replace.
fn read_record(path: &Path, command: &str) -> Result<Record> {
    let no_result = |problem: &dyn std::fmt::Display| {
        anyhow!(
            "{}: no record of this program, --force does not replace it: {problem}",
            path.display()
        )
    };
    let bytes = files::read(path).map_err(|error| no_result(&error))?;
    let record: Record = serde_json::from_slice(&bytes).map_err(|error| no_result(&error))?;
    if record.command != command {
        bail!(
            "{}: command: a result of `{}`, which --force of `{command}` does not replace",
            path.display(),
            record.command,
        );
    }
    Ok(record)
}

/// Creates the folder that `path` lies in.
///
/// # Errors
/// If it cannot be created.
pub(crate) fn create_parent(path: &Path) -> Result<()> {
    if let Some(parent) = path.parent().filter(|p| *p != Path::new("")) {
        files::create_dir(parent)?;
    }
    Ok(())
}

/// Creates the folder of `dir/file`, whose name may contain "/", and returns the full path.
///
/// # Errors
/// If the folder cannot be created.
pub(crate) fn place(dir: &Path, file: &Path) -> Result<PathBuf> {
    let path = dir.join(file);
    create_parent(&path)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::RecordBuilder;

    fn names(files: &[&str]) -> Vec<PathBuf> {
        files.iter().map(PathBuf::from).collect()
    }

    fn target<'a>(dir: &'a Path, inputs: &'a [PathBuf], replace: Replace) -> Target<'a> {
        Target {
            dir,
            record: FILE_NAME,
            command: "render",
            inputs,
            replace,
        }
    }

    fn refusal(target: &Target<'_>, files: &[&str]) -> String {
        target.check(&names(files)).unwrap_err().to_string()
    }

    #[test]
    fn an_earlier_result_stays_unless_told_otherwise() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path().join("out");
        let inputs = [dir.join("input.exr")];
        target(&dir, &[], Replace::Refuse).prepare().unwrap();
        let files = ["old.exr", "input.exr", "mine.txt"].map(|name| dir.join(name));
        for path in files.iter().chain([&root.path().join("outside")]) {
            std::fs::write(path, "").unwrap();
        }
        let mut builder =
            RecordBuilder::begin("render", &(), &crate::args::GlobalArgs::default()).unwrap();
        builder.record.outputs = ["old.exr", "input.exr", "../outside"]
            .map(Into::into)
            .into();
        builder.write(&dir).unwrap();
        let refused = refusal(&target(&dir, &inputs, Replace::Refuse), &["new.exr"]);
        assert!(refused.contains("record.json"), "{refused}");
        let allowed = target(&dir, &inputs, Replace::Allow);
        let other = Target {
            command: "eval",
            ..allowed
        };
        assert!(refusal(&other, &["new.exr"]).contains("`render`"));
        allowed.check(&names(&["new.exr"])).unwrap();
        allowed.prepare().unwrap();
        let mut left: Vec<_> = std::fs::read_dir(&dir)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["input.exr", "mine.txt"]);
        assert!(root.path().join("outside").exists());
    }

    #[test]
    fn inputs_and_double_names_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let inputs = [dir.path().join("a.exr")];
        std::fs::write(&inputs[0], "").unwrap();
        let target = target(dir.path(), &inputs, Replace::Allow);
        assert!(refusal(&target, &["b.exr", "a.exr"]).contains("an input"));
        assert!(refusal(&target, &["b.exr", "b.exr"]).contains("two results"));
    }

    #[test]
    fn foreign_files_stay() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a.exr"), "").unwrap();
        let target = target(dir.path(), &[], Replace::Refuse);
        assert!(refusal(&target, &["a.exr"]).contains("--force"));
        std::fs::write(dir.path().join(FILE_NAME), "{}").unwrap();
        let forced = Target {
            replace: Replace::Allow,
            ..target
        };
        assert!(refusal(&forced, &["b.exr"]).contains("no record of this program"));
    }
}
