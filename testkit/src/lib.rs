//! Synthetic scenes with known answers, for tests and examples. Nothing here is part of the program.
//!
//! - [`gaussians`]: spheres, walls and clouds of Gaussians.
//! - [`room`]: a furnished box room under an area light, path-traced analytically, written as a dataset.

pub mod gaussians;
pub mod room;
