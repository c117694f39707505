//! The light of a room: a path tracer over analytic shapes, for several conditions at once.
//!
//! - [`points`]: where it is sampled.
//! - [`emitters`]: directions towards lights.
//! - [`mod@path`]: light followed from surface to surface.
//! - [`coat`]: light that coats mirror.
//! - [`cache`]: light that is solved once for the whole room, for the far ends of paths.

pub(crate) mod cache;
pub(crate) mod coat;
pub(crate) mod emitters;
pub(crate) mod path;
pub(crate) mod points;

pub(crate) use cache::{Cache, CacheOptions};
pub(crate) use path::Lighting;

#[cfg(test)]
mod tests;
