//! The `camera_path.json` that nerfstudio's viewer exports: a camera for every frame.
//!
//! Its poses have to be in the world of the scene. Nerfstudio moves and scales the world of a
//! dataset unless it is told not to (`--orientation-method none --center-method none
//! --auto-scale-poses False`).

use super::path::{CameraPath, DEFAULT_FPS, MAX_FRAMES, PathOverrides, Route};
use crate::camera::Camera;
use crate::dataset::{json::Object, pose};
use crate::error::{Result, SceneError};
use glam::DAffine3;
use serde_json::Value;
use std::path::Path;

const POSE: &str = "camera_to_world";

pub(super) fn read(path: &Path, bytes: &[u8], overrides: &PathOverrides) -> Result<CameraPath> {
    let value: Value = serde_json::from_slice(bytes)
        .map_err(|error| SceneError::invalid(path, "JSON", error.to_string()))?;
    let top = Object::root(path, &value)?;
    if let Some(kind) = top.string("camera_type")?
        && kind != "perspective"
    {
        let problem = format!("`{}`: only perspective is", kind.escape_debug());
        return Err(top.unsupported("camera_type", problem));
    }
    let frames = top.objects("camera_path")?;
    let num = frames.len();
    if num as u64 > u64::from(MAX_FRAMES) {
        let problem = format!("{num} frames, more than {MAX_FRAMES}");
        return Err(top.invalid("camera_path", problem));
    }
    if let Some(wanted) = overrides.num_frames {
        let problem = format!("a camera for each of {num} frames: there are no {wanted} to make");
        return Err(top.invalid("camera_path", problem));
    }
    let need = |key| top.need(key, top.pixels(key)?);
    let size = match overrides.size {
        Some(size) => size,
        None => (need("render_width")?, need("render_height")?),
    };
    let cameras = frames.iter().map(|frame| camera(frame, size));
    Ok(CameraPath {
        file: None,
        fps: top.positive("fps")?.unwrap_or(DEFAULT_FPS),
        ease: false,
        cameras: cameras.collect::<Result<_>>()?,
        route: Route::Listed,
    })
}

fn camera(frame: &Object<'_>, size: (u32, u32)) -> Result<Camera> {
    let degrees = frame.need("fov", frame.number("fov")?)?;
    if !(degrees > 0.0 && degrees < 180.0) {
        let problem = format!("{degrees:?} is not between 0 and 180 degrees");
        return Err(frame.invalid("fov", problem));
    }
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    // Pixels are square: `aspect` says no more than the size does. Any focal length will do before
    // the angle is set.
    let camera = Camera {
        width: size.0,
        height: size.1,
        fx: height,
        fy: height,
        cx: 0.5 * width,
        cy: 0.5 * height,
        world_from_camera: world_from_camera(frame)?,
    };
    Ok(camera.with_vertical_fov(degrees.to_radians()))
}

/// Sixteen numbers, row by row.
fn world_from_camera(frame: &Object<'_>) -> Result<DAffine3> {
    let values = frame.need(POSE, frame.array(POSE)?)?;
    let numbers: Vec<f64> = values.iter().filter_map(Value::as_f64).collect();
    let (rows, rest) = numbers.as_chunks::<4>();
    match rows {
        [a, b, c, d] if rest.is_empty() && values.len() == 16 => {
            pose::from_rows(&[*a, *b, *c, *d]).map_err(|problem| frame.invalid(POSE, problem))
        }
        _ => Err(frame.invalid(POSE, format!("{} numbers, not 16", numbers.len()))),
    }
}
