//! A virtual capture rig: rooms of analytic shapes, path-traced with exact ground truth, photographed as RAW brackets.
//!
//! - [`dng`]: mosaics of a sensor as DNG files.

pub mod dng;
