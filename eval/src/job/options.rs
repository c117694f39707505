//! Options of evaluations.

use crate::error::{EvalError, Result};
use crate::flip::FlipOptions;
use eagpt_scene::dataset::{SplitRule, Subset};
use serde::Serialize;
use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

/// Renders of one condition, that is, of one lighting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvalOptions {
    /// Folder of renders.
    pub renders: PathBuf,
    /// Dataset with the references: a folder or its `transforms.json`.
    pub dataset: PathBuf,
    /// Dataset with the same views under an earlier light, which tells lit from
    /// shadow (`crate::regions`). `dataset` itself gives no change of light.
    pub before: Option<PathBuf>,
    /// Name of the condition in tables and files; by default that of the dataset's folder.
    pub name: Option<String>,
    /// Output folder; created.
    pub out: PathBuf,
    /// Rule that divides the views of the dataset that was rendered; by default that of the
    /// renders' record.
    pub split: Option<SplitRule>,
    /// The views to evaluate, all of which must have been rendered; by default those that were.
    pub subset: Option<Subset>,
    /// Settings of FLIP.
    pub flip: FlipOptions,
}

impl EvalOptions {
    /// The views that were rendered, compared with default settings.
    pub fn new(renders: &Path, dataset: &Path, out: &Path) -> Self {
        Self {
            renders: renders.to_owned(),
            dataset: dataset.to_owned(),
            before: None,
            name: None,
            out: out.to_owned(),
            split: None,
            subset: None,
            flip: FlipOptions::default(),
        }
    }

    /// Name of the condition: `name`, or that of the dataset's folder.
    pub fn condition(&self) -> String {
        let folder = || {
            // Canonicalised, for the sake of `.` and symbolic links; a missing folder is reported
            // when it is opened.
            let path = self.dataset.canonicalize().ok()?;
            let folder = if path.is_file() {
                path.parent()?
            } else {
                &path
            };
            Some(folder.file_name()?.to_string_lossy().into_owned())
        };
        let name = self.name.clone().or_else(folder);
        name.unwrap_or_else(|| "condition".to_owned())
    }
}

/// Options of [`crate::evaluate`]: one condition of a method, or several.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionsOptions {
    /// The conditions, at least one, of different names. `out` of each is the folder of its own
    /// results; of one alone the folder of all.
    pub conditions: Vec<EvalOptions>,
    /// Folder of the results of all together; created.
    pub out: PathBuf,
}

impl ConditionsOptions {
    /// Puts the results into `out`; those of each of several conditions into a folder of it that is
    /// named after the condition.
    ///
    /// # Errors
    /// [`EvalError::Option`] if two conditions have one name, or a name cannot be a folder's.
    pub fn new(mut conditions: Vec<EvalOptions>, out: &Path) -> Result<Self> {
        let mut seen = HashSet::new();
        if let [alone] = conditions.as_mut_slice() {
            alone.out = out.to_owned();
            return Ok(Self {
                out: alone.out.clone(),
                conditions,
            });
        }
        for condition in &mut conditions {
            let name = condition.condition();
            let mut parts = Path::new(&name).components();
            let expected = match (parts.next(), parts.next()) {
                (Some(Component::Normal(part)), None) if part == name.as_str() => {
                    "another for each condition"
                }
                _ => "a name for a folder",
            };
            if expected == "a name for a folder" || !seen.insert(name.clone()) {
                return Err(EvalError::Option {
                    field: "name",
                    value: name,
                    expected,
                });
            }
            condition.out = out.join(&name);
            condition.name = Some(name);
        }
        Ok(Self {
            conditions,
            out: out.to_owned(),
        })
    }
}
