//! The engine on devices that wgpu finds (Vulkan, Metal, DirectX 12).

mod adapter;
mod adjoint;
mod bins;
mod camera;
mod device;
mod error;
mod fit;
mod layout;
mod scan;
mod scene;
mod sort;
mod wgsl;

pub use adapter::{Adapter, Kind, adapters};
pub use device::{Device, Tier, Wanted};
pub use error::GpuError;
pub use fit::{Frame, FrameRoom, GpuFit};
pub use scene::GpuScene;

/// What kernels of other crates are made of.
pub mod kernel {
    pub use super::device::Step;
    pub use super::layout::{Layout, Member, layout};
    pub use super::wgsl::{Module, shared};
    pub use wgpu::Buffer;
}
