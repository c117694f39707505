//! A box room with two boxes on the floor, diffuse throughout, lit by a rectangle in the ceiling.
//!
//! Shapes are intersected in closed form and light is path-traced with next-event estimation, so
//! that the images hold the same light transport that the program reproduces: soft shadows, colour
//! bleeding, up to `light::MAX_BOUNCES` bounces. What a camera of the real world adds (noise,
//! glossy surfaces, lens) is absent.
//!
//! - `shapes`: the room itself.
//! - `light`: its light.
//! - `cameras`: poses inside it.
//! - `dataset`: all of it on disk.

mod cameras;
mod dataset;
mod light;
mod shapes;

pub use dataset::{RoomOptions, write};
