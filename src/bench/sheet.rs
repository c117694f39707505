//! Measuring: the same work repeated for a while, and the figures of its runs.

use crate::record;
use anyhow::Result;
use eagpt_trace::Device;
use serde::{Deserialize, Serialize};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Fewest runs of a measurement: a spread needs three.
const MIN_RUNS: usize = 3;
/// Most runs of a measurement.
const MAX_RUNS: usize = 10_000;

/// Quantity that a figure counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Unit {
    #[serde(rename = "rays/s")]
    Rays,
    #[serde(rename = "paths/s")]
    Paths,
    #[serde(rename = "it/s")]
    Iterations,
    #[serde(rename = "pixels/s")]
    Pixels,
    #[serde(rename = "B/s")]
    Bytes,
    #[serde(rename = "s")]
    Seconds,
}

impl Unit {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays/s",
            Self::Paths => "paths/s",
            Self::Iterations => "it/s",
            Self::Pixels => "pixels/s",
            Self::Bytes => "B/s",
            Self::Seconds => "s",
        }
    }

    /// Factor by which `new` is better than `old`: above 1 if it is.
    pub(super) fn ratio(self, old: f64, new: f64) -> f64 {
        if self == Self::Seconds {
            old / new
        } else {
            new / old
        }
    }
}

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Row {
    /// Name of the stage.
    pub(super) stage: String,
    /// Case of the stage.
    pub(super) what: String,
    /// Gaussians of the scene, where it has a part in it.
    pub(super) gaussians: Option<usize>,
    /// Threads of the CPU.
    pub(super) threads: usize,
    /// Quantity that the figures count.
    pub(super) unit: Unit,
    /// Median of the runs.
    pub(super) median: f64,
    /// Smallest figure.
    pub(super) min: f64,
    /// Largest figure.
    pub(super) max: f64,
    /// Number of runs.
    pub(super) runs: usize,
    /// Largest resident memory of the process during the runs, MiB; null where the system does not
    /// tell.
    pub(super) peak_memory_mib: Option<f64>,
    /// Memory allocated on the GPU after the runs, MiB; null on the CPU.
    #[serde(default)]
    pub(super) device_memory_mib: Option<f64>,
}

impl Row {
    /// True if `other` measures the same.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        self.is_of(other) && self.threads == other.threads
    }

    /// The same, whatever the number of threads.
    pub(super) fn is_of(&self, other: &Self) -> bool {
        (&self.stage, &self.what, self.gaussians, self.unit)
            == (&other.stage, &other.what, other.gaussians, other.unit)
    }
}

/// The rows of a stage under way.
pub(super) struct Sheet<'a> {
    pub(super) rows: &'a mut Vec<Row>,
    pub(super) device: &'a Device,
    pub(super) stage: String,
    pub(super) gaussians: Option<usize>,
    pub(super) threads: usize,
    /// Time of a measurement, once the fewest runs are done.
    pub(super) budget: Duration,
}

impl Sheet<'_> {
    /// Measures `run`, which does `work` of what `unit` counts (1 for seconds). The first run is
    /// not counted: memory is touched and files are cached in it.
    ///
    /// # Errors
    /// The first of `run`.
    pub(super) fn measure<T>(
        &mut self,
        what: &str,
        unit: Unit,
        work: f64,
        mut run: impl FnMut() -> Result<T>,
    ) -> Result<()> {
        self.measure_counted(what, unit, || {
            black_box(run()?);
            Ok(work)
        })
    }

    /// As [`Self::measure`] for runs that say only afterwards how much they did.
    ///
    /// # Errors
    /// The first of `run`.
    pub(super) fn measure_counted(
        &mut self,
        what: &str,
        unit: Unit,
        mut run: impl FnMut() -> Result<f64>,
    ) -> Result<()> {
        run()?;
        record::forget_peak_memory();
        let begun = Instant::now();
        let mut figures = Vec::new();
        while figures.len() < MIN_RUNS
            || (begun.elapsed() < self.budget && figures.len() < MAX_RUNS)
        {
            let started = Instant::now();
            let work = run()?;
            let seconds = started.elapsed().as_secs_f64().max(1e-9);
            figures.push(if unit == Unit::Seconds {
                seconds
            } else {
                work / seconds
            });
        }
        self.record(what, unit, figures);
        Ok(())
    }

    /// Measures each kernel of `run` by timestamps, where the engine is a GPU that has them.
    ///
    /// # Errors
    /// The first of `run`, or of the device.
    #[cfg(feature = "gpu")]
    pub(super) fn measure_kernels(
        &mut self,
        what: &str,
        mut run: impl FnMut() -> Result<()>,
    ) -> Result<()> {
        let Device::Gpu(device) = self.device else {
            return Ok(());
        };
        let mut kernels: Vec<(&str, Vec<f64>)> = Vec::new();
        for _ in 0..MIN_RUNS {
            let (done, profile) = device.profile(&mut run)?;
            done?;
            for stage in profile.into_iter().flat_map(|profile| profile.stages) {
                let seconds = stage.seconds.max(1e-9);
                match kernels.iter_mut().find(|(name, _)| *name == stage.name) {
                    Some((_, figures)) => figures.push(seconds),
                    None => kernels.push((stage.name, vec![seconds])),
                }
            }
        }
        for (name, figures) in kernels {
            self.record(&format!("{what}: {name}"), Unit::Seconds, figures);
        }
        Ok(())
    }

    /// Kernels are those of a GPU.
    ///
    /// # Errors
    /// None.
    #[cfg(not(feature = "gpu"))]
    pub(super) fn measure_kernels(&mut self, _: &str, _: impl FnMut() -> Result<()>) -> Result<()> {
        Ok(())
    }

    /// Adds the row of the `figures` of some runs, at least one.
    fn record(&mut self, what: &str, unit: Unit, mut figures: Vec<f64>) {
        figures.sort_by(f64::total_cmp);
        let last = figures.len() - 1;
        self.rows.push(Row {
            stage: self.stage.clone(),
            what: what.to_owned(),
            gaussians: self.gaussians,
            threads: self.threads,
            unit,
            median: 0.5 * (figures[last / 2] + figures[last.div_ceil(2)]),
            min: figures[0],
            max: figures[last],
            runs: figures.len(),
            peak_memory_mib: record::peak_memory_mib(),
            device_memory_mib: device_memory_mib(self.device),
        });
    }
}

/// Memory allocated on a GPU, MiB, where its backend tells.
fn device_memory_mib(device: &Device) -> Option<f64> {
    match device {
        Device::Cpu => None,
        #[cfg(feature = "gpu")]
        Device::Gpu(gpu) => {
            let bytes = gpu.memory_bytes()?;
            Some(bytes as f64 / f64::from(1 << 20))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_counted_and_figures_are_in_order() {
        let mut rows = Vec::new();
        let mut sheet = Sheet {
            rows: &mut rows,
            device: &Device::Cpu,
            stage: "files".to_owned(),
            gaussians: None,
            threads: 1,
            budget: Duration::ZERO,
        };
        let mut num = 0;
        let count = || {
            num += 1;
            Ok(())
        };
        sheet
            .measure("count", Unit::Iterations, 2.0, count)
            .unwrap();
        let row = &rows[0];
        // One run to warm up.
        assert_eq!((num, row.runs), (4, 3));
        assert!(0.0 < row.min && row.min <= row.median && row.median <= row.max);
    }

    #[test]
    fn fewer_seconds_and_more_rays_are_better() {
        assert_eq!(Unit::Seconds.ratio(2.0, 1.0), 2.0);
        assert_eq!(Unit::Rays.ratio(2.0, 1.0), 0.5);
    }
}
