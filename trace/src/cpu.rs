//! The CPU engine.
//!
//! - [`bvh`]: an 8-wide BVH for single rays in any direction.
//! - [`bins`]: which Gaussians each tile of a camera may see.
//! - [`camera`]: composited features of all pixels of a camera; [`CameraRecord`] holds what
//!   [`CameraRecord::adjoint`] needs of them.
//! - [`weights`]: the blends of a camera's pixels as a matrix, for pictures of which the geometry
//!   does not change.
//! - [`realizations`]: opaque discs realized from the Gaussians, for rays of which the mean alone
//!   matters.
//! - [`CpuScene`]: both together, behind [`crate::Tracer`].

mod adjoint;
pub mod bins;
pub mod bvh;
pub mod camera;
mod hits;
pub mod realizations;
mod scene;
mod search;
mod tile;
pub mod weights;

pub use adjoint::GradientMask;
pub use camera::{CameraRecord, HitSearch};
pub use scene::CpuScene;
