//! Options of an import.

use crate::error::{ConvertError, Result};
use crate::world::World;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::exr::Precision;
use eagpt_scene::lens::{MAX_SIZE, UndistortOptions};
use serde::{Deserialize, Serialize};

/// Treatment of PNG and JPEG photographs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Ldr {
    /// They are refused: they are no measurement of light
    #[default]
    Refuse,
    /// They are decoded as sRGB, with a warning
    Srgb,
}

/// Treatment of frames that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BadFrames {
    /// Nothing is imported.
    #[default]
    Refuse,
    /// The others are imported.
    Skip,
}

/// Options of [`crate::import()`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImportOptions {
    /// Photographs that are no linear EXR.
    pub ldr: Ldr,
    /// Frames that cannot be used.
    pub bad_frames: BadFrames,
    /// The world of the dataset.
    pub world: World,
    /// The source's up axis, overriding its format.
    pub up_axis: Option<UpAxis>,
    /// Length of a scene unit in metres, where the format lacks it; above 0.
    pub metres_per_unit: Option<f64>,
    /// Choice of pinhole cameras for lenses with distortion.
    pub undistort: UndistortOptions,
    /// Longest edge of the images, pixels: larger ones are shrunk.
    pub max_edge: Option<u32>,
    /// Sample type of the images.
    pub precision: Precision,
    /// Factor of all radiances, above 0.
    pub radiance_scale: f64,
    /// Factors of R, G, B in the source's own colour space, in place of those of the format; each
    /// above 0.
    pub white_balance: Option<[f64; 3]>,
    /// Scene of Eyeful Tower, for its white balance.
    pub scene: Option<String>,
    /// Folder of images, for formats that have several.
    pub images: Option<String>,
    /// Scene units that a depth of 1 stands for in nerfstudio's depth images; above 0.
    pub depth_unit: f64,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            ldr: Ldr::default(),
            bad_frames: BadFrames::default(),
            world: World::default(),
            up_axis: None,
            metres_per_unit: None,
            undistort: UndistortOptions::default(),
            max_edge: None,
            precision: Precision::Float,
            radiance_scale: 1.0,
            white_balance: None,
            scene: None,
            images: None,
            depth_unit: 1e-3,
        }
    }
}

impl ImportOptions {
    /// Checks every range.
    ///
    /// # Errors
    /// [`ConvertError::Option`] with the option's name and its value.
    pub fn validate(&self) -> Result<()> {
        let above_0 = |field, value: f64| {
            if value > 0.0 && value.is_finite() {
                return Ok(());
            }
            let problem = format!("{value:?} is not above 0 and finite");
            Err(ConvertError::option(field, problem))
        };
        above_0("radiance_scale", self.radiance_scale)?;
        above_0("depth_unit", self.depth_unit)?;
        if let Some(metres) = self.metres_per_unit {
            above_0("metres_per_unit", metres)?;
        }
        for gain in self.white_balance.into_iter().flatten() {
            above_0("white_balance", gain)?;
        }
        if let Some(edge) = self.max_edge.filter(|edge| !(1..=MAX_SIZE).contains(edge)) {
            let problem = format!("{edge} is not from 1 to {MAX_SIZE}");
            return Err(ConvertError::option("max_edge", problem));
        }
        let undistort = self.undistort.validate();
        undistort.map_err(|problem| ConvertError::option("undistort", problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_checked_by_name() {
        ImportOptions::default().validate().unwrap();
        let wrong = [
            ImportOptions {
                radiance_scale: 0.0,
                ..ImportOptions::default()
            },
            ImportOptions {
                depth_unit: f64::NAN,
                ..ImportOptions::default()
            },
            ImportOptions {
                metres_per_unit: Some(-1.0),
                ..ImportOptions::default()
            },
            ImportOptions {
                white_balance: Some([1.0, 0.0, 1.0]),
                ..ImportOptions::default()
            },
            ImportOptions {
                max_edge: Some(0),
                ..ImportOptions::default()
            },
        ];
        let names = [
            "radiance_scale",
            "depth_unit",
            "metres_per_unit",
            "white_balance",
            "max_edge",
        ];
        for (options, name) in wrong.iter().zip(names) {
            let message = options.validate().unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("option {name}: ")),
                "{message}"
            );
        }
    }
}
