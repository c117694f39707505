//! Compute devices: which one is asked for, and the one that is open.

use crate::cpu::CpuScene;
#[cfg(feature = "gpu")]
use crate::gpu;
use crate::tracer::{TraceError, Tracer};
use eagpt_scene::Gaussians;
use serde::{Serialize, Serializer};
use std::fmt;
#[cfg(feature = "gpu")]
use std::path::Path;
use std::str::FromStr;
#[cfg(feature = "gpu")]
use std::sync::Arc;

/// Choice of a device: `auto`, `cpu`, `gpu`, `gpu:INDEX` or `gpu:NAME`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum DeviceSelector {
    /// The first GPU in hardware, else the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The first GPU in hardware, else a software adapter.
    Gpu,
    /// The GPU at this place of `gpu::adapters`.
    Index(usize),
    /// The first GPU whose name contains this, in any case.
    Name(String),
}

impl FromStr for DeviceSelector {
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

impl fmt::Display for DeviceSelector {
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

impl Serialize for DeviceSelector {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A device, open.
#[derive(Debug, Clone, Default)]
pub enum Device {
    /// All threads of the current rayon pool.
    #[default]
    Cpu,
    /// A device that wgpu has opened.
    #[cfg(feature = "gpu")]
    Gpu(Arc<gpu::Device>),
}

impl Device {
    /// Opens the device that `selector` names. [`DeviceSelector::Auto`] is the CPU where there is
    /// no GPU, and an error where a driver refuses to open the GPU there is.
    ///
    /// # Errors
    /// If there is no such device, or its driver refuses.
    #[cfg(feature = "gpu")]
    pub fn open(selector: &DeviceSelector) -> Result<Self, TraceError> {
        match selector {
            DeviceSelector::Cpu => return Ok(Self::Cpu),
            DeviceSelector::Auto if !may_have_hardware() => return Ok(Self::Cpu),
            _ => {}
        }
        match gpu::Device::open(selector) {
            Ok(device) => Ok(Self::Gpu(device)),
            Err(gpu::GpuError::NotFound { .. }) if *selector == DeviceSelector::Auto => {
                Ok(Self::Cpu)
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The CPU: this build knows no other device.
    ///
    /// # Errors
    /// If another device is asked for.
    #[cfg(not(feature = "gpu"))]
    pub fn open(selector: &DeviceSelector) -> Result<Self, TraceError> {
        match selector {
            DeviceSelector::Auto | DeviceSelector::Cpu => Ok(Self::Cpu),
            other => Err(TraceError::Device {
                device: other.to_string(),
                problem: "this program was built without the feature gpu".to_owned(),
            }),
        }
    }

    /// Name, as recorded beside results.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => "cpu".to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(device) => format!("gpu: {}", device.adapter().name),
        }
    }

    /// A scene of `gaussians` on this device.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub fn scene(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>, TraceError> {
        Ok(match self {
            Self::Cpu => Box::new(CpuScene::new(gaussians)),
            #[cfg(feature = "gpu")]
            Self::Gpu(device) => Box::new(gpu::GpuScene::new(device, gaussians)?),
        })
    }
}

/// Whether the system could have a GPU: where it cannot, drivers are not loaded, some of which
/// complain of a missing display. On Linux each driver has a node in `/dev`: DRM, NVIDIA, Adreno,
/// Mali or, under Windows, DirectX.
#[cfg(feature = "gpu")]
fn may_have_hardware() -> bool {
    let nodes = ["dri", "nvidiactl", "kgsl-3d0", "mali0", "dxg"];
    !cfg!(target_os = "linux")
        || nodes
            .iter()
            .any(|node| Path::new("/dev").join(node).exists())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selectors_print_as_they_are_parsed() {
        for text in [
            "auto",
            "cpu",
            "gpu",
            "gpu:1",
            "gpu:llvmpipe",
            "gpu:RTX 4090",
        ] {
            assert_eq!(text.parse::<DeviceSelector>().unwrap().to_string(), text);
        }
        assert_eq!("gpu:0".parse(), Ok(DeviceSelector::Index(0)));
        assert_eq!("gpu:4a".parse(), Ok(DeviceSelector::Name("4a".to_owned())));
        for wrong in ["", "cuda", "gpu:", "GPU", "cpu:0"] {
            assert!(wrong.parse::<DeviceSelector>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_cpu_needs_no_driver() {
        assert!(matches!(
            Device::open(&DeviceSelector::Cpu),
            Ok(Device::Cpu)
        ));
    }
}
