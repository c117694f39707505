//! Ray tracing of 2D Gaussians: composited features along rays, their adjoint, and light transport
//! on top of them.
//!
//! The model is that of EAG-PT (SIGGRAPH 2026, section 3): a ray meets the plane of each Gaussian
//! once, the hit's opacity is `α = σ·exp(−(u² + v²)/2)`, and hits are blended front to back in the
//! true order of their distances.
//!
//! Layout, from simple to fast:
//! - [`model`]: the constants of the model, each with its reason.
//! - [`features`]: the quantities a ray collects, as one vector of 16 lanes.
//! - [`attributes`]: those of them that a Gaussian has.
//! - [`surfel`]: Gaussians prepared for intersection; the one formula for a hit.
//! - [`CameraRays`]: the rays that make the pixels of a camera.
//! - [`blend`]: blending of ordered hits, shared by every way of finding them.
//! - [`oracle`]: the same model, brute force in f64; what everything else is tested against.
//! - [`parity`]: how far an engine is from the oracle, on the machine it runs on.
//! - [`weights`]: the blends of a camera's pixels as a sparse matrix.
//! - [`cpu`]: hit search on the CPU — a wide BVH for single rays, binned tiles for camera rays,
//!   whose adjoint is there, too.
//! - `gpu` (feature `gpu`): the same on devices that wgpu finds.
//! - [`transport`]: options of the `0-bounce`, `1-bounce`, `gather` and `path` integrators, BSDFs,
//!   light sampling and the transport matrix.
//! - `view`: views put together from sampled light, for all engines.
//!
//! [`Device`] names and opens a device, [`Device::scene`] brings Gaussians to it, and [`Tracer`] is
//! the interface of that scene: the only one the code above this crate knows.

pub mod attributes;
pub mod blend;
mod camera_rays;
pub mod cpu;
mod device;
mod error;
pub mod features;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod model;
pub mod oracle;
pub mod parity;
pub mod ray;
mod scene;
mod selector;
pub mod surfel;
mod tracer;
pub mod transport;
mod tree;
mod view;
pub mod weights;

pub use camera_rays::CameraRays;
pub use device::Device;
pub use error::TraceError;
pub use features::{Features, GBuffer};
pub use ray::Ray;
pub use selector::DeviceSelector;
pub use tracer::Tracer;
pub use transport::{Integrator, LightOptions};
pub use view::{Guide, RenderedView};
