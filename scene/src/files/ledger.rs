//! The ledger of a result under way: which of its items are done, so that a process that was
//! stopped resumes, and several processes can share the work.
//!
//! Work on a list of items, as views, keeps a ledger for each [`Shard`] in the folder of the
//! result, `shard-2-of-3.record.json`. It names the command, the [`Key`] of the result, and for
//! each item that is done its files with their digests. An item whose files are not what they were
//! is not done. The whole, [`Shard::WHOLE`], takes what it finds in the ledgers of shards.

mod file;

#[cfg(test)]
mod tests;

pub use file::{Item, clear, file_name, shards};

use super::key::Key;
use super::{digest, remove_if_there, remove_temporaries, write_json};
use crate::error::{Result, SceneError};
use crate::shard::Shard;
use file::{LedgerFile, read_ledger};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The ledger of a shard, and those of others whose work it takes.
#[derive(Debug)]
pub struct Ledger {
    dir: PathBuf,
    own: LedgerFile,
    others: Vec<LedgerFile>,
}

/// Advice where a result is a folder, `--out`.
pub const ADVICE: &str = "--force (without --shard) starts over, --out names another folder";

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
