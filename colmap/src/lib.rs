//! COLMAP models: reading, writing, alignment to an upright world with the floor on z = 0, and
//! import as datasets.
//!
//! - [`model`]: cameras, images, points, rigs and frames; reading and writing, text and binary.
//! - [`mod@align`]: floor and direction of the walls, from a model alone.
//! - [`mod@import`]: a model and linear images become a dataset.
//! - [`mod@run`]: drives an installed `colmap`.
//!
//! Poses are COLMAP's, camera from world with OpenCV axes, until [`mod@import`] writes them. Files
//! are not trusted: counts are checked against the number of bytes before anything is allocated.

pub mod align;
mod error;
pub mod import;
pub mod model;
pub mod run;

pub use align::{Alignment, align};
pub use error::{ColmapError, Result};
pub use import::import;
pub use model::{Model, Rigid, Similarity};
pub use run::run;

/// Folders of images are searched to this depth.
const MAX_IMAGE_DEPTH: usize = 8;
