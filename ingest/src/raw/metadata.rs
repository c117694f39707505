//! Statements of a file about its shot.

use serde::{Deserialize, Serialize};

/// Exposure, camera, lens, time. `None` is what the file does not say.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Metadata {
    /// Maker of the camera.
    pub make: String,
    /// Model of the camera.
    pub model: String,
    /// Exposure time in seconds.
    pub exposure_s: Option<f64>,
    /// ISO speed.
    pub iso: Option<f64>,
    /// Aperture as f-number.
    pub f_number: Option<f64>,
    /// Focal length in millimetres.
    pub focal_mm: Option<f64>,
    /// Local time of the shot in seconds since 1970-01-01, as if it were UTC.
    pub time_s: Option<f64>,
    /// Noise variance s·x + o of a value x where saturation is 1 (DNG's NoiseProfile), of green
    /// where there are several.
    pub noise: Option<[f64; 2]>,
    /// EXIF orientation, 1 to 8. Images stay as the sensor has them.
    pub orientation: Option<u16>,
    /// Width of a pixel over its height; `None`: square.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel_aspect: Option<f64>,
    /// Decoder that read the file.
    pub decoder: String,
}

impl Metadata {
    /// Exposure that ratios come from: seconds at ISO 100 and f/1; `None` if the time is unknown.
    /// Factors common to a capture that are not stated, as the aperture of an adapted lens, count
    /// as 1.
    pub fn exposure(&self) -> Option<f64> {
        let gain = self.iso.unwrap_or(100.0) / 100.0;
        let stop = self.f_number.unwrap_or(1.0);
        Some(self.exposure_s? * gain / (stop * stop))
    }

    /// The reason why the exposure cannot be used, if it cannot.
    pub(crate) fn exposure_problem(&self) -> Option<String> {
        const REMEDY: &str = "--exposures states it, or a capture.toml";
        match (self.exposure(), self.exposure_s) {
            (None, _) => Some(format!("no exposure time in the metadata: {REMEDY}")),
            (Some(exposure), _) if exposure.is_finite() && exposure > 0.0 => None,
            (Some(exposure), time) => Some(format!(
                "exposure time {} s in the metadata, {exposure} s at ISO 100 and f/1: {REMEDY}",
                time.unwrap_or_default()
            )),
        }
    }

    /// Maker and model.
    pub fn camera(&self) -> String {
        let (make, model) = (self.make.trim(), self.model.trim());
        let name = if model.starts_with(make) {
            model.to_owned()
        } else {
            format!("{make} {model}")
        };
        if name.is_empty() {
            "unknown camera".to_owned()
        } else {
            name
        }
    }
}
