//! The engine on devices that wgpu finds (Vulkan, Metal, DirectX 12): the same model and the same
//! results as [`crate::cpu`], within rounding.
//!
//! Kernels are written by hand in WGSL, one file per stage with the stem of its twin on the CPU,
//! and keep to what every device of WebGPU has ([`Tier::BASELINE`]): eight storage buffers, 128 MiB
//! in one of them, no float atomics, no subgroups, 16 KiB for a workgroup. Structures and constants
//! are declared in Rust (`layout`) and written into every module (`wgsl`) from there. Work is
//! recorded as steps, a kernel with its buffers, that are replayed as often as needed; buffers stay
//! on the device from call to call.
//!
//! - `scan`, `sort`: prefix features and a stable radix sort.
//! - `bins`: which Gaussians each tile of a camera may see: two sorts, by distance and by tile.
//! - `camera`: composited features of all pixels. Tiles go through their lists once, and again only
//!   where more hits wait than there is room for.
//! - `adjoint`: gradients. Features have a fixed order, nothing is added atomically: the same
//!   device gives the same bits in every run. The same way, how much each Gaussian is seen.
//! - `bvh`, `rays`: single rays, blended or with one hit chosen by its weight.
//! - `light`: the `1-bounce` and `path` integrators; random numbers have the bits of the CPU's.
//!   Software adapters (Mesa's llvmpipe) stop all loops of an invocation after 65,535 turns in sum:
//!   dispatches are cut short of that, but for single Gaussians that cover as many tiles.
//! - `matrix`: which Gaussians light each other. Discs of a realization have the radii of the CPU's
//!   to the bit; one tree serves all realizations.
//! - `views`: buffers for cameras of one size, and the room that these were found to need.
//! - [`GpuScene`]: all of it behind [`crate::Tracer`].
//!
//! Against the CPU: divisions and square roots of devices round otherwise, and compilers fuse
//! multiplications with additions. A hit on the rim of a Gaussian, or one of two at nearly the same
//! distance, may therefore be seen differently; tests leave such rays out
//! ([`crate::oracle::is_ambiguous`]) and hold all others to a few units in the last place of single
//! precision.

mod adapter;
mod adjoint;
mod bins;
mod bvh;
mod camera;
mod capacity;
mod device;
mod error;
mod frame;
mod kernels;
mod layout;
mod light;
mod matrix;
mod passes;
mod rays;
mod scan;
mod scene;
mod shader;
mod sort;
#[cfg(test)]
mod tests;
mod views;

pub use adapter::{Adapter, Kind, adapters};
pub use capacity::{Capacity, Counters};
pub use device::{Device, Profile, Reading, StageTime, Tier};
pub use error::GpuError;
pub use frame::Frame;
pub use scene::GpuScene;

/// Kernels of other crates.
pub mod kernel {
    pub use super::device::Pass;
    pub use super::kernels::{Access, Binding, Kernel, groups, kernels};
    pub use super::layout::{Layout, Member, layout};
    pub use super::shader::{Sources, find, preprocess, shaders, sources};
    pub use wgpu::Buffer;
}
