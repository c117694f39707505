//! Choice of a pinhole camera for a lens.

use crate::camera::Camera;
use glam::DAffine3;
use serde::{Deserialize, Serialize};

/// Part of the lens's image that the pinhole image shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Field {
    /// A rectangle in which every pixel is known
    #[default]
    Inside,
    /// Everything the lens shows up to the largest angle of view
    ///
    /// Pixels it does not show are unknown.
    All,
    /// As many pixels as the source's image has
    ///
    /// With its principal point; pixels the lens does not show are unknown.
    Same,
}

/// A pinhole camera without a pose; as the fields of [`Camera`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pinhole {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge.
    pub cx: f64,
    /// Principal point, pixels from the top edge.
    pub cy: f64,
}

impl Pinhole {
    /// That of a camera.
    pub fn of(camera: &Camera) -> Self {
        Self {
            width: camera.width,
            height: camera.height,
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
        }
    }

    /// The camera at a pose.
    pub fn at(&self, world_from_camera: DAffine3) -> Camera {
        Camera {
            width: self.width,
            height: self.height,
            fx: self.fx,
            fy: self.fy,
            cx: self.cx,
            cy: self.cy,
            world_from_camera,
        }
    }
}

/// Choice of a pinhole camera for a lens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct UndistortOptions {
    /// This one, whatever else is said; pixels the lens does not show are unknown.
    pub pinhole: Option<Pinhole>,
    /// Part of the image to show.
    pub field: Field,
    /// Largest angle of view, degrees across the image in either direction, above 0 and at most
    /// 170: fisheye lenses show more than a plane can.
    pub max_fov_deg: f64,
}

impl Default for UndistortOptions {
    fn default() -> Self {
        Self {
            pinhole: None,
            field: Field::Inside,
            max_fov_deg: 120.0,
        }
    }
}

impl UndistortOptions {
    /// Checks ranges.
    ///
    /// # Errors
    /// The option, its value and its range.
    pub fn validate(&self) -> Result<(), String> {
        if self.max_fov_deg > 0.0 && self.max_fov_deg <= 170.0 {
            return Ok(());
        }
        Err(format!(
            "max_fov_deg: {:?} is not above 0 and at most 170",
            self.max_fov_deg
        ))
    }

    /// Whether every pixel of the pinhole image is known, whatever the lens.
    pub fn shows_known_pixels_only(&self) -> bool {
        self.pinhole.is_none() && self.field == Field::Inside
    }
}
