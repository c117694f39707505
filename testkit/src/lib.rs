//! Synthetic scenes with known answers, for tests and examples. Nothing here is part of the program.
//!
//! - [`test_data`]: where data are that the repository does not hold.
//! - [`gaussians`]: spheres, walls and clouds of Gaussians.
//! - [`room`]: a furnished box room under an area light, path-traced analytically, written as a dataset.

mod data;
pub mod gaussians;
pub mod room;

pub use data::test_data;
