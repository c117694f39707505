//! The CPU engine.
//!
//! - [`bvh`]: an 8-wide BVH for single rays in any direction.
//! - [`bins`]: which Gaussians each tile of a camera may see.
//! - [`camera`]: blended sums of all pixels of a camera; [`CameraRecord`] holds what [`CameraRecord::adjoint`] needs of them.
//! - [`CpuScene`]: both together, behind [`crate::Tracer`].

mod adjoint;
pub mod bins;
pub mod bvh;
pub mod camera;
mod hits;
mod scene;
mod search;
mod tile;

pub use adjoint::Wanted;
pub use camera::{CameraRecord, HitSearch};
pub use scene::CpuScene;
