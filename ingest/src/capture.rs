//! `capture.json`: all decisions and measurements.

use crate::color::ColorTransform;
use crate::noise::Noise;
use crate::options::IngestOptions;
use crate::problem::Problem;
use crate::response::Response;
use crate::vignetting::Falloff;
use eagpt_scene::lens::Pinhole;
use serde::{Deserialize, Serialize};

/// A capture as it was ingested.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Capture {
    /// Camera of all photographs.
    pub camera: String,
    /// Focal length of all photographs in millimetres, if known.
    pub focal_mm: Option<f64>,
    /// Effective options.
    pub options: IngestOptions,
    /// Response of the camera, for pictures for display.
    pub response: Option<Response>,
    /// Transform of colours.
    pub color: ColorTransform,
    /// The falloff that was divided by; `None`: none was.
    pub(crate) falloff: Option<Falloff>,
    /// Camera of the written images if a lens was given; `None`: images are as the lens drew them.
    pub pinhole: Option<Pinhole>,
    /// Radiance of a sample at saturation in a shot of 1 s at ISO 100 and f/1.
    pub scale: f64,
    /// Factor on the previews before they were encoded as sRGB.
    pub preview_exposure: f64,
    /// Lighting conditions, sorted.
    pub conditions: Vec<String>,
    /// Stacks in order.
    pub stacks: Vec<StackReport>,
    /// Problems for which files or stacks were left out.
    pub left_out: Vec<Problem>,
    /// Remarks for the reader.
    pub notes: Vec<String>,
}

/// A stack as it was merged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StackReport {
    /// Lighting condition.
    pub condition: String,
    /// Position of the camera.
    pub position: String,
    /// Files relative to the output.
    pub(crate) files: StackFiles,
    /// Width of the images in pixels.
    pub width: u32,
    /// Height of the images in pixels.
    pub height: u32,
    /// Shots, shortest first.
    pub shots: Vec<ShotReport>,
    /// Noise of the sensor.
    pub noise: Noise,
    /// Quality.
    pub quality: Quality,
    /// Warnings that a person should check.
    pub warnings: Vec<String>,
}

/// Files of a stack, relative to the output, with "/" between folders.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StackFiles {
    /// Linear radiance, EXR.
    pub radiance: String,
    /// sRGB preview, PNG.
    pub preview: String,
    /// Bit mask, 8-bit grey PNG: 1 clipped in all shots, 2 dark in all shots.
    pub unreliable: String,
}

/// A shot as it was used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShotReport {
    /// File relative to the capture.
    pub file: String,
    /// BLAKE3 digest of the file, hexadecimal.
    pub blake3: String,
    /// Exposure time in seconds as stated.
    pub exposure_s: f64,
    /// ISO as stated.
    pub iso: Option<f64>,
    /// f-number as stated.
    pub f_number: Option<f64>,
    /// Exposure in seconds at ISO 100 and f/1 as stated.
    pub exposure_stated: f64,
    /// As used for merging.
    pub exposure_used: f64,
    /// Measured over stated exposure, less 1; 0 where it could not be measured.
    pub exposure_error: f64,
    /// Share of the picture's blocks with a clipped sample.
    pub clipped_share: f64,
    /// Share of the comparable blocks that show something else than in the shot before.
    pub moved_share: Option<f64>,
}

/// Measures of a merged stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Share of samples that are clipped in all shots.
    pub clipped_share: f64,
    /// Share of samples that are dark in all shots.
    pub dark_share: f64,
    /// Radiance of the read noise of the longest shot, green.
    pub noise_floor: f64,
    /// Stops from the noise floor to the largest radiance that does not clip.
    pub range_stops: f64,
    /// Largest error of a stated exposure, as a share.
    pub exposure_error: f64,
    /// Largest share of blocks that changed between two shots.
    pub moved_share: f64,
    /// Contrast of the finest detail, 0 to 1.
    pub sharpness: f64,
    /// Share of values that were below 0 and are 0 now.
    pub negative_share: f64,
    /// Geometric mean of the luminance.
    pub mean_luminance: f64,
    /// Largest value.
    pub largest: f64,
}
