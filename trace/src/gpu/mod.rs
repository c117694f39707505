//! The engine on devices that wgpu finds (Vulkan, Metal, DirectX 12).

mod adapter;
mod adjoint;
mod bins;
mod camera;
mod device;
mod error;
mod layout;
mod scan;
mod scene;
mod sort;
mod wgsl;

pub use adapter::{Adapter, Kind, adapters};
pub use device::{Device, Tier, Wanted};
pub use error::GpuError;
pub use scene::GpuScene;
