//! Scenes on compute devices.

use crate::cpu::CpuScene;
use crate::device::Device;
use crate::error::TraceError;
#[cfg(feature = "gpu")]
use crate::gpu::GpuScene;
use crate::tracer::Tracer;
use eagpt_scene::Gaussians;

impl Device {
    /// A scene of `gaussians` on this device.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub fn scene(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>, TraceError> {
        Ok(match self {
            Self::Cpu => Box::new(CpuScene::new(gaussians)),
            #[cfg(feature = "gpu")]
            Self::Gpu(device) => Box::new(GpuScene::new(device, gaussians)?),
        })
    }
}
