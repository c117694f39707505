//! RAW brackets, or brackets of pictures for display, to linear HDR images.
//!
//! A capture is a folder of photographs: positions of the camera, times lighting conditions, times
//! exposures. [`ingest`] finds out which shots belong together, says what is wrong with them,
//! merges each stack where the sensor measured it, and writes linear Rec.709 images with previews,
//! masks of what cannot be trusted, and a report.
//!
//! - [`raw`]: decoders behind one seam; `manifest`, `stack`: which photographs belong together;
//! - `noise`, `merge`: the sensor's noise, and the most likely radiance given all shots;
//! - `response`: the light that the codes of a JPEG stand for;
//! - `demosaic`, `color`, `vignetting`: from the sensor's samples to colours;
//! - `capture`: what was decided and measured, as it is written.
//!
//! One stack is in memory at a time. Sums run in a fixed order: the same photographs give the same
//! bits for any number of threads.

mod allocator;
mod capture;
mod check;
mod color;
mod demosaic;
mod develop;
mod discover;
mod error;
mod gather;
mod group;
mod job;
mod manifest;
mod merge;
mod merge_all;
mod noise;
mod numbers;
mod options;
mod output;
mod prepare;
mod problem;
pub mod raw;
mod report;
mod request;
mod resample;
mod response;
mod stack;
mod survey;
mod thumb;
mod vignetting;
mod warnings;

pub use allocator::LimitedAllocator;
pub use capture::{Capture, Quality};
pub use color::WhiteBalance;
pub use demosaic::Demosaic;
pub use error::{IngestError, Result};
pub use job::ingest;
pub use options::{ExposureRatios, IngestOptions, LensOption};
pub use prepare::check_places;
pub use problem::Problem;
pub use raw::{Decoding, serve_decoding};
pub use request::{IngestProgress, IngestRequest, IngestSummary};
pub use response::Response;
pub use vignetting::Vignetting;
