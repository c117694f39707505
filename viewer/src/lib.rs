//! A scene on one page that a browser shows without anything installed.
//!
//! - [`mod@pack`]: Gaussians as few bytes, with the error that this makes.
//! - [`page`]: the page, filled: scene, cameras, photographs, lamps.
//! - [`live`], [`server`]: the same page with an edit under way, from a server on this machine.
//! - [`workshop`], [`still`]: jobs of the server: light after an edit, path-traced pictures.
//! - [`photograph`]: photographs of a dataset as text.
//!
//! The page itself is TypeScript, in the folder `page` beside this one; what is made of it,
//! `dist/viewer.html`, is part of this crate, so that a build of the program needs no node. There a
//! ray of every pixel meets the discs as [`eagpt_trace`] has it, constants included.

pub mod error;
pub mod live;
pub mod pack;
pub mod page;
pub mod photograph;
pub mod server;
pub mod still;
pub mod workshop;

#[cfg(test)]
mod testing;

pub use error::{Result, ViewerError};
