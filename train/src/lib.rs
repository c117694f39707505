//! From a dataset to Gaussians: stage 0 (radiance, emission, geometry) and stage 1 (diffuse albedo)
//! of EAG-PT; light baking.
//!
//! - [`options`]: all options of a run, presets included; shared by the command line and
//!   TOML files.
//! - [`init`]: starting Gaussians from a coloured point cloud and the training views.
//! - [`params`]: raw parameters, their activations, the chain rule back to them, and Adam.
//! - [`loss`]: the losses and their gradients with respect to the composited features of each
//!   pixel.
//! - `densify`: the choice of Gaussians to split, and of those to reuse for it.
//! - [`backend`]: one training step on a device.
//! - `gloss`: F0 and roughness of surfaces, from how their radiance differs with the direction.
//! - `own_light`: whether emitters and albedos explain the photographs.
//! - [`checkpoint`]: the full state of a run, versioned and written atomically.
//! - [`bake`]: light baking after an edit, in Gaussian space or by path-traced views.
//! - [`light_fit`]: powers of lamps that explain photographs in another light.
//! - [`relit`]: a light that was not trained on, by switching lamps.
//! - [`job`]: the loop: schedules, logs, previews, divergence, resuming.

pub mod backend;
pub mod bake;
pub mod checkpoint;
mod densify;
mod error;
mod gloss;
pub mod init;
pub mod job;
pub mod light_fit;
mod log;
pub mod loss;
pub mod options;
mod order;
mod own_light;
pub mod params;
pub mod points;
mod progress;
pub mod relit;
mod views;

pub use error::{Result, TrainError};
pub use gloss::GlossySurface;
pub use job::{TrainRequest, TrainSummary, train};
pub use options::{Preset, TrainOptions};
pub use own_light::OwnLight;
pub use progress::TrainProgress;
