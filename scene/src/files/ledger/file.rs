//! The file of a ledger: its name, its form, and which files of ledgers a folder has.

use crate::error::{Result, SceneError};
use crate::files::key::Key;
use crate::files::{list, read, remove_if_there};
use crate::shard::Shard;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// A ledger as it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct LedgerFile {
    /// The command whose result it is.
    pub(super) command: String,
    pub(super) shard: Shard,
    /// Everything that decides the result; that of a shard is that of the whole.
    pub(super) key: Key,
    /// True once all items of the shard are done.
    pub(super) complete: bool,
    /// Items that are done.
    pub(super) items: BTreeMap<String, Item>,
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
    pub(super) value: serde_json::Value,
    /// BLAKE3 digests of its files, by their names relative to the folder.
    pub(super) files: BTreeMap<PathBuf, String>,
}

impl Item {
    /// Data noted with it; `None` if there are none, or of another form, as after a change of
    /// versions.
    pub fn value<T: DeserializeOwned>(&self) -> Option<T> {
        T::deserialize(&self.value).ok()
    }
}

const SUFFIX: &str = ".record.json";

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

pub(super) fn read_ledger(path: &Path) -> Result<LedgerFile> {
    serde_json::from_slice(&read(path)?).map_err(|_| SceneError::Work {
        path: path.to_owned(),
        problem: "no part of a result".to_owned(),
    })
}
