//! An open device: its memory, its kernels, and its failures.

mod memory;
mod open;
mod profile;
mod work;

use super::adapter::Adapter;
use super::error::{GpuError, one_line};
pub use memory::Reading;
use profile::Recording;
pub use profile::{Profile, StageTime};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
pub use work::{Commands, Pass};

/// File, entry point and defines of a kernel.
type PipelineKey = (&'static str, &'static str, &'static [&'static str]);

/// A device that computes. Cheap to share behind an [`Arc`].
#[derive(Debug)]
pub struct Device {
    adapter: Adapter,
    /// Bytes that one buffer may have and be bound whole.
    max_bytes: u64,
    device: wgpu::Device,
    queue: wgpu::Queue,
    failure: Arc<Mutex<Option<GpuError>>>,
    pipelines: Mutex<HashMap<PipelineKey, wgpu::ComputePipeline>>,
    /// While steps are timed.
    recording: Mutex<Option<Recording>>,
}

impl Device {
    /// The adapter that was opened.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// Bytes that one buffer may have and be bound whole.
    pub(in crate::gpu) fn max_bytes(&self) -> u64 {
        self.max_bytes
    }

    /// The first failure since the device was opened.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        match &*lock(&self.failure) {
            Some(failure) => Err(failure.clone()),
            None => Ok(()),
        }
    }

    fn lost(&self, problem: &str) -> GpuError {
        GpuError::Lost {
            device: self.adapter.name.clone(),
            problem: one_line(problem),
        }
    }
}

/// A lock whose holder panicked guards nothing that could be half-done here.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The first failure is the one that others follow from.
fn note(failure: &Mutex<Option<GpuError>>, error: GpuError) {
    lock(failure).get_or_insert(error);
}
