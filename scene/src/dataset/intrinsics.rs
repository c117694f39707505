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
/// The focal length may also be an angle, `camera_angle_x`, across the image; where both are there
/// the focal length counts, as in instant-NGP and nerfstudio (see [`Contradictions`]). A missing
/// `fy` equals `fx`; a missing principal point is the centre.
///
/// # Errors
/// [`crate::SceneError`] naming the key: missing, out of range, with another value at the top level
/// than in the frame, or distorted.
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
/// [`crate::SceneError`] naming the key: missing, out of range, with another value at the top level
/// than in the frame, or a stated size that is not `size`.
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

/// A focal length in pixels, from its own key or else from the angle of view across `size` pixels.
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
    let from_angle = focal_of_angle(top, frame, angle_key, size)?;
    Ok(focal
        .map(|(_, value)| value)
        .or(from_angle.map(|angle| angle.focal)))
}

/// An angle of view and what follows from it.
struct Angle<'o, 'a> {
    object: &'o Object<'a>,
    radians: f64,
    /// Focal length in pixels.
    focal: f64,
}

fn focal_of_angle<'o, 'a>(
    top: &'o Object<'a>,
    frame: &'o Object<'a>,
    key: &str,
    size: f64,
) -> Result<Option<Angle<'o, 'a>>> {
    let Some((object, radians)) = lookup(top, frame, key)? else {
        return Ok(None);
    };
    if !(radians > 0.0 && radians < std::f64::consts::PI) {
        let problem = format!("{radians:?} rad is not between 0 and pi");
        return Err(object.invalid(key, problem));
    }
    Ok(Some(Angle {
        object,
        radians,
        focal: 0.5 * size / (0.5 * radians).tan(),
    }))
}

/// Frames whose angle of view is another than their focal length says: some programs write the
/// angle of an image of another size, or of a camera before its calibration.
#[derive(Debug, Clone, Default)]
pub struct Contradictions {
    first: Option<String>,
    num: usize,
}

impl Contradictions {
    /// Looks at a frame whose image has `size` pixels, of which [`pinhole`] has made a camera.
    ///
    /// # Errors
    /// As [`pinhole`].
    pub fn add(
        &mut self,
        dialect: Dialect,
        top: &Object<'_>,
        frame: &Object<'_>,
        size: (u32, u32),
    ) -> Result<()> {
        let [key_x, key_y] = dialect.focal_keys();
        let stated_size = |key: &str, size: u32| -> Result<f64> {
            Ok(lookup(top, frame, key)?.map_or(f64::from(size), |(_, stated)| stated))
        };
        for (key, angle_key, size) in [
            (key_x, "camera_angle_x", stated_size("w", size.0)?),
            (key_y, "camera_angle_y", stated_size("h", size.1)?),
        ] {
            let angle = focal_of_angle(top, frame, angle_key, size)?;
            if let (Some((_, value)), Some(angle)) = (lookup(top, frame, key)?, angle)
                && !agree(value, angle.focal)
            {
                self.num += 1;
                let Angle {
                    object,
                    radians,
                    focal,
                } = angle;
                self.first.get_or_insert_with(|| {
                    format!(
                        "{}: {}: {radians:?} rad is a focal length of {focal:.2}, but {key} is \
                         {value:?}: {key} is taken",
                        object.path.display(),
                        object.field(angle_key)
                    )
                });
                break;
            }
        }
        Ok(())
    }

    /// A warning, if there were any.
    pub fn warning(self) -> Option<String> {
        let first = self.first?;
        Some(match self.num {
            1 => first,
            num => format!("{first}, for {num} frames"),
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::path::Path;

    #[test]
    fn one_warning_tells_of_all_contradictions() {
        let top = json!({"camera_angle_x": 1.0, "fl_y": 2, "w": 4, "h": 2});
        let frames = [
            json!({"fl_x": 3.6609, "camera_angle_y": 0.9273}),
            json!({"fl_x": 9}),
            json!({"fl_x": 9, "camera_angle_y": 0.5}),
        ];
        let top = Object::root(Path::new("a.json"), &top).unwrap();
        let mut found = Contradictions::default();
        for (index, frame) in frames.iter().enumerate() {
            let frame = Object {
                within: Some(("frames", index)),
                ..Object::root(Path::new("a.json"), frame).unwrap()
            };
            // Half the size that is stated: the angle is across the image either way.
            found
                .add(Dialect::Nerfstudio, &top, &frame, (2, 1))
                .unwrap();
        }
        // 2 / tan 0.5 = 3.6609754.
        let text = "a.json: camera_angle_x: 1.0 rad is a focal length of 3.66, but fl_x is 9.0: \
                    fl_x is taken, for 2 frames";
        assert_eq!(found.warning().unwrap(), text);
        assert_eq!(Contradictions::default().warning(), None);
    }
}
