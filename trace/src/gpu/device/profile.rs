//! Times of passes, from timestamps that the device writes before and after them.

use super::{Device, lock};
use crate::gpu::error::GpuError;
use std::fmt;
use std::time::{Duration, Instant};

/// Timestamps that are kept: as many as WebGPU allows in one set.
const MAX_TIMESTAMPS: u32 = wgpu::QUERY_SET_MAX_QUERIES;

/// Time of the passes of one kernel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageTime {
    /// Its entry point.
    pub name: &'static str,
    /// Number of its passes.
    pub num_passes: u32,
    /// All of that together, on the device.
    pub seconds: f64,
}

/// Times of the passes of some work.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Kernels in the order of their first passes.
    pub stages: Vec<StageTime>,
    /// Passes beyond the timestamps that are kept.
    pub num_untimed: u32,
    /// All of the work by the clock of the host: kernels, copies, waiting, and what the host does
    /// in between.
    pub elapsed: Duration,
}

impl fmt::Display for Profile {
    /// A table, kernels that took longest first.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let elapsed = self.elapsed.as_secs_f64();
        let share = |seconds: f64| 100.0 * seconds / elapsed.max(f64::MIN_POSITIVE);
        let mut stages = self.stages.clone();
        stages.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        let total: f64 = stages.iter().map(|stage| stage.seconds).sum();
        writeln!(
            f,
            "{:<20} {:>6} {:>10} {:>7}",
            "stage", "passes", "ms", "share"
        )?;
        let mut row = |name: &str, passes: &str, seconds: f64| {
            let (ms, share) = (1e3 * seconds, share(seconds));
            writeln!(f, "{name:<20} {passes:>6} {ms:>10.3} {share:>6.1}%")
        };
        for stage in &stages {
            row(stage.name, &stage.num_passes.to_string(), stage.seconds)?;
        }
        row("host, copies, waits", "", (elapsed - total).max(0.0))?;
        row("in all", "", elapsed)?;
        if self.num_untimed > 0 {
            let num = self.num_untimed;
            writeln!(f, "of which {num} passes that were not timed")?;
        }
        Ok(())
    }
}

/// Timestamps that are being written.
#[derive(Debug)]
pub(super) struct Recording {
    queries: wgpu::QuerySet,
    /// Kernel of each pair of timestamps.
    names: Vec<&'static str>,
    num_untimed: u32,
}

impl Recording {
    /// Timestamps of the next pass, of kernel `name`; `None` where there are no more.
    pub(super) fn time(
        &mut self,
        name: &'static str,
    ) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let first = 2 * self.names.len() as u32;
        if first + 2 > MAX_TIMESTAMPS {
            self.num_untimed += 1;
            return None;
        }
        self.names.push(name);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }
}

impl Device {
    /// Times the passes that `work` hands to the device, whichever thread does; `None` where the
    /// device has no timestamps. Work takes longer than it would: every pass waits for the one
    /// before it anyway, but each writes two timestamps.
    ///
    /// # Errors
    /// If the device fails.
    pub fn profile<T>(&self, work: impl FnOnce() -> T) -> Result<(T, Option<Profile>), GpuError> {
        if !self.adapter.has_timestamps {
            return Ok((work(), None));
        }
        let queries = self.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("timestamps"),
            ty: wgpu::QueryType::Timestamp,
            count: MAX_TIMESTAMPS,
        });
        *lock(&self.recording) = Some(Recording {
            queries,
            names: Vec::new(),
            num_untimed: 0,
        });
        let started = Instant::now();
        let done = work();
        let waited = self.wait();
        let elapsed = started.elapsed();
        let recording = lock(&self.recording).take();
        waited?;
        let Some(recording) = recording else {
            return Ok((done, None));
        };
        let stages = self.stages(&recording)?;
        let profile = Profile {
            stages,
            num_untimed: recording.num_untimed,
            elapsed,
        };
        Ok((done, Some(profile)))
    }

    fn stages(&self, recording: &Recording) -> Result<Vec<StageTime>, GpuError> {
        let num = 2 * recording.names.len();
        if num == 0 {
            return Ok(Vec::new());
        }
        let resolved = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: 8 * num as u64,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut commands = self.commands();
        commands.resolve_query_set(&recording.queries, 0..num as u32, &resolved, 0);
        self.submit(commands)?;
        let ticks: Vec<u64> = self.read(&resolved, 0..num)?;
        let (pairs, _) = ticks.as_chunks();
        let seconds_per_tick = 1e-9 * f64::from(self.queue.get_timestamp_period());
        let mut stages: Vec<StageTime> = Vec::new();
        for (&name, &[begin, end]) in recording.names.iter().zip(pairs) {
            // Clocks of some devices step back when they are reset.
            let seconds = end.saturating_sub(begin) as f64 * seconds_per_tick;
            match stages.iter_mut().find(|stage| stage.name == name) {
                Some(stage) => {
                    stage.num_passes += 1;
                    stage.seconds += seconds;
                }
                None => stages.push(StageTime {
                    name,
                    num_passes: 1,
                    seconds,
                }),
            }
        }
        Ok(stages)
    }

    /// Bytes of the device's memory that buffers take now, by the allocator of wgpu; `None` where
    /// the backend does not tell.
    pub fn memory_bytes(&self) -> Option<u64> {
        let report = self.device.generate_allocator_report()?;
        Some(report.total_allocated_bytes)
    }
}
