//! The engine on devices that wgpu finds (Vulkan, Metal, DirectX 12): the same model and the same
//! results as [`crate::cpu`], within rounding.
//!
//! Kernels are written by hand in WGSL (`shader/`, with what they import in `shader/shared/`), and
//! keep to what every device of WebGPU has: eight storage buffers, 128 MiB in one of them, no float
//! atomics, no subgroups, 16 KiB for a workgroup. Structures and constants are declared in Rust
//! (`declarations`) and imported from there; `kernels` is the table of all kernels and their
//! buffers, which a test holds against the modules. A pass is a kernel with its buffers, made once
//! and replayed; buffers stay on the device from call to call.
//!
//! To read a job from top to bottom: `passes` for the rays of a camera and their adjoint, `light`
//! for the `1-bounce`, `gather` and `path` integrators, `matrix` for light transport.
//!
//! - `scan`, `sort`: prefix sums and a stable radix sort.
//! - `bins`: lists of the Gaussians that each tile of a camera may see: two sorts, by distance and
//!   by tile.
//! - `camera`: composited features of all pixels. Tiles go through their lists once, and again only
//!   where more hits wait than fit into registers.
//! - `adjoint`: gradients, and what Gaussians contribute to pixels. Sums have a fixed order,
//!   nothing is added atomically: the same device gives the same bits in every run.
//! - `bvh`, `rays`: single rays, blended or with one hit chosen by its weight.
//! - `light`: scenes with gloss have kernels of their own. Random numbers have the bits of the
//!   CPU's. Software adapters (Mesa's llvmpipe) stop all loops of an invocation after 65,535 turns
//!   in sum: dispatches are cut short of that, but for single Gaussians that cover as many tiles.
//! - `matrix`: discs of a realization have the radii of the CPU's to the bit; one tree serves all
//!   realizations.
//! - `capacity`, `views`: buffers for cameras of one size, and how they grow.
//! - [`GpuScene`]: all of it behind [`crate::Tracer`].
//!
//! Against the CPU: divisions and square roots of devices round otherwise, and compilers fuse
//! multiplications with additions. A hit on the rim of a Gaussian, or one of two at nearly the same
//! distance, may therefore differ; tests leave such rays out ([`crate::oracle::is_ambiguous`]) and
//! hold all others to a few units in the last place of single precision.

mod adapter;
mod adjoint;
mod bins;
mod bvh;
mod camera;
mod capacity;
mod declarations;
mod device;
mod error;
mod frame;
mod kernels;
mod layout;
mod light;
mod light_list;
mod matrix;
mod passes;
mod rays;
mod record;
mod scan;
mod scene;
mod scene_buffers;
mod shader;
mod sort;
#[cfg(test)]
mod tests;
mod views;

pub use adapter::{Adapter, AdapterKind, adapters};
pub use capacity::Capacity;
pub use declarations::camera::Counters;
pub use device::{Device, Profile, Reading, StageTime};
pub use error::GpuError;
pub use frame::Frame;
pub use scene::GpuScene;

/// Kernels of other crates.
pub mod kernel {
    pub use super::device::{Commands, Pass};
    pub use super::kernels::{Access, Binding, Kernel, groups, kernels};
    pub use super::layout::{Layout, Member, layout};
    pub use super::shader::{Sources, find, preprocess, shaders, sources};
    pub use wgpu::Buffer;
}
