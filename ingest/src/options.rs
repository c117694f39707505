//! Options of the job, with their defaults and ranges.

use crate::color::WhiteBalance;
use crate::demosaic::Demosaic;
use crate::error::{IngestError, Result};
use crate::vignetting::{Falloff, Vignetting};
use eagpt_scene::exr::Precision;
use eagpt_scene::lens::undistort::UndistortOptions;
use eagpt_scene::lens::{Lens, LensModel, Undistortion};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Source of exposure ratios.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum ExposureRatios {
    /// Exposure time, ISO and aperture of the files
    ///
    /// They are checked against the photographs.
    #[default]
    Metadata,
    /// Measured, where the shots of a stack overlap
    ///
    /// Enough of the scene has to be well exposed in two neighbouring shots.
    Estimate,
}

/// A lens whose distortion is taken out, in pixels of the sensor's image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensOption {
    /// COLMAP's name of the model, as `OPENCV`.
    pub model: String,
    /// Its parameters in COLMAP's order, as fx, fy, cx, cy, k1, k2, p1, p2.
    pub params: Vec<f64>,
}

impl fmt::Display for LensOption {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let params: Vec<String> = self.params.iter().map(f64::to_string).collect();
        write!(f, "{} {}", self.model, params.join(","))
    }
}

impl LensOption {
    /// The lens for images of `size` pixels, and the pinhole camera that takes its place.
    ///
    /// # Errors
    /// [`IngestError::Option`] if there is no such model, it has other parameters, or no pinhole
    /// camera shows what it sees.
    pub fn undistortion(&self, size: (u32, u32)) -> Result<Undistortion> {
        let error = |problem: String| IngestError::Option {
            field: "lens",
            value: format!("{} {:?}: {problem}", self.model, self.params),
            wanted: "a camera model of COLMAP and its parameters",
        };
        let model: LensModel = self
            .model
            .parse()
            .map_err(|_| error("no such model".to_owned()))?;
        let lens = Lens::new(model, size, &self.params).map_err(error)?;
        Undistortion::new(&lens, &UndistortOptions::default()).map_err(error)
    }
}

/// Options of [`crate::ingest`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IngestOptions {
    /// Whether each folder is one stack, and no grouping by names or exposures is needed.
    pub stacks_in_folders: bool,
    /// Exposure times of the shots of every stack in the order of their names, for files that do
    /// not state them; seconds.
    pub exposures_s: Option<Vec<f64>>,
    /// Longest pause between two shots of a capture, in seconds, above 0; a longer one means two
    /// captures in one folder.
    pub max_pause_s: f64,
    /// Source of exposure ratios.
    pub exposure_ratios: ExposureRatios,
    /// Share of the range below white that counts as clipped already, 0 to 0.5.
    pub clip_margin: f32,
    /// Source of the white balance factors.
    pub white_balance: WhiteBalance,
    /// Radiance of a sample at saturation in a shot of 1 s at ISO 100 and f/1; `None`: the
    /// geometric mean of the capture's luminance becomes 0.18.
    pub scale: Option<f64>,
    /// Demosaicing method.
    pub demosaic: Demosaic,
    /// Source of the lens's falloff.
    pub vignetting: Vignetting,
    /// Lens whose distortion is taken out; `None`: images stay as they are.
    pub lens: Option<LensOption>,
    /// Longest side of the written images in pixels; `None`: as the sensor has it.
    pub long_side: Option<u32>,
    /// Sample type of the EXR files.
    pub precision: Precision,
    /// Continue without the files that have problems.
    pub skip_bad: bool,
}

impl Default for IngestOptions {
    fn default() -> Self {
        Self {
            stacks_in_folders: false,
            exposures_s: None,
            max_pause_s: 1800.0,
            exposure_ratios: ExposureRatios::Metadata,
            clip_margin: 0.03,
            white_balance: WhiteBalance::AsShot,
            scale: None,
            demosaic: Demosaic::Ppg,
            vignetting: Vignetting::None,
            lens: None,
            long_side: None,
            precision: Precision::Half,
            skip_bad: false,
        }
    }
}

impl IngestOptions {
    /// Checks all ranges.
    ///
    /// # Errors
    /// [`IngestError::Option`] for the first option out of its range.
    pub fn validate(&self) -> Result<()> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let option = |holds: bool, field, value: String, wanted| {
            let error = IngestError::Option {
                field,
                value,
                wanted,
            };
            if holds { Ok(()) } else { Err(error) }
        };
        let exposures = self.exposures_s.as_deref().unwrap_or(&[1.0]);
        option(
            !exposures.is_empty() && exposures.iter().all(|v| positive(*v)),
            "exposures",
            format!("{exposures:?}"),
            "seconds above 0",
        )?;
        option(
            positive(self.max_pause_s),
            "max_pause",
            self.max_pause_s.to_string(),
            "above 0 s",
        )?;
        option(
            (0.0..=0.5).contains(&self.clip_margin),
            "clip_margin",
            self.clip_margin.to_string(),
            "0 to 0.5",
        )?;
        option(
            self.scale.is_none_or(positive),
            "scale",
            format!("{:?}", self.scale.unwrap_or_default()),
            "above 0",
        )?;
        option(
            self.long_side.is_none_or(|side| side >= 16),
            "long_side",
            self.long_side.unwrap_or_default().to_string(),
            "at least 16 pixels",
        )?;
        if let WhiteBalance::Factors(factors) = self.white_balance {
            let fine = factors.iter().all(|v| positive(f64::from(*v)));
            option(
                fine,
                "white_balance",
                format!("{factors:?}"),
                "factors above 0",
            )?;
        }
        if let Vignetting::Polynomial(abc) = self.vignetting {
            let usable = abc.iter().all(|v| v.is_finite()) && Falloff::Polynomial(abc).is_usable();
            option(
                usable,
                "vignetting",
                format!("{abc:?}"),
                "coefficients that leave light everywhere",
            )?;
        }
        Ok(())
    }

    /// Fraction of the range from which on a sample is clipped.
    pub(crate) fn clip(&self) -> f32 {
        1.0 - self.clip_margin
    }
}
