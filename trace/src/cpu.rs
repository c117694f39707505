//! The CPU engine.
//!
//! - [`bvh`]: an 8-wide BVH for single rays in any direction.
//! - `bins`: the Gaussians each tile of a camera may see.
//! - [`camera`]: composited features of all pixels of a camera; [`CameraRecord`] holds the blended
//!   hits for [`CameraRecord::adjoint`].
//! - [`realizations`]: stochastic realizations of the Gaussians as opaque discs, for rays of which
//!   the mean alone matters.
//! - [`CpuScene`]: Gaussians for all of it.
//! - `integrate`, `path`: the integrators on single rays; `glossy`: what surfaces mirror; `matrix`:
//!   light transport.
//! - `tracer`: all of it behind [`crate::Tracer`].

mod adjoint;
pub(crate) mod bins;
pub mod bvh;
pub mod camera;
mod glossy;
mod harmonics;
mod hits;
mod integrate;
mod lanes;
mod matrix;
mod path;
mod pixel_gloss;
pub mod realizations;
mod record;
mod samples;
mod scene;
mod search;
mod tile;
mod tracer;

pub use camera::HitSearch;
pub use realizations::SampledHit;
pub use record::CameraRecord;
pub use scene::CpuScene;
