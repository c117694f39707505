//! A virtual capture rig: rooms of analytic shapes, path-traced with exact ground truth, photographed as RAW brackets.
//!
//! - [`room`]: shapes, patterns, materials, lights.
//! - [`script`]: scene files; [`scenes`]: those that come with the program.
//! - [`light`]: the path tracer; [`photograph`]: what a camera sees.
//! - [`rig`]: lens, sensor, exposures; [`dng`]: mosaics as DNG files.
//! - [`capture`]: the job.

pub mod capture;
pub mod dng;
pub mod error;
pub mod light;
pub mod photograph;
pub mod rig;
pub mod room;
pub mod scenes;
pub mod script;

pub use capture::{SynthOptions, SynthProgress, SynthSummary, simulate};
pub use error::{Result, SynthError};
pub use script::SceneScript;
