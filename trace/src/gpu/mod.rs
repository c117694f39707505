//! Devices that wgpu finds (Vulkan, Metal, DirectX 12).

mod adapter;

pub use adapter::{Adapter, Kind, adapters};
