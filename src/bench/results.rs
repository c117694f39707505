//! Results files of `eagpt bench`, and how results compare with earlier ones.

use super::sheet::Row;
use super::stage::Stage;
use anyhow::{Result, bail};
use eagpt_scene::{SceneError, files, machine};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Total memories nearer than this, relatively, are one: the kernel keeps a little that changes
/// with its version.
const MEMORY_TOLERANCE: f64 = 0.02;

/// The machine that figures come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Machine {
    /// Name of the processor.
    pub(super) processor: Option<String>,
    /// Threads that it runs at once.
    pub(super) cores: usize,
    /// Memory, MiB.
    pub(super) memory_mib: Option<u64>,
    /// Vector instructions that are used.
    pub(super) vector_instructions: Vec<String>,
    /// Operating system and architecture.
    pub(super) system: String,
}

impl Machine {
    /// This one.
    pub(super) fn here() -> Self {
        let vectors = machine::vector_instructions().into_iter();
        Self {
            processor: machine::processor(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_mib: machine::total_memory().map(|bytes| bytes >> 20),
            vector_instructions: vectors.map(str::to_owned).collect(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }

    /// One line for people.
    pub(super) fn line(&self) -> String {
        let name = self.processor.as_deref().unwrap_or("unknown processor");
        let memory = self.memory_mib.map_or(String::new(), |mib| {
            format!(", {:.0} GiB", mib as f64 / 1024.0)
        });
        format!("{name}, {} cores{memory}, {}", self.cores, self.system)
    }

    /// Names of the fields in which `other` differs; none if it is the same machine.
    pub(super) fn differences(&self, other: &Self) -> Vec<&'static str> {
        let memory = match (self.memory_mib, other.memory_mib) {
            (Some(a), Some(b)) => a.abs_diff(b) as f64 > MEMORY_TOLERANCE * a as f64,
            (a, b) => a != b,
        };
        let differs = [
            ("processor", self.processor != other.processor),
            ("cores", self.cores != other.cores),
            ("memory", memory),
            (
                "vector_instructions",
                self.vector_instructions != other.vector_instructions,
            ),
            ("system", self.system != other.system),
        ];
        differs
            .iter()
            .filter(|(_, is)| *is)
            .map(|(name, _)| *name)
            .collect()
    }
}

/// Options that decide the figures, beside program and machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Measured {
    /// Compute device.
    #[serde(default = "cpu")]
    pub(super) device: String,
    /// The dataset, or the name of the embedded room.
    pub(super) dataset: String,
    /// The scene; null: what training would start from.
    pub(super) scene: Option<String>,
    /// Size of the views, pixels.
    pub(super) view: [u32; 2],
    /// Size of the image of metrics and files, pixels.
    pub(super) image: [u32; 2],
    /// Samples for each pixel of path-traced frames.
    #[serde(default = "one")]
    pub(super) num_samples: u32,
    /// Stages that were measured.
    pub(super) stages: Vec<Stage>,
    /// Seconds for each figure.
    pub(super) seconds: f64,
}

/// Device of results that do not name one: GPUs were not measured then.
fn cpu() -> String {
    "cpu".to_owned()
}

/// Number of samples of results that do not say it.
fn one() -> u32 {
    1
}

/// The content of a results file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Results {
    /// Name of the program.
    pub(super) program: String,
    /// Its version.
    pub(super) version: String,
    /// Commit that it was built from, where the build said so.
    pub(super) commit: Option<String>,
    /// The machine.
    pub(super) machine: Machine,
    /// Options of the measurement.
    pub(super) options: Measured,
    /// The figures.
    pub(super) rows: Vec<Row>,
}

impl Results {
    /// Nothing yet, of this program on this machine.
    pub(super) fn begin(options: Measured) -> Self {
        Self {
            program: env!("CARGO_PKG_NAME").to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: option_env!("EAGPT_COMMIT").map(str::to_owned),
            machine: Machine::here(),
            options,
            rows: Vec::new(),
        }
    }

    /// Reads a results file.
    ///
    /// # Errors
    /// If it cannot be read or is none.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let results: Self = serde_json::from_slice(&bytes).map_err(|error| {
            SceneError::invalid(
                path,
                "content",
                format!("no results of this command: {error}"),
            )
        })?;
        if results
            .rows
            .iter()
            .any(|row| !(row.median > 0.0 && row.median.is_finite()))
        {
            bail!("{}: rows: a median is not above 0", path.display());
        }
        Ok(results)
    }

    /// Version and commit, for people.
    pub(super) fn built(&self) -> String {
        match &self.commit {
            Some(commit) => format!("{} ({commit})", self.version),
            None => self.version.clone(),
        }
    }
}

/// Comparison of a figure with that of the baseline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Verdict {
    /// All runs were better than all of the baseline.
    Faster,
    /// All runs were worse.
    Slower,
    /// The runs of both overlap.
    Same,
    /// The baseline has no such figure.
    New,
}

/// A figure and that of the baseline.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Change<'a> {
    #[serde(flatten)]
    pub(super) row: &'a Row,
    /// Median of the baseline.
    pub(super) before: Option<f64>,
    /// Factor by which it is better: 2 is twice as fast.
    pub(super) ratio: Option<f64>,
    /// Comparison beyond the spread of the runs.
    pub(super) verdict: Verdict,
}

impl<'a> Change<'a> {
    /// A figure and that of a baseline, if there is one.
    pub(super) fn of(row: &'a Row, baseline: Option<&Results>) -> Self {
        let mut rows = baseline.iter().flat_map(|baseline| &baseline.rows);
        let Some(old) = rows.find(|old| old.is_as(row)) else {
            return Self {
                row,
                before: None,
                ratio: None,
                verdict: Verdict::New,
            };
        };
        let ratio = row.unit.ratio(old.median, row.median);
        let overlap = row.min <= old.max && old.min <= row.max;
        Self {
            row,
            before: Some(old.median),
            ratio: Some(ratio),
            verdict: match (overlap, ratio > 1.0) {
                (true, _) => Verdict::Same,
                (false, true) => Verdict::Faster,
                (false, false) => Verdict::Slower,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Unit;
    use super::*;

    fn results(median: f64, spread: f64, unit: Unit) -> Results {
        let mut results = Results::begin(Measured {
            device: cpu(),
            dataset: "room".to_owned(),
            scene: None,
            view: [48, 32],
            image: [64, 48],
            num_samples: 1,
            stages: vec![Stage::Ply],
            seconds: 1.0,
        });
        results.rows.push(Row {
            stage: "ply".to_owned(),
            what: "read".to_owned(),
            gaussians: Some(10),
            threads: 1,
            unit,
            median,
            min: median - spread,
            max: median + spread,
            runs: 3,
            peak_memory_mib: None,
            device_memory_mib: None,
        });
        results
    }

    #[test]
    fn what_lies_within_the_spread_is_no_change() {
        let old = results(10.0, 2.0, Unit::Rays);
        let verdict = |median, unit| {
            let new = results(median, 1.0, unit);
            Change::of(&new.rows[0], Some(&old)).verdict
        };
        assert_eq!(verdict(12.5, Unit::Rays), Verdict::Same);
        assert_eq!(verdict(13.5, Unit::Rays), Verdict::Faster);
        assert_eq!(verdict(6.5, Unit::Rays), Verdict::Slower);
        // Another unit is another figure.
        assert_eq!(verdict(13.5, Unit::Bytes), Verdict::New);
        let old = results(10.0, 2.0, Unit::Seconds);
        let new = results(5.0, 1.0, Unit::Seconds);
        let change = Change::of(&new.rows[0], Some(&old));
        assert_eq!((change.verdict, change.ratio), (Verdict::Faster, Some(2.0)));
    }

    #[test]
    fn a_machine_is_itself_and_no_other() {
        let here = Machine::here();
        assert!(here.differences(&here).is_empty());
        let other = Machine {
            processor: Some("another".to_owned()),
            cores: here.cores + 1,
            ..here.clone()
        };
        assert_eq!(here.differences(&other), ["processor", "cores"]);
        let memory_mib = here.memory_mib.map(|mib| mib + mib / 1000);
        let rebooted = Machine {
            memory_mib,
            ..here.clone()
        };
        assert!(here.differences(&rebooted).is_empty());
    }

    #[test]
    fn results_survive_their_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bench.json");
        let results = results(10.0, 2.0, Unit::Bytes);
        std::fs::write(&path, serde_json::to_string(&results).unwrap()).unwrap();
        assert_eq!(Results::read(&path).unwrap(), results);
        std::fs::write(&path, "{}").unwrap();
        let message = Results::read(&path).unwrap_err().to_string();
        assert!(message.contains("bench.json: content"), "{message}");
    }
}
