//! The ledger of a result under way: which of its items are done, so that a process that was
//! stopped resumes, and several processes can share the work.
//!
//! Work on a list of items, as views, keeps a ledger for each [`Shard`] in the folder of the
//! result, `shard-2-of-3.record.json`. It names the command, the [`Key`] of the result, and for
//! each item that is done its files with their digests. An item whose files are not what they were
//! is not done. The whole, [`Shard::WHOLE`], takes what it finds in the ledgers of shards.

use super::key::Key;
use super::{digest, list, read, remove_if_there, remove_temporaries, write_json};
use crate::error::{Result, SceneError};
use crate::shard::Shard;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// A ledger as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct LedgerFile {
    /// The command whose result it is.
    command: String,
    shard: Shard,
    /// Everything that decides the result; that of a shard is that of the whole.
    key: Key,
    /// True once all items of the shard are done.
    complete: bool,
    /// Items that are done.
    items: BTreeMap<String, Item>,
}

/// An item that is done.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Item {
    /// Wall time.
    #[serde(default)]
    pub seconds: f64,
    /// Everything that decides this item, where items of one result are made under different keys.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<Key>,
    /// Data noted with it.
    #[serde(default, skip_serializing_if = "serde_json::Value::is_null")]
    value: serde_json::Value,
    /// BLAKE3 digests of its files, by their names relative to the folder.
    files: BTreeMap<PathBuf, String>,
}

impl Item {
    /// Data noted with it; `None` if there are none, or of another form, as after a change of
    /// versions.
    pub fn value<T: DeserializeOwned>(&self) -> Option<T> {
        T::deserialize(&self.value).ok()
    }
}

/// The ledger of a shard, and those of others whose work it takes.
#[derive(Debug)]
pub struct Ledger {
    dir: PathBuf,
    own: LedgerFile,
    others: Vec<LedgerFile>,
}

const SUFFIX: &str = ".record.json";

/// Advice where a result is a folder, `--out`.
pub const ADVICE: &str = "--force (without --shard) starts over, --out names another folder";

/// Name of the ledger of a shard. The end says that it is a record, no result.
pub fn file_name(shard: Shard) -> String {
    format!("shard-{}-of-{}{SUFFIX}", shard.index, shard.of)
}

fn parse_name(name: &str) -> Option<Shard> {
    let middle = name.strip_prefix("shard-")?.strip_suffix(SUFFIX)?;
    middle.replacen("-of-", "/", 1).parse().ok()
}

/// The shards that have a ledger in `dir`, in order.
///
/// # Errors
/// If the folder cannot be read.
pub fn shards(dir: &Path) -> Result<Vec<Shard>> {
    if !dir.is_dir() {
        return Ok(Vec::new());
    }
    let paths = list(dir)?.into_iter();
    let mut found: Vec<Shard> = paths
        .filter_map(|path| parse_name(path.file_name()?.to_str()?))
        .collect();
    found.sort_by_key(|shard| (shard.of, shard.index));
    Ok(found)
}

/// Removes the ledgers of a command in `dir`, and the files that they name.
///
/// # Errors
/// If a file cannot be read or removed, or is of another command.
pub fn clear(dir: &Path, command: &str) -> Result<()> {
    for shard in shards(dir)? {
        let path = dir.join(file_name(shard));
        let ledger = read_ledger(&path)?;
        if ledger.command != command {
            let problem = format!(
                "command: a part of `{}`, which --force of `{command}` does not replace",
                ledger.command
            );
            return Err(SceneError::Work { path, problem });
        }
        // A ledger does not get to name files elsewhere.
        let is_below = |file: &&PathBuf| {
            let mut components = file.components();
            components.all(|part| matches!(part, Component::Normal(_)))
        };
        let of_items = ledger.items.values().flat_map(|item| item.files.keys());
        for file in of_items.filter(is_below) {
            remove_if_there(&dir.join(file))?;
        }
        remove_if_there(&path)?;
    }
    Ok(())
}

fn read_ledger(path: &Path) -> Result<LedgerFile> {
    serde_json::from_slice(&read(path)?).map_err(|_| SceneError::Work {
        path: path.to_owned(),
        problem: "no part of a result".to_owned(),
    })
}

impl Ledger {
    /// Opens the ledger of `shard` on the result of `command` that `key` decides, or begins it; the
    /// whole takes the work of the shards that it finds.
    ///
    /// # Errors
    /// [`SceneError::Work`], which ends with `advice`, if the folder holds parts of another result
    /// or of another division; [`SceneError::Io`].
    pub fn open(dir: &Path, command: &str, key: &Key, shard: Shard, advice: &str) -> Result<Self> {
        let mut own = None;
        let mut others = Vec::new();
        for found in shards(dir)? {
            let path = dir.join(file_name(found));
            let ledger = read_ledger(&path)?;
            let problem = if ledger.command != command {
                format!("a part of `{}`", ledger.command)
            } else if ledger.key != *key {
                let differences = ledger.key.differences_in_words(key);
                format!("a part of a result with {differences}")
            } else if found.of != shard.of && shard != Shard::WHOLE {
                format!("a part of another division than --shard {shard}")
            } else if found == shard {
                own = Some(ledger);
                continue;
            } else {
                others.push(ledger);
                continue;
            };
            let problem = format!("{problem}: {advice}");
            return Err(SceneError::Work { path, problem });
        }
        if shard != Shard::WHOLE {
            others.clear();
        }
        let own = own.unwrap_or_else(|| LedgerFile {
            command: command.to_owned(),
            shard,
            key: key.clone(),
            complete: false,
            items: BTreeMap::new(),
        });
        let ledger = Self {
            dir: dir.to_owned(),
            own,
            others,
        };
        super::create_dir(dir)?;
        remove_temporaries([dir.join(file_name(shard))])?;
        // The whole of shards may yet be refused: it is noted with its first item.
        if ledger.others.is_empty() {
            ledger.save()?;
        }
        Ok(ledger)
    }

    /// Takes the work of all other shards of the result, as far as it is noted by now.
    ///
    /// # Errors
    /// If a ledger cannot be read.
    pub fn take_others(&mut self) -> Result<()> {
        self.others.clear();
        for shard in shards(&self.dir)? {
            let other = read_ledger(&self.dir.join(file_name(shard)))?;
            if shard != self.own.shard && other.key == self.own.key {
                self.others.push(other);
            }
        }
        Ok(())
    }

    /// Notes the work of other shards as its own, and that all is done; their ledgers go.
    ///
    /// # Errors
    /// If a ledger cannot be written or removed.
    pub fn absorb_others(&mut self) -> Result<()> {
        let others = std::mem::take(&mut self.others);
        for (name, item) in others.iter().flat_map(|other| &other.items) {
            (self.own.items.entry(name.clone())).or_insert_with(|| item.clone());
        }
        self.complete()?;
        for other in others {
            remove_if_there(&self.dir.join(file_name(other.shard)))?;
        }
        Ok(())
    }

    /// Checks that the shards whose work is taken are all of one division, and complete.
    ///
    /// # Errors
    /// [`SceneError::Work`] with those that are not.
    pub fn check_shards(&self) -> Result<()> {
        let Some(first) = self.others.first() else {
            return Ok(());
        };
        let mut missing = Vec::new();
        for shard in first.shard.siblings() {
            match self.others.iter().find(|other| other.shard == shard) {
                None => missing.push(format!("{} is missing", file_name(shard))),
                Some(other) if !other.complete => {
                    missing.push(format!("{} is not complete", file_name(shard)));
                }
                Some(_) => {}
            }
        }
        let mut others = self.others.iter().map(|other| other.shard);
        if let Some(other) = others.find(|other| other.of != first.shard.of) {
            missing.push(format!("{} is of another division", file_name(other)));
        }
        if missing.is_empty() {
            return Ok(());
        }
        Err(SceneError::Work {
            path: self.dir.clone(),
            problem: format!(
                "{}: --shard makes a part, --force starts over",
                missing.join(", ")
            ),
        })
    }

    /// Removes what a killed process has left of `files`, those of the shard: other
    /// shards, which may be writing in the same folder, have others.
    ///
    /// # Errors
    /// If something cannot be removed.
    pub fn clear_temporaries(&self, files: &[PathBuf]) -> Result<()> {
        remove_temporaries(files.iter().map(|file| self.dir.join(file)))
    }

    fn save(&self) -> Result<()> {
        write_json(&self.dir.join(file_name(self.own.shard)), &self.own)
    }

    /// An item that is noted as done, whatever became of its files.
    pub fn noted(&self, item: &str) -> Option<&Item> {
        let mut ledgers = std::iter::once(&self.own).chain(&self.others);
        ledgers.find_map(|ledger| ledger.items.get(item))
    }

    /// An item that is done and whose files are as they were.
    pub fn done(&self, item: &str) -> Option<&Item> {
        let all = std::iter::once(&self.own).chain(&self.others);
        let mut found = all.filter_map(|ledger| ledger.items.get(item));
        found.find(|item| {
            let mut files = item.files.iter();
            files.all(|(file, digest)| {
                digest::of_file(&self.dir.join(file)).is_ok_and(|found| found == *digest)
            })
        })
    }

    /// Notes that an item is done, which has left `files`.
    ///
    /// # Errors
    /// If one of its files cannot be read, or the ledger not be written.
    pub fn add(&mut self, item: &str, seconds: f64, files: &[PathBuf]) -> Result<()> {
        self.add_with(item, seconds, None, serde_json::Value::Null, files)
    }

    /// The same, with a key of its own, and with data.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn add_with(
        &mut self,
        item: &str,
        seconds: f64,
        key: Option<Key>,
        value: impl Serialize,
        files: &[PathBuf],
    ) -> Result<()> {
        let value = serde_json::to_value(value)
            .map_err(|e| SceneError::invalid(&self.dir, item, e.to_string()))?;
        let digests = files.iter().map(|file| {
            let digest = digest::of_file(&self.dir.join(file))?;
            Ok((file.clone(), digest))
        });
        let done = Item {
            seconds,
            key,
            value,
            files: digests.collect::<Result<_>>()?,
        };
        self.own.items.insert(item.to_owned(), done);
        self.save()
    }

    /// Notes that the shard is done.
    ///
    /// # Errors
    /// If the ledger cannot be written.
    pub fn complete(&mut self) -> Result<()> {
        self.own.complete = true;
        self.save()
    }

    /// Removes all ledgers of the result, which is complete.
    ///
    /// # Errors
    /// If one cannot be removed.
    pub fn close(self) -> Result<()> {
        for ledger in std::iter::once(&self.own).chain(&self.others) {
            remove_if_there(&self.dir.join(file_name(ledger.shard)))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: [Shard; 2] = [Shard { index: 1, of: 2 }, Shard { index: 2, of: 2 }];

    fn key(options: &str) -> Key {
        Key::new().with("options", digest::of_bytes(options.as_bytes()))
    }

    fn open(dir: &Path, options: &str, shard: Shard) -> Result<Ledger> {
        let ledger = Ledger::open(dir, "render", &key(options), shard, "--force starts over")?;
        ledger.check_shards()?;
        Ok(ledger)
    }

    fn part(dir: &Path, shard: Shard, item: &str) -> Ledger {
        let mut ledger = open(dir, "k", shard).unwrap();
        std::fs::write(dir.join(item), item).unwrap();
        ledger.add(item, 1.5, &[item.into()]).unwrap();
        ledger
    }

    fn refused(dir: &Path, options: &str, shard: Shard) -> String {
        open(dir, options, shard).unwrap_err().to_string()
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
        let whole = open(dir, "k", Shard::WHOLE).unwrap();
        assert_eq!(whole.done("b").unwrap().seconds, 1.5);
        assert!(whole.done("c").is_none());
        std::fs::write(dir.join("a"), "changed").unwrap();
        assert!(whole.done("a").is_none() && whole.noted("a").is_some());
        whole.close().unwrap();
        assert!(shards(dir).unwrap().is_empty());
    }

    #[test]
    fn items_have_keys_and_values_of_their_own() {
        let root = tempfile::tempdir().unwrap();
        let mut ledger = open(root.path(), "k", Shard::WHOLE).unwrap();
        let value = (1.5, "two".to_owned());
        ledger
            .add_with("a", 0.0, Some(key("a")), &value, &[])
            .unwrap();
        let again = open(root.path(), "k", Shard::WHOLE).unwrap();
        let item = again.done("a").unwrap();
        assert_eq!(item.key, Some(key("a")));
        assert_eq!(item.value(), Some(value));
        assert_eq!(item.value::<[u32; 7]>(), None);
    }

    #[test]
    fn shards_see_each_other_and_the_whole_absorbs_them() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path();
        let mut first = open(dir, "k", TWO[0]).unwrap();
        part(dir, TWO[1], "b");
        assert!(first.noted("b").is_none());
        first.take_others().unwrap();
        assert!(first.done("b").is_some());
        let mut whole = Ledger::open(dir, "render", &key("k"), Shard::WHOLE, "").unwrap();
        whole.absorb_others().unwrap();
        assert_eq!(shards(dir).unwrap(), [Shard::WHOLE]);
        assert!(open(dir, "k", Shard::WHOLE).unwrap().done("b").is_some());
    }

    #[test]
    fn what_a_killed_process_left_of_its_own_files_goes() {
        let dir = tempfile::tempdir().unwrap();
        let [mine, record, others] = ["a.png", "shard-1-of-2.record.json", "b.png"].map(|file| {
            let path = dir.path().join(format!("{file}.0b9d304f.tmp"));
            std::fs::write(&path, b"half").unwrap();
            path
        });
        let ledger = open(dir.path(), "k", TWO[0]).unwrap();
        ledger.clear_temporaries(&["a.png".into()]).unwrap();
        assert!(!mine.exists() && !record.exists());
        assert!(others.exists());
    }

    #[test]
    fn parts_of_something_else_are_refused_and_cleared_by_their_own_command() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path();
        part(dir, TWO[0], "a");
        let message = refused(dir, "other", TWO[0]);
        assert!(
            message.contains("with other options: --force starts over"),
            "{message}"
        );
        let three = Shard { index: 1, of: 3 };
        assert!(refused(dir, "k", three).contains("another division than --shard 1/3"));
        let message = clear(dir, "paper").unwrap_err().to_string();
        assert!(message.contains("`render`"), "{message}");
        clear(dir, "render").unwrap();
        assert!(!dir.join("a").exists() && shards(dir).unwrap().is_empty());
        std::fs::write(dir.join(file_name(TWO[0])), "{").unwrap();
        assert!(refused(dir, "k", TWO[0]).contains("no part of a result"));
    }
}
