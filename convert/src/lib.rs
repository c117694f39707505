//! Datasets of the field in and out, what is in a dataset, and normal maps of any estimator.
//!
//! - [`source`]: layouts of other programs and datasets, read into one form: poses with OpenCV
//!   axes, lenses, files, colour.
//! - [`mod@import`]: a source becomes our dataset: linear Rec.709, pinhole cameras,
//!   `transforms.json`.
//! - [`mod@export`]: our dataset for other programs.
//! - [`mod@check`]: what a dataset has, what it lacks, and what is wrong with it.
//! - [`mod@normals`]: normal maps, in whatever axes and encoding, become world-space normals of the
//!   views.
//!
//! Conventions of colour are in [`color`] alone, conventions of poses in [`world`] and
//! [`eagpt_scene::dataset::pose`].

pub mod check;
pub mod color;
pub mod error;
pub mod export;
pub mod import;
pub mod normals;
pub mod source;
pub mod surface;
pub mod world;

pub use error::{ConvertError, Result};
pub use export::{ExportFormat, ExportProgress, ExportSummary, export};
pub use import::{ImportOptions, ImportProgress, ImportSummary, import};
pub use source::{Source, SourceFormat};
