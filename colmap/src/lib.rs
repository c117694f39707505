//! COLMAP: its models in and out, upright with the floor on z = 0, as datasets.
//!
//! - [`model`]: cameras, images, points, rigs and frames; reading and writing, text and binary.
//! - [`mod@align`]: where the floor is and which way the walls go, from a model alone.
//! - [`mod@import`]: a model and linear images become a dataset.
//! - [`mod@run`]: drives an installed `colmap`.
//!
//! Poses are COLMAP's, camera from world with OpenCV axes, until [`mod@import`] writes them. What a
//! file says is never trusted: counts are held against the bytes that are there before anything is
//! allocated.

pub mod align;
pub mod error;
pub mod import;
pub mod model;
pub mod run;

pub use align::{Alignment, align};
pub use error::{ColmapError, Result};
pub use import::import;
pub use model::{Model, Rigid, Similarity};
pub use run::run;
