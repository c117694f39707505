//! What was made from what: digests of inputs and products, kept in the folder of results.

use super::plan::Plan;
use super::project::Project;
use super::step::PlanStep;
use anyhow::{Context, Result, bail};
use eagpt_report::run::{PROJECT_FILE, RUN_FILE, RunRecord, StepRecord, read_json};
use eagpt_scene::files;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, UNIX_EPOCH};

/// File that a run holds a lock on.
const LOCK_FILE: &str = ".lock";
/// Pause between looks at a lock.
const LOCK_PAUSE: Duration = Duration::from_millis(100);
/// Digests of files by path, size and time of change, so that nothing is read twice.
const DIGESTS_FILE: &str = ".digests.json";

/// How long a lock is waited for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Patience {
    /// As long as the system takes to clear away a run that was killed.
    Short,
    /// As long as others may take to note what they do.
    Long,
}

impl Patience {
    fn duration(self) -> Duration {
        match self {
            Self::Short => Duration::from_secs(2),
            Self::Long => Duration::from_secs(600),
        }
    }
}

/// The folder of a run.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) dir: PathBuf,
    pub(super) record: RunRecord,
    digests: Digests,
    /// Held as long as this lives; `None` for who only looks.
    _lock: Option<File>,
}

impl Folder {
    /// Opens or creates a run's folder and keeps others out.
    ///
    /// # Errors
    /// If another process has it, or it cannot be read or written.
    pub(super) fn open(dir: &Path, patience: Patience) -> Result<Self> {
        files::create_dir(dir)?;
        let path = dir.join(LOCK_FILE);
        let lock = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .with_context(|| format!("{}: open", path.display()))?;
        let asked = Instant::now();
        loop {
            match lock.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if asked.elapsed() < patience.duration() => {
                    std::thread::sleep(LOCK_PAUSE);
                }
                Err(TryLockError::WouldBlock) => {
                    bail!("{}: another run is at work in this folder", dir.display());
                }
                Err(TryLockError::Error(error)) => {
                    return Err(error).with_context(|| format!("{}: lock", path.display()));
                }
            }
        }
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
        self.digests.files.extend(other.digests.files);
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

    /// Whether a finished step's products are still what they were.
    pub(super) fn is_intact(&mut self, step: &PlanStep, record: &StepRecord) -> bool {
        self.products(step)
            .is_ok_and(|products| products == record.products)
    }
}

/// Digests of files that were read once, trusted as long as size and time of change stay.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Digests {
    files: BTreeMap<PathBuf, KnownFile>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct KnownFile {
    num_bytes: u64,
    changed_ns: u128,
    blake3: String,
}

impl Digests {
    /// Digest of a file, or of all files of a folder with their names. Records are left out: they
    /// hold times.
    fn of(&mut self, path: &Path) -> Result<String> {
        if !path.is_dir() {
            return self.of_file(path);
        }
        let mut hasher = blake3::Hasher::new();
        let mut all = Vec::new();
        collect(path, &mut all).with_context(|| format!("{}: read folder", path.display()))?;
        all.sort();
        for file in all {
            let name = file.strip_prefix(path).unwrap_or(&file);
            hasher.update(format!("{}\0{}\0", name.display(), self.of_file(&file)?).as_bytes());
        }
        Ok(hasher.finalize().to_hex().to_string())
    }

    fn of_file(&mut self, path: &Path) -> Result<String> {
        let context = || format!("{}: read", path.display());
        let metadata = std::fs::metadata(path).with_context(context)?;
        let changed = metadata.modified().with_context(context)?;
        let since = changed.duration_since(UNIX_EPOCH).unwrap_or_default();
        let (num_bytes, changed_ns) = (metadata.len(), since.as_nanos());
        if let Some(known) = self.files.get(path)
            && (known.num_bytes, known.changed_ns) == (num_bytes, changed_ns)
        {
            return Ok(known.blake3.clone());
        }
        let blake3 = crate::record::Input::of(path)?.blake3;
        let known = KnownFile {
            num_bytes,
            changed_ns,
            blake3: blake3.clone(),
        };
        self.files.insert(path.to_owned(), known);
        Ok(blake3)
    }
}

fn collect(dir: &Path, all: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(dir)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() {
            collect(&path, all)?;
        } else if !name.ends_with("record.json") && !name.starts_with('.') {
            all.push(path);
        }
    }
    Ok(())
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(files::write_bytes_atomic(path, text.as_bytes())?)
}
