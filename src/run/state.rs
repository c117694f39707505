//! The folder of a run: its record, with digests of the inputs and products of each step.

use super::plan::Plan;
use super::project::Project;
use super::step::PlanStep;
use anyhow::{Context, Result};
use eagpt_report::run::{PROJECT_FILE, RUN_FILE, RunRecord, StepRecord, read_json};
use eagpt_scene::files::digest::Digests;
use eagpt_scene::files::{self, FolderLock};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Digests of files by path, size and time of change, so that nothing is read twice.
const DIGESTS_FILE: &str = ".digests.json";

/// Time to wait for a lock that a run has which was killed: as long as systems take to clear it
/// away.
pub(super) const SHORT_WAIT: Duration = Duration::from_secs(2);
/// Time to wait for the lock of others who note what they do.
pub(super) const LONG_WAIT: Duration = Duration::from_mins(10);

/// The folder of a run.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) dir: PathBuf,
    pub(super) record: RunRecord,
    digests: Digests,
    /// Held as long as this lives; `None` for who only looks.
    _lock: Option<FolderLock>,
}

impl Folder {
    /// Opens or creates a run's folder and keeps others out.
    ///
    /// # Errors
    /// If another process has it, or it cannot be read or written.
    pub(super) fn open(dir: &Path, wait: Duration) -> Result<Self> {
        let lock = FolderLock::acquire(dir, wait)?;
        Ok(Self {
            _lock: Some(lock),
            ..Self::look_at(dir)?
        })
    }

    /// Reads what is known of a run, without a claim to it.
    ///
    /// # Errors
    /// If its files cannot be read.
    pub(super) fn look_at(dir: &Path) -> Result<Self> {
        let record = RunRecord::read(dir)?;
        let digests = read_json::<Digests>(&dir.join(DIGESTS_FILE))?;
        Ok(Self {
            dir: dir.to_owned(),
            record: record.unwrap_or_default(),
            digests: digests.unwrap_or_default(),
            _lock: None,
        })
    }

    /// Takes over the digests that another look at the same folder has made.
    pub(super) fn learn(&mut self, other: Self) {
        self.digests.extend(other.digests);
    }

    /// Copies the project beside the results.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn keep_project(&mut self, project: &Project) -> Result<()> {
        let path = self.dir.join(PROJECT_FILE);
        files::write_bytes_atomic(&path, project.text().as_bytes())?;
        self.record.version = env!("CARGO_PKG_VERSION").to_owned();
        self.record.project = std::path::absolute(project.path())
            .with_context(|| format!("{}", project.path().display()))?;
        self.save()
    }

    /// Writes what is known.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn save(&self) -> Result<()> {
        write_json(&self.dir.join(RUN_FILE), &self.record)?;
        write_json(&self.dir.join(DIGESTS_FILE), &self.digests)
    }

    /// Digest of everything that decides what a step makes: version, command, what it reads, and
    /// the products that it takes.
    ///
    /// # Errors
    /// If a file that it reads is not there.
    pub(super) fn key(&mut self, plan: &Plan, step: &PlanStep) -> Result<String> {
        let mut hasher = blake3::Hasher::new();
        let mut add = |text: &str| {
            hasher.update(text.as_bytes());
            hasher.update(b"\0");
        };
        add(env!("CARGO_PKG_VERSION"));
        // From where the program is called, and where the run lies, changes no result.
        let out = plan.out.display().to_string();
        for word in step.words()? {
            let word = word.replace(&out, "$OUT");
            let from_project = Path::new(&word).strip_prefix(&plan.here);
            add(&from_project.map_or(word.clone(), |path| path.display().to_string()));
        }
        for path in &step.reads {
            add(&self.digests.of(path)?);
        }
        for earlier in step.after.iter().map(|&index| &plan.steps[index]) {
            let record = self.record.steps.get(&earlier.name);
            for (path, digest) in record.into_iter().flat_map(|record| &record.products) {
                add(&path.display().to_string());
                add(digest);
            }
        }
        Ok(hasher.finalize().to_hex().to_string())
    }

    /// Digests of the products of a step, by their names relative to the run.
    ///
    /// # Errors
    /// If one of them is not there.
    pub(super) fn products(&mut self, step: &PlanStep) -> Result<BTreeMap<PathBuf, String>> {
        let mut products = BTreeMap::new();
        for path in &step.products {
            let name = path.strip_prefix(&self.dir).unwrap_or(path);
            products.insert(name.to_owned(), self.digests.of(path)?);
        }
        Ok(products)
    }

    /// True if a finished step's products are still what they were.
    pub(super) fn is_intact(&mut self, step: &PlanStep, record: &StepRecord) -> bool {
        self.products(step)
            .is_ok_and(|products| products == record.products)
    }
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(files::write_bytes_atomic(path, text.as_bytes())?)
}
