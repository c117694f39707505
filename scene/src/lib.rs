//! The basic types of eagpt and their files.
//!
//! Everything the other crates talk about is defined here once: [`Gaussians`], [`Camera`],
//! datasets, [`Image`], colour transforms and the counter-based random numbers. Light is linear,
//! scene-referred, Rec.709 throughout; display encodings live in [`color`] and are applied only
//! where a loss, a metric or a PNG needs them. See `CONVENTIONS.md` at the root of the repository
//! for axes, quaternion order and pixel centres.

pub mod camera;
pub mod camera_path;
pub mod clock;
pub mod color;
pub mod dataset;
pub mod discs;
pub mod error;
pub mod exr;
pub mod files;
pub mod gaussians;
mod gloss;
pub mod harmonics;
pub mod image;
pub mod lamps;
pub mod lens;
pub mod light_basis;
pub mod machine;
pub mod median;
pub mod morton;
pub mod pictures;
pub mod plane;
pub mod ply;
pub mod png;
pub mod rng;
pub mod rotation;
mod scene_edit;
pub mod script;
pub mod shard;
pub mod spread;
pub mod tonemap;
pub mod words;

#[cfg(test)]
mod testing;

pub use camera::Camera;
pub use camera_path::CameraPath;
pub use dataset::{Dataset, Frame, View};
pub use error::{Result, SceneError};
pub use gaussians::{Gaussian, Gaussians, random_cloud};
pub use gloss::Gloss;
pub use harmonics::Harmonics;
pub use image::Image;
pub use lamps::{Lamp, LampShape, Lamps};
pub use lens::Lens;
pub use light_basis::{LightBasis, LightGroups};
pub use scene_edit::SceneEdit;
pub use shard::Shard;
