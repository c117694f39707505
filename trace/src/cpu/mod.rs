//! The CPU engine.
//!
//! - [`bvh`]: an 8-wide BVH for single rays in any direction.
//! - [`bins`]: which Gaussians each tile of a camera may see.
//! - [`camera`]: blended sums of all pixels of a camera; [`CameraRecord`] holds what [`CameraRecord::adjoint`] needs of them.
//! - [`weights`]: the blends of a camera's pixels as a matrix, for pictures of which the geometry does not change.
//! - [`draws`]: opaque discs drawn from the Gaussians, for rays of which the mean alone matters.
//! - [`CpuScene`]: both together, behind [`crate::Tracer`].

mod adjoint;
pub mod bins;
pub mod bvh;
pub mod camera;
pub mod draws;
mod hits;
mod scene;
mod search;
mod tile;
pub mod weights;

pub use adjoint::Wanted;
pub use camera::{CameraRecord, HitSearch};
pub use scene::CpuScene;
