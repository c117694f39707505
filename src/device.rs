//! `--device`: the compute device, chosen in one place for all commands that have the option.

use crate::progress::Reporter;
use anyhow::Result;
use clap::Args;
#[cfg(feature = "gpu")]
use eagpt_trace::gpu::AdapterKind;
use eagpt_trace::{Device, DeviceSelector};
use serde::Serialize;

/// The option of commands that compute.
#[derive(Debug, Clone, Args, Serialize)]
pub(crate) struct DeviceArgs {
    /// Compute device: auto, cpu, gpu, gpu:INDEX or gpu:NAME
    ///
    /// auto: the first GPU, else the CPU. gpu: a GPU, or an error; where there is none, a software
    /// adapter (llvmpipe) if one is installed. gpu:INDEX: by its place in the list of `eagpt
    /// doctor`, from 0. gpu:NAME: the first whose name contains NAME, in any case.
    #[arg(long, value_name = "DEVICE", default_value_t = DeviceSelector::Auto)]
    pub(crate) device: DeviceSelector,
}

impl DeviceArgs {
    /// Opens the device, and says so where it is not the CPU.
    ///
    /// # Errors
    /// If there is no such device, or its driver refuses.
    pub(crate) fn open(&self, reporter: &mut Reporter) -> Result<Device> {
        let device = match Device::open(&self.device) {
            Err(error) if self.device == DeviceSelector::Auto => {
                reporter.warning(&format!("{error}; the CPU computes instead"));
                Device::Cpu
            }
            opened => opened?,
        };
        match &device {
            Device::Cpu => {}
            #[cfg(feature = "gpu")]
            Device::Gpu(gpu) => {
                let adapter = gpu.adapter();
                reporter.note(&match adapter.kind {
                    AdapterKind::Software => format!(
                        "computing with {}, a software adapter: --device cpu is faster",
                        adapter.name
                    ),
                    _ => format!("computing with {}", adapter.name),
                });
            }
        }
        Ok(device)
    }
}
