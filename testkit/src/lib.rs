//! Synthetic scenes with known answers, for tests and examples. Nothing here is part of the
//! program.
//!
//! - [`test_data`]: where data are that the repository does not hold; [`opened_device`]: what tests
//!   do where there is no GPU.
//! - [`kernels`]: whether WGSL keeps to what every device has.
//! - [`damage`]: damaged and truncated files.
//! - [`gaussians`]: spheres, walls and clouds of Gaussians.
//! - [`room`]: a furnished box room under an area light, path-traced analytically, written as a
//!   dataset.

pub mod damage;
mod data;
mod device;
pub mod gaussians;
pub mod kernels;
pub mod room;

pub use data::test_data;
pub use device::opened_device;
