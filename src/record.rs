//! The record beside every result: enough to repeat it, and to know what it cost.

use crate::args::GlobalArgs;
use anyhow::Result;
use eagpt_scene::dataset::{Split, SplitRule, Subset};
use eagpt_scene::files::{self, digest};
use eagpt_scene::{Dataset, clock};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// File name of the record in a folder of results.
pub(crate) const FILE_NAME: &str = "record.json";

/// A record. All commands write the same keys; those that mean nothing for a command are null or
/// empty.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// Name of the program.
    pub(crate) program: String,
    /// Its version.
    pub(crate) version: String,
    /// The command.
    pub(crate) command: String,
    /// The command line as it was given.
    pub(crate) arguments: Vec<String>,
    /// Effective options, defaults included.
    pub(crate) options: Value,
    /// Seed of all random numbers.
    pub(crate) seed: Option<u64>,
    /// Compute device.
    pub(crate) device: Option<String>,
    /// Threads of the CPU.
    pub(crate) threads: usize,
    /// Files that the result depends on.
    pub(crate) inputs: Vec<Input>,
    /// How the dataset's views were divided and which were taken.
    pub(crate) split: Option<SplitRecord>,
    /// Notes for readers of the result.
    pub(crate) warnings: Vec<String>,
    /// Measurements of the result by the job, by name.
    #[serde(default)]
    pub(crate) measured: Map<String, Value>,
    /// Whether the job came to its end; a stopped one can be resumed.
    pub(crate) complete: bool,
    /// When the job began, UTC, RFC 3339.
    pub(crate) started: String,
    /// Wall time in seconds: `total`, and each stage or view by its name.
    pub(crate) seconds: Map<String, Value>,
    /// Largest resident memory of the process, MiB; null where the system does not tell.
    pub(crate) peak_memory_mib: Option<f64>,
    /// Files written, relative to the record's folder.
    pub(crate) outputs: Vec<String>,
}

/// A file that a result depends on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Input {
    /// The file as it was named.
    pub(crate) path: PathBuf,
    /// BLAKE3 digest of its content, hexadecimal.
    pub(crate) blake3: String,
}

/// The views of a job.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SplitRecord {
    /// The rule; null if the views were chosen without one.
    pub(crate) rule: Option<SplitRule>,
    /// Training views of the rule.
    pub(crate) num_train: Option<usize>,
    /// Test views of the rule.
    pub(crate) num_test: Option<usize>,
    /// The subset taken; null if the views were named.
    pub(crate) subset: Option<Subset>,
    /// Number of views taken.
    pub(crate) num_views: usize,
}

impl SplitRecord {
    /// Views of `subset` under a rule.
    pub(crate) fn new(split: &Split, subset: Subset) -> Self {
        Self {
            rule: Some(split.rule),
            num_train: Some(split.train.len()),
            num_test: Some(split.test.len()),
            subset: Some(subset),
            num_views: split.indices(subset).len(),
        }
    }
}

impl Input {
    /// Digests a file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn of(path: &Path) -> Result<Self> {
        Ok(Self {
            path: path.to_owned(),
            blake3: digest::of_file(path)?,
        })
    }

    /// Digests the camera file of a dataset.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn of_cameras(dataset: &Dataset) -> Result<Self> {
        Self::of(dataset.transforms())
    }
}

/// A record under way: the clock runs from [`RecordBuilder::begin`].
pub(crate) struct RecordBuilder {
    pub(crate) record: Record,
    started: Instant,
}

impl RecordBuilder {
    /// Starts the record of `command`, which was asked for in `global`, with its effective options.
    ///
    /// # Errors
    /// If the options cannot be put into JSON.
    pub(crate) fn begin(
        command: &str,
        options: &impl Serialize,
        global: &GlobalArgs,
    ) -> Result<Self> {
        let record = Record {
            program: env!("CARGO_PKG_NAME").to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.to_owned(),
            arguments: global.command_line.clone(),
            options: json(options)?,
            threads: rayon::current_num_threads(),
            complete: true,
            started: now_rfc3339(),
            ..Record::default()
        };
        Ok(Self {
            record,
            started: Instant::now(),
        })
    }

    /// Replaces the effective options, where some of them are known only later.
    ///
    /// # Errors
    /// If they cannot be put into JSON.
    pub(crate) fn set_options(&mut self, options: &impl Serialize) -> Result<()> {
        self.record.options = json(options)?;
        Ok(())
    }

    /// Notes what was measured of the result.
    ///
    /// # Errors
    /// If it cannot be put into JSON.
    pub(crate) fn measured(&mut self, name: &str, value: &impl Serialize) -> Result<()> {
        self.record.measured.insert(name.to_owned(), json(value)?);
        Ok(())
    }

    /// Notes the files written, relative to the record's folder.
    pub(crate) fn wrote(&mut self, files: impl IntoIterator<Item = impl AsRef<Path>>) {
        let names = files.into_iter();
        let names = names.map(|file| file.as_ref().to_string_lossy().into_owned());
        self.record.outputs.extend(names);
    }

    /// Notes how long a part took.
    pub(crate) fn took(&mut self, part: &str, seconds: f64) {
        self.record
            .seconds
            .insert(part.to_owned(), rounded(seconds));
    }

    /// Writes the record into `dir` and returns its path; atomic.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write(self, dir: &Path) -> Result<PathBuf> {
        let path = dir.join(FILE_NAME);
        self.write_to(&path)?;
        Ok(path)
    }

    /// Writes the record to `path`, for results that are a file and not a folder; atomic.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write_to(mut self, path: &Path) -> Result<()> {
        self.took("total", self.started.elapsed().as_secs_f64());
        self.record.peak_memory_mib = peak_memory_mib();
        let mut text = serde_json::to_string_pretty(&self.record)?;
        text.push('\n');
        files::write_bytes_atomic(path, text.as_bytes())?;
        Ok(())
    }
}

/// Through text: it holds the shortest form of a float, `to_value` would widen 0.7 to 0.699999988.
fn json(options: &impl Serialize) -> Result<Value> {
    Ok(serde_json::from_str(&serde_json::to_string(options)?)?)
}

/// The time in UTC. A clock set before 1970 tells nothing worth keeping.
fn now_rfc3339() -> String {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    clock::rfc3339_from_unix(since.map_or(0, |since| since.as_secs()))
}

/// Seconds to the millisecond.
fn rounded(seconds: f64) -> Value {
    Value::from((seconds * 1e3).round() / 1e3)
}

/// Lets [`peak_memory_mib`] begin anew, where the system can: what a command needs is its own.
pub(crate) fn forget_peak_memory() {
    if let Err(error) = std::fs::write("/proc/self/clear_refs", "5") {
        tracing::debug!("peak memory counts from the start of the program: {error}");
    }
}

/// Peak resident memory, as the Linux kernel tells.
pub(crate) fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some((kib / 1024.0 * 10.0).round() / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let input = dir.path().join("in");
        std::fs::write(&input, b"abc").unwrap();
        let mut builder = RecordBuilder::begin(
            "render",
            &serde_json::json!({"spp": 4}),
            &GlobalArgs::default(),
        )
        .unwrap();
        builder.record.inputs.push(Input::of(&input).unwrap());
        builder.took("views/a", 0.123_456);
        let expected = builder.record.clone();
        let path = builder.write(dir.path()).unwrap();
        let back: Record = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        assert_eq!(back.options, expected.options);
        assert_eq!(back.seconds["views/a"], 0.123);
        assert!(back.seconds.contains_key("total"));
        // The digest of "abc" in the test vectors of BLAKE3's authors.
        assert_eq!(
            back.inputs[0].blake3,
            "6437b3ac38465133ffb63b75273a8db548c558465d79db03fd359c6cd5bd9d85"
        );
    }
}
