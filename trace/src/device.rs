//! Compute devices.

use crate::error::TraceError;
#[cfg(feature = "gpu")]
use crate::gpu;
use crate::selector::DeviceSelector;
#[cfg(feature = "gpu")]
use std::path::Path;
#[cfg(feature = "gpu")]
use std::sync::Arc;

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
    fn the_cpu_needs_no_driver() {
        assert!(matches!(
            Device::open(&DeviceSelector::Cpu),
            Ok(Device::Cpu)
        ));
    }
}
