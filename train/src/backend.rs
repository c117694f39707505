//! One training step on a device.
//!
//! The training loop decides on the next step; a [`Backend`] owns everything that changes at every
//! step — parameters, moments, prepared images — for the whole run, and returns scalars. The full
//! state is read back only for checkpoints.

mod cpu;
#[cfg(feature = "gpu")]
mod gpu;
mod irradiance;
mod irradiance_cache;
mod step;
mod trainer;

use crate::error::Result;
use crate::params::ParameterState;
use cpu::CpuBackend;
use eagpt_trace::Device;
#[cfg(feature = "gpu")]
use gpu::GpuBackend;

pub use step::{AlbedoStep, Backend, RadianceStep, Taken, TrainingView};

/// A backend on `device` that starts from `state`; prepared images may take `target_budget` bytes.
///
/// # Errors
/// If the device fails or has not enough memory.
pub fn new(
    device: &Device,
    state: ParameterState,
    target_budget: usize,
) -> Result<Box<dyn Backend>> {
    Ok(match device {
        Device::Cpu => Box::new(CpuBackend::new(state, target_budget)),
        #[cfg(feature = "gpu")]
        Device::Gpu(device) => Box::new(GpuBackend::new(device, state, target_budget)?),
    })
}
