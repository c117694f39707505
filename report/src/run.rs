//! `run.json`: the steps of a run, with what each was made from.

use crate::error::{ReportError, Result};
use eagpt_scene::files;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// File name of a [`RunRecord`] in the folder of a run.
pub const RUN_FILE: &str = "run.json";
/// Name of the condition that was photographed.
pub const ORIGINAL: &str = "original";

/// Folders of a run.
pub mod folders {
    /// Emission masks, as `eagpt masks` writes them.
    pub const MASKS: &str = "masks";
    /// The training.
    pub const TRAIN: &str = "train";
    /// Edited scenes, one for each relighting.
    pub const EDIT: &str = "edit";
    /// The same with their light.
    pub const BAKE: &str = "bake";
    /// Renderings, a folder for each condition with one for each mode.
    pub const RENDER: &str = "render";
    /// Evaluations, likewise.
    pub const EVAL: &str = "eval";
    /// The table of all evaluations.
    pub const TABLE: &str = "table";
}

/// File name of the copy of the project.
pub const PROJECT_FILE: &str = "project.toml";

/// Record of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Version of the program.
    pub version: String,
    /// The project file, absolute: paths in it are relative to its folder.
    pub project: PathBuf,
    /// Finished and begun steps by name, as `render/original/path`.
    pub steps: BTreeMap<String, StepRecord>,
}

/// A step that was begun.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Its place among the steps of the run, from 0.
    pub index: usize,
    /// Its command, without the name of the program.
    pub command: Vec<String>,
    /// Digest of its command and everything it reads.
    pub key: String,
    /// Whether it came to its end.
    pub done: bool,
    /// Digest of each of its products, relative to the run.
    pub products: BTreeMap<PathBuf, String>,
    /// Wall time of the process that finished it, seconds.
    pub seconds: f64,
    /// Largest resident memory, MiB; null where the system does not tell.
    pub peak_memory_mib: Option<f64>,
}

impl RunRecord {
    /// Reads the record of the run in `dir`; `None` if there is none.
    ///
    /// # Errors
    /// [`ReportError`] naming the file if it cannot be read.
    pub fn read(dir: &Path) -> Result<Option<Self>> {
        read_json(&dir.join(RUN_FILE))
    }

    /// Steps in the order of the run.
    pub fn in_order(&self) -> Vec<(&str, &StepRecord)> {
        let mut steps: Vec<_> = self.steps.iter().map(|(n, s)| (n.as_str(), s)).collect();
        steps.sort_by_key(|(_, step)| step.index);
        steps
    }
}

/// Reads a JSON file; `None` if it is not there.
///
/// # Errors
/// [`ReportError`] naming the file if it is something else.
pub fn read_json<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<Option<T>> {
    if !path.exists() {
        return Ok(None);
    }
    let bytes = files::read(path)?;
    let value = serde_json::from_slice(&bytes);
    value.map(Some).map_err(|e| ReportError::content(path, &e))
}
