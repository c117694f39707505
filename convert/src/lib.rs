//! Import and export of datasets of other programs, checks of a dataset, and normal maps of any
//! estimator.
//!
//! - `source`: layouts of other programs and datasets, read into one form: poses with OpenCV
//!   axes, lenses, files, colour.
//! - [`mod@import`]: conversion of a source into our dataset: linear Rec.709, pinhole cameras,
//!   `transforms.json`.
//! - [`mod@export`]: our dataset in the layouts of other programs.
//! - [`mod@check`]: contents of a dataset, missing parts and problems.
//! - `splats`: Gaussians of other programs, made into a scene of ours.
//! - [`mod@normals`]: world-space normals of the views from normal maps in any axes and encoding.
//!
//! Conventions of colour are in `color` alone, conventions of poses in `world` and
//! [`eagpt_scene::dataset::pose`].

pub mod check;
mod color;
mod error;
pub mod export;
pub mod import;
pub mod normals;
mod options;
mod source;
mod splats;
mod surface;
mod world;

pub use error::{ConvertError, Result};
pub use export::{ExportFormat, ExportProgress, export};
pub use import::{ImportOptions, ImportProgress, ImportSummary, import};
pub use source::{SourceDataset, SourceFormat};
pub use splats::{SplatColor, SplatOptions, SplatReport, import_splats};
pub use world::World;
