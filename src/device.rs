//! `--device`: what computes, chosen in one place for all commands that can.

use crate::progress::Reporter;
use anyhow::Result;
use clap::Args;
use eagpt_scene::Gaussians;
use eagpt_trace::Tracer;
#[cfg(feature = "gpu")]
use eagpt_trace::gpu::{self, DeviceSelector, Kind};
use eagpt_train::backend::TrainDevice;
use serde::{Serialize, Serializer};
use std::fmt;
#[cfg(feature = "gpu")]
use std::path::Path;
use std::str::FromStr;

/// The option of commands that compute.
#[derive(Debug, Clone, Args, Serialize)]
pub(crate) struct DeviceArgs {
    /// What computes: auto, cpu, gpu, gpu:INDEX or gpu:NAME
    ///
    /// auto: the first GPU that is there, else the CPU. gpu: a GPU, or an error; where there is
    /// none, a program that stands in for one (llvmpipe) if it is installed. gpu:INDEX: by its
    /// place in the list of `eagpt doctor`, from 0. gpu:NAME: the first whose name contains NAME,
    /// in any case.
    #[arg(long, value_name = "DEVICE", default_value_t = DeviceChoice::Auto)]
    pub(crate) device: DeviceChoice,
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum DeviceChoice {
    /// A GPU that is hardware, else the CPU.
    Auto,
    /// The CPU.
    Cpu,
    /// A GPU, hardware where there is some.
    Gpu,
    /// The GPU at a place of the list.
    Index(usize),
    /// The first GPU whose name contains this.
    Name(String),
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => return Ok(Self::Auto),
            "cpu" => return Ok(Self::Cpu),
            "gpu" => return Ok(Self::Gpu),
            _ => {}
        }
        match text.strip_prefix("gpu:") {
            None | Some("") => Err("not one of auto, cpu, gpu, gpu:INDEX and gpu:NAME".to_owned()),
            Some(which) => Ok(which
                .parse()
                .map_or_else(|_| Self::Name(which.to_owned()), Self::Index)),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu => f.write_str("gpu"),
            Self::Index(index) => write!(f, "gpu:{index}"),
            Self::Name(name) => write!(f, "gpu:{name}"),
        }
    }
}

impl Serialize for DeviceChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// What computes.
#[derive(Debug, Clone)]
pub(crate) enum Engine {
    /// All threads.
    Cpu,
    /// A device, open.
    #[cfg(feature = "gpu")]
    Gpu(std::sync::Arc<gpu::Device>),
}

impl DeviceChoice {
    /// Opens what is asked for, and says so where it is not the CPU.
    ///
    /// # Errors
    /// If there is no such device, or its driver refuses.
    #[cfg(feature = "gpu")]
    pub(crate) fn open(&self, reporter: &mut Reporter) -> Result<Engine> {
        let device = match self {
            Self::Cpu => return Ok(Engine::Cpu),
            Self::Auto if !may_have_hardware() => return Ok(Engine::Cpu),
            Self::Auto => match gpu::Device::open(&DeviceSelector::Hardware) {
                Ok(device) => device,
                Err(gpu::GpuError::NotFound { .. }) => return Ok(Engine::Cpu),
                Err(error) => {
                    reporter.warning(&format!("{error}; the CPU computes instead"));
                    return Ok(Engine::Cpu);
                }
            },
            Self::Gpu => match gpu::Device::open(&DeviceSelector::Hardware) {
                Err(gpu::GpuError::NotFound { .. }) => gpu::Device::open(&DeviceSelector::Any)?,
                opened => opened?,
            },
            Self::Index(index) => gpu::Device::open(&DeviceSelector::Index(*index))?,
            Self::Name(name) => gpu::Device::open(&DeviceSelector::Name(name.clone()))?,
        };
        let adapter = device.adapter();
        reporter.note(&match adapter.kind {
            Kind::Software => format!(
                "computing with {}, a program that stands in for a GPU: --device cpu is faster",
                adapter.name
            ),
            _ => format!("computing with {}", adapter.name),
        });
        Ok(Engine::Gpu(device))
    }

    /// The CPU: the program knows no other.
    ///
    /// # Errors
    /// If something else is asked for.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn open(&self, _: &mut Reporter) -> Result<Engine> {
        match self {
            Self::Auto | Self::Cpu => Ok(Engine::Cpu),
            Self::Gpu | Self::Index(_) | Self::Name(_) => {
                anyhow::bail!("--device {self}: this program was built without the feature gpu")
            }
        }
    }
}

/// Whether the system could have a GPU: where it cannot, drivers need not be woken, some of which
/// complain of a missing display. On Linux each has a node of the kernel: of DRM, NVIDIA, Adreno,
/// Mali or, under Windows, DirectX.
#[cfg(feature = "gpu")]
fn may_have_hardware() -> bool {
    let nodes = ["dri", "nvidiactl", "kgsl-3d0", "mali0", "dxg"];
    !cfg!(target_os = "linux")
        || nodes
            .iter()
            .any(|node| Path::new("/dev").join(node).exists())
}

impl Engine {
    /// For training and baking.
    pub(crate) fn for_training(&self) -> TrainDevice {
        match self {
            Self::Cpu => TrainDevice::Cpu,
            #[cfg(feature = "gpu")]
            Self::Gpu(device) => TrainDevice::Gpu(std::sync::Arc::clone(device)),
        }
    }

    /// A scene to be rendered.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub(crate) fn tracer(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>> {
        Ok(self.for_training().tracer(gaussians)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_told_as_they_are_asked_for() {
        for text in [
            "auto",
            "cpu",
            "gpu",
            "gpu:1",
            "gpu:llvmpipe",
            "gpu:RTX 4090",
        ] {
            assert_eq!(text.parse::<DeviceChoice>().unwrap().to_string(), text);
        }
        assert_eq!("gpu:0".parse(), Ok(DeviceChoice::Index(0)));
        assert_eq!("gpu:4a".parse(), Ok(DeviceChoice::Name("4a".to_owned())));
        for wrong in ["", "cuda", "gpu:", "GPU", "cpu:0"] {
            assert!(wrong.parse::<DeviceChoice>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_processor_needs_no_driver() {
        assert!(matches!(Engine::Cpu.for_training(), TrainDevice::Cpu));
    }
}
