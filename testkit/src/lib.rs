//! Synthetic scenes with known answers, for tests and examples. Nothing here is part of the
//! program.
//!
//! - [`test_data`]: data that the repository does not hold; [`opened_device`]: the GPU of a test,
//!   which is skipped where there is none.
//! - [`kernels`]: checks of WGSL against the limits of every device.
//! - [`damage`]: damaged and truncated files.
//! - [`gaussians`]: spheres, walls and clouds of Gaussians.
//! - [`lamps`]: lamps that nobody has measured.
//! - [`room`]: a furnished box room under an area light, path-traced analytically, written as a
//!   dataset.

pub mod damage;
mod data;
mod device;
pub mod gaussians;
pub mod kernels;
pub mod lamps;
pub mod room;

pub use data::test_data;
pub use device::opened_device;
