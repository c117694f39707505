//! Intrinsics in their many spellings.

use super::json::{Object, excerpt};
use crate::camera::Camera;
use crate::error::Result;
use glam::DAffine3;

/// Keys that EAG-PT and nerfstudio spell differently.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dialect {
    /// `fx`, `fy`, `file_name`
    EagPt,
    /// `fl_x`, `fl_y`, `file_path`
    Nerfstudio,
}

impl Dialect {
    fn focal_keys(self) -> [&'static str; 2] {
        match self {
            Self::EagPt => ["fx", "fy"],
            Self::Nerfstudio => ["fl_x", "fl_y"],
        }
    }
}

/// Largest relative difference between two statements of the same intrinsic that still agree.
const MAX_DISAGREEMENT: f64 = 1e-3;
/// Distortion coefficients, all of which have to be 0.
const DISTORTION: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];
/// `camera_model`s that are pinholes when their coefficients are 0.
const PERSPECTIVE: [&str; 5] = [
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
];

/// The camera of an image of `size` pixels: each key from the frame or from the top level.
///
/// The focal length may also be an angle, `camera_angle_x`, across the image; a missing `fy` equals
/// `fx`; a missing principal point is the centre.
///
/// # Errors
/// [`crate::SceneError`] naming the key: missing, out of range, stated twice with different values,
/// or distorted.
pub(super) fn camera(
    dialect: Dialect,
    top: &Object<'_>,
    frame: &Object<'_>,
    size: (u32, u32),
    world_from_camera: DAffine3,
) -> Result<Camera> {
    for object in [top, frame] {
        check_undistorted(object)?;
    }
    pinhole(dialect, top, frame, size, world_from_camera)
}

/// Focal lengths and principal point of whatever lens it is, with no regard to distortion;
/// otherwise as datasets are opened.
///
/// # Errors
/// [`crate::SceneError`] naming the key: missing, out of range, stated twice with different values,
/// or a stated size that is not `size`.
pub fn pinhole(
    dialect: Dialect,
    top: &Object<'_>,
    frame: &Object<'_>,
    size: (u32, u32),
    world_from_camera: DAffine3,
) -> Result<Camera> {
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    for (key, pixels) in [("w", width), ("h", height)] {
        if let Some((object, stated)) = lookup(top, frame, key)?
            && stated != pixels
        {
            let problem = format!("{stated:?}, but the image is {}x{}", size.0, size.1);
            return Err(object.invalid(key, problem));
        }
    }
    let [key_x, key_y] = dialect.focal_keys();
    let fx = focal(top, frame, key_x, "camera_angle_x", width)?.ok_or_else(|| {
        let problem = "missing, and so is camera_angle_x: one is needed, here or at the top level";
        frame.invalid(key_x, problem)
    })?;
    let fy = focal(top, frame, key_y, "camera_angle_y", height)?.unwrap_or(fx);
    let centre = |key, size: f64| -> Result<f64> {
        Ok(lookup(top, frame, key)?.map_or(size / 2.0, |(_, value)| value))
    };
    Ok(Camera {
        width: size.0,
        height: size.1,
        fx,
        fy,
        cx: centre("cx", width)?,
        cy: centre("cy", height)?,
        world_from_camera,
    })
}

/// A focal length in pixels, from its own key or from the angle of view across `size` pixels.
fn focal(
    top: &Object<'_>,
    frame: &Object<'_>,
    key: &str,
    angle_key: &str,
    size: f64,
) -> Result<Option<f64>> {
    let focal = lookup(top, frame, key)?;
    if let Some((object, value)) = focal
        && value <= 0.0
    {
        return Err(object.invalid(key, format!("{value:?} is not above 0")));
    }
    let Some((object, angle)) = lookup(top, frame, angle_key)? else {
        return Ok(focal.map(|(_, value)| value));
    };
    if !(angle > 0.0 && angle < std::f64::consts::PI) {
        let problem = format!("{angle:?} rad is not between 0 and pi");
        return Err(object.invalid(angle_key, problem));
    }
    let from_angle = 0.5 * size / (0.5 * angle).tan();
    match focal {
        Some((_, value)) if !agree(value, from_angle) => {
            let problem = format!(
                "{angle:?} rad is a focal length of {from_angle:?}, but {key} is {value:?}"
            );
            Err(object.invalid(angle_key, problem))
        }
        Some((_, value)) => Ok(Some(value)),
        None => Ok(Some(from_angle)),
    }
}

/// The number at `key` and where it stands; stated in both places it has to be the same.
///
/// # Errors
/// [`crate::SceneError::Invalid`] naming the key.
pub fn lookup<'o, 'a>(
    top: &'o Object<'a>,
    frame: &'o Object<'a>,
    key: &str,
) -> Result<Option<(&'o Object<'a>, f64)>> {
    match (top.number(key)?, frame.number(key)?) {
        (Some(all), Some(own)) if !agree(all, own) => {
            let problem = format!("{own:?}, but {all:?} at the top level");
            Err(frame.invalid(key, problem))
        }
        (_, Some(own)) => Ok(Some((frame, own))),
        (Some(all), None) => Ok(Some((top, all))),
        (None, None) => Ok(None),
    }
}

fn agree(a: f64, b: f64) -> bool {
    (a - b).abs() <= MAX_DISAGREEMENT * a.abs().max(b.abs())
}

fn check_undistorted(object: &Object<'_>) -> Result<()> {
    const UNDISTORT: &str = "undistort the images first";
    for key in DISTORTION {
        if let Some(value) = object.number(key)?
            && value != 0.0
        {
            return Err(object.unsupported(key, format!("distortion {value:?}; {UNDISTORT}")));
        }
    }
    let key = "distortion_params";
    for value in object.array(key)?.unwrap_or_default() {
        if value.as_f64() != Some(0.0) {
            let problem = format!("distortion {}; {UNDISTORT}", excerpt(value));
            return Err(object.unsupported(key, problem));
        }
    }
    let key = "camera_model";
    if let Some(model) = object.string(key)?
        && !PERSPECTIVE.contains(&model.to_ascii_uppercase().as_str())
    {
        let problem = format!("{}; {UNDISTORT}", excerpt(&model.into()));
        return Err(object.unsupported(key, problem));
    }
    let key = "is_fisheye";
    match object.get(key) {
        Some(value) if value.as_bool() != Some(false) => {
            Err(object.unsupported(key, format!("{}; {UNDISTORT}", excerpt(value))))
        }
        _ => Ok(()),
    }
}
