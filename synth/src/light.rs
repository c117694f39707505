//! The light of a room: a path tracer over analytic shapes, for several conditions at once.
//!
//! - [`points`]: where it is sampled.
//! - [`emitters`]: directions towards lights.
//! - [`mod@path`]: light followed from surface to surface.
//! - [`coat`]: light that coats mirror.
//! - [`cache`]: light that is solved once for the whole room, for the far ends of paths.

pub mod cache;
pub mod coat;
pub mod emitters;
pub mod path;
pub mod points;

pub use cache::{Cache, CacheOptions};
pub use path::Lighting;
