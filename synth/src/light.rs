//! The light of a room: a path tracer over analytic shapes, for several conditions at once.
//!
//! - [`points`]: where it is sampled.
//! - [`emitters`]: directions towards lights.
//! - [`mod@path`]: light followed from surface to surface.
//! - [`coat`]: light that coats mirror.
//! - [`cache`]: light that is known for the whole room, for the far ends of paths; `solve` finds it
//!   once.

pub(crate) mod cache;
pub(crate) mod coat;
pub(crate) mod emitters;
pub(crate) mod path;
pub(crate) mod points;
mod solve;

pub(crate) use cache::Cache;
pub(crate) use path::Lighting;
pub(crate) use solve::CacheOptions;

#[cfg(test)]
mod tests;
