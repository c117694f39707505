//! Results that several processes make together, or one after another.
//!
//! Work on a list of items, as views, leaves a file for each [`Shard`] in the folder of the result,
//! `shard-2-of-3.record.json`: what is done, with digests of the files. A process that was stopped
//! goes on from its own; one that has all items to do takes what it finds in those of the others,
//! if all of them are there. They go when the result is complete, which then looks as if one
//! process had made it. The end of their name says what they are: a record, no result.

use anyhow::{Context, Result, bail};
use eagpt_scene::{Shard, files};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The file of a shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct PartFile {
    /// The command that it is a part of.
    command: String,
    shard: Shard,
    /// Digest of everything that decides the result.
    key: String,
    /// Whether all items of the shard are done.
    complete: bool,
    /// What is done.
    items: BTreeMap<String, Item>,
}

/// Something that is done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Item {
    /// Wall time.
    pub(crate) seconds: f64,
    /// BLAKE3 digests of its files, by their names relative to the folder.
    files: BTreeMap<PathBuf, String>,
}

/// A result under way.
#[derive(Debug)]
pub(crate) struct Parts {
    dir: PathBuf,
    own: PartFile,
    /// Parts of others whose work is taken.
    others: Vec<PartFile>,
}

/// Name of the file of a shard.
pub(crate) fn file_name(shard: Shard) -> String {
    format!("shard-{}-of-{}{SUFFIX}", shard.index, shard.of)
}

const SUFFIX: &str = ".record.json";

fn parse_name(name: &str) -> Option<Shard> {
    let middle = name.strip_prefix("shard-")?.strip_suffix(SUFFIX)?;
    middle.replacen("-of-", "/", 1).parse().ok()
}

/// The shards that have left a file in `dir`, in order.
///
/// # Errors
/// If the folder cannot be read.
pub(crate) fn shards(dir: &Path) -> Result<Vec<Shard>> {
    let context = || format!("{}: read folder", dir.display());
    let mut found = Vec::new();
    if dir.is_dir() {
        for entry in std::fs::read_dir(dir).with_context(context)? {
            let name = entry.with_context(context)?.file_name();
            found.extend(name.to_str().and_then(parse_name));
        }
    }
    found.sort_by_key(|shard| (shard.of, shard.index));
    Ok(found)
}

/// Removes what unfinished work of a command has left in `dir`.
///
/// # Errors
/// If a file cannot be read or removed, or is of another command.
pub(crate) fn clear(dir: &Path, command: &str) -> Result<()> {
    for shard in shards(dir)? {
        let path = dir.join(file_name(shard));
        let part = read(&path)?;
        if part.command != command {
            bail!(
                "{}: command: a part of `{}`, which --force of `{command}` does not replace",
                path.display(),
                part.command
            );
        }
        let plain = |file: &&PathBuf| file.components().all(|part| is_plain(&part));
        let of_items = part.items.values().flat_map(|item| item.files.keys());
        for file in of_items.filter(plain) {
            files::remove_if_there(&dir.join(file))?;
        }
        files::remove_if_there(&path)?;
    }
    Ok(())
}

/// A file of a part does not get to name files elsewhere.
fn is_plain(part: &std::path::Component<'_>) -> bool {
    matches!(part, std::path::Component::Normal(_))
}

fn read(path: &Path) -> Result<PartFile> {
    let bytes = files::read(path)?;
    serde_json::from_slice(&bytes)
        .with_context(|| format!("{}: no part of a result", path.display()))
}

impl Parts {
    /// Opens the work of `shard` on the result that `key` decides, or begins it; the whole,
    /// [`Shard::WHOLE`], takes the parts that it finds.
    ///
    /// # Errors
    /// If the folder holds parts of another result or of another division; for the whole, if a part
    /// is missing or not complete.
    pub(crate) fn open(dir: &Path, command: &str, key: &str, shard: Shard) -> Result<Self> {
        let mut own = None;
        let mut others = Vec::new();
        for found in shards(dir)? {
            let path = dir.join(file_name(found));
            let part = read(&path)?;
            let problem = if part.command != command {
                format!("a part of `{}`", part.command)
            } else if part.key != key {
                "a part of a result of other options or inputs".to_owned()
            } else if found.of != shard.of && shard != Shard::WHOLE {
                format!("a part of another division than --shard {shard}")
            } else if found == shard {
                own = Some(part);
                continue;
            } else {
                others.push(part);
                continue;
            };
            bail!(
                "{}: {problem}: --force (without --shard) starts over, --out names another folder",
                path.display()
            );
        }
        if shard == Shard::WHOLE {
            check_division(dir, &others)?;
        } else {
            others.clear();
        }
        let own = own.unwrap_or_else(|| PartFile {
            command: command.to_owned(),
            shard,
            key: key.to_owned(),
            complete: false,
            items: BTreeMap::new(),
        });
        let parts = Self {
            dir: dir.to_owned(),
            own,
            others,
        };
        files::remove_temporaries([dir.join(file_name(shard))])?;
        parts.save()?;
        Ok(parts)
    }

    /// Removes what a process that was killed has left of `files`, those of the shard: other
    /// shards, which may be writing in the same folder, have others.
    ///
    /// # Errors
    /// If something cannot be removed.
    pub(crate) fn clear_temporaries(&self, files: &[PathBuf]) -> Result<()> {
        let paths = files.iter().map(|file| self.dir.join(file));
        Ok(files::remove_temporaries(paths)?)
    }

    fn save(&self) -> Result<()> {
        let mut text = serde_json::to_string_pretty(&self.own)?;
        text.push('\n');
        let path = self.dir.join(file_name(self.own.shard));
        Ok(files::write_bytes_atomic(&path, text.as_bytes())?)
    }

    /// What is known of an item that is done and whose files are as they were.
    pub(crate) fn done(&self, item: &str) -> Option<&Item> {
        let all = std::iter::once(&self.own).chain(&self.others);
        let mut found = all.filter_map(|part| part.items.get(item));
        found.find(|item| {
            let mut files = item.files.iter();
            files.all(|(file, digest)| digest_of(&self.dir.join(file)).as_ref() == Some(digest))
        })
    }

    /// Notes that an item is done.
    ///
    /// # Errors
    /// If one of its files is not there, or the note cannot be written.
    pub(crate) fn add(&mut self, item: &str, seconds: f64, files: &[PathBuf]) -> Result<()> {
        let digests = files.iter().map(|file| {
            let path = self.dir.join(file);
            let digest = digest_of(&path).with_context(|| format!("{}: read", path.display()));
            Ok((file.clone(), digest?))
        });
        let files = digests.collect::<Result<_>>()?;
        let item = (item.to_owned(), Item { seconds, files });
        self.own.items.extend([item]);
        self.save()
    }

    /// Notes that the shard is done.
    ///
    /// # Errors
    /// If the note cannot be written.
    pub(crate) fn complete(&mut self) -> Result<()> {
        self.own.complete = true;
        self.save()
    }

    /// Removes the files of all parts: the result is complete.
    ///
    /// # Errors
    /// If one cannot be removed.
    pub(crate) fn close(self) -> Result<()> {
        for part in std::iter::once(&self.own).chain(&self.others) {
            files::remove_if_there(&self.dir.join(file_name(part.shard)))?;
        }
        Ok(())
    }
}

/// Finds out whether parts are all of one division, and complete.
fn check_division(dir: &Path, parts: &[PartFile]) -> Result<()> {
    let Some(first) = parts.first() else {
        return Ok(());
    };
    let mut missing = Vec::new();
    for shard in first.shard.siblings() {
        match parts.iter().find(|part| part.shard == shard) {
            None => missing.push(format!("{} is missing", file_name(shard))),
            Some(part) if !part.complete => {
                missing.push(format!("{} is not complete", file_name(shard)));
            }
            Some(_) => {}
        }
    }
    if let Some(other) = parts.iter().find(|part| part.shard.of != first.shard.of) {
        missing.push(format!("{} is of another division", file_name(other.shard)));
    }
    if !missing.is_empty() {
        bail!(
            "{}: {}: --shard makes a part, --force starts over",
            dir.display(),
            missing.join(", ")
        );
    }
    Ok(())
}

fn digest_of(path: &Path) -> Option<String> {
    crate::record::Input::of(path)
        .ok()
        .map(|input| input.blake3)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: [Shard; 2] = [Shard { index: 1, of: 2 }, Shard { index: 2, of: 2 }];

    fn part(dir: &Path, shard: Shard, item: &str) -> Parts {
        let mut parts = Parts::open(dir, "render", "k", shard).unwrap();
        std::fs::write(dir.join(item), item).unwrap();
        parts.add(item, 1.5, &[item.into()]).unwrap();
        parts
    }

    fn refused(dir: &Path, key: &str, shard: Shard) -> String {
        let error = Parts::open(dir, "render", key, shard).unwrap_err();
        error.to_string()
    }

    #[test]
    fn the_whole_takes_what_parts_have_done() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path();
        part(dir, TWO[0], "a").complete().unwrap();
        let message = refused(dir, "k", Shard::WHOLE);
        assert!(
            message.contains("shard-2-of-2.record.json is missing"),
            "{message}"
        );
        let mut second = part(dir, TWO[1], "b");
        let message = refused(dir, "k", Shard::WHOLE);
        assert!(
            message.contains("shard-2-of-2.record.json is not complete"),
            "{message}"
        );
        second.complete().unwrap();
        let whole = Parts::open(dir, "render", "k", Shard::WHOLE).unwrap();
        assert_eq!(whole.done("b").unwrap().seconds, 1.5);
        assert!(whole.done("c").is_none());
        std::fs::write(dir.join("a"), "changed").unwrap();
        assert!(whole.done("a").is_none());
        whole.close().unwrap();
        assert!(shards(dir).unwrap().is_empty());
    }

    #[test]
    fn what_a_killed_process_left_of_its_own_files_goes() {
        let dir = tempfile::tempdir().unwrap();
        let [mine, record, others] = ["a.png", "shard-1-of-2.record.json", "b.png"].map(|file| {
            let path = dir.path().join(format!("{file}.0b9d304f.tmp"));
            std::fs::write(&path, b"half").unwrap();
            path
        });
        let parts = Parts::open(dir.path(), "render", "k", "1/2".parse().unwrap()).unwrap();
        parts.clear_temporaries(&["a.png".into()]).unwrap();
        assert!(!mine.exists() && !record.exists());
        assert!(others.exists());
    }

    #[test]
    fn parts_of_something_else_are_refused_and_cleared_by_their_own_command() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path();
        part(dir, TWO[0], "a");
        assert!(refused(dir, "other", TWO[0]).contains("other options or inputs"));
        let three = Shard { index: 1, of: 3 };
        assert!(refused(dir, "k", three).contains("another division than --shard 1/3"));
        assert!(
            clear(dir, "paper")
                .unwrap_err()
                .to_string()
                .contains("`render`")
        );
        clear(dir, "render").unwrap();
        assert!(!dir.join("a").exists() && shards(dir).unwrap().is_empty());
    }
}
