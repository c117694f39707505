//! Lenses of `transforms.json`, as nerfstudio and instant-NGP have them.
//!
//! Focal lengths and principal point are those of [`eagpt_scene::dataset::intrinsics`]. Distortion
//! is `k1 … k4`, `p1`, `p2`, or `distortion_params` in the order k1, k2, k3, k4, p1, p2;
//! `FISHEYE624` has twelve of its own.
//!
//! | `camera_model` | lens |
//! |---|---|
//! | `SIMPLE_PINHOLE`, `PINHOLE`, `SIMPLE_RADIAL`, `RADIAL`, `OPENCV`, absent | perspective; nerfstudio does not tell them apart |
//! | `OPENCV_FISHEYE`, or instant-NGP's `is_fisheye` | equidistant |
//! | `FISHEYE624` | that of Project Aria |
//!
//! Panoramas and orthographic images have no pinhole equivalent.

use crate::error::Result;
use eagpt_scene::Lens;
use eagpt_scene::dataset::intrinsics::{self, Dialect};
use eagpt_scene::dataset::json::{Object, excerpt};
use eagpt_scene::lens::LensModel;
use glam::DAffine3;

const COEFFICIENTS: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];
const PARAMS: &str = "distortion_params";
const NUM_FISHEYE_624: usize = 12;

/// Families of nerfstudio's `camera_model`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Family {
    Perspective,
    Equidistant,
    Fisheye624,
}

/// The lens of a frame for its image of `size` pixels; intrinsics for another size, `w` and `h`,
/// are scaled along each axis.
///
/// # Errors
/// A missing key, a value out of range, or a camera model without pinhole equivalent.
pub(super) fn from_json(top: &Object<'_>, frame: &Object<'_>, size: (u32, u32)) -> Result<Lens> {
    let stated =
        |key: &str| Ok::<_, eagpt_scene::SceneError>(frame.pixels(key)?.or(top.pixels(key)?));
    let stated_size = (
        stated("w")?.unwrap_or(size.0),
        stated("h")?.unwrap_or(size.1),
    );
    let pinhole = intrinsics::pinhole(
        Dialect::Nerfstudio,
        top,
        frame,
        stated_size,
        DAffine3::IDENTITY,
    )?;
    let (model, distortion) = distortion(top, frame)?;
    let mut params = vec![pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy];
    params.extend(distortion);
    let lens = Lens::new(model, stated_size, &params).and_then(|lens| lens.resized(size));
    lens.map_err(|problem| {
        frame
            .invalid("camera_model", format!("{model}: {problem}"))
            .into()
    })
}

fn family(top: &Object<'_>, frame: &Object<'_>) -> Result<Family> {
    for object in [frame, top] {
        let key = "is_fisheye";
        if let Some(value) = object.get(key) {
            match value.as_bool() {
                Some(true) => return Ok(Family::Equidistant),
                Some(false) => {}
                None => {
                    let problem = format!("{} is neither true nor false", excerpt(value));
                    return Err(object.invalid(key, problem).into());
                }
            }
        }
        let key = "camera_model";
        let Some(model) = object.string(key)? else {
            continue;
        };
        return match model.to_ascii_uppercase().as_str() {
            "SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" => {
                Ok(Family::Perspective)
            }
            "OPENCV_FISHEYE" => Ok(Family::Equidistant),
            "FISHEYE624" => Ok(Family::Fisheye624),
            _ => {
                let problem = format!(
                    "{}: no pinhole camera can take its place; perspective models, OPENCV_FISHEYE and FISHEYE624 are read",
                    excerpt(&model.into())
                );
                Err(object.unsupported(key, problem).into())
            }
        };
    }
    Ok(Family::Perspective)
}

/// The model with two focal lengths that has the frame's distortion, and its parameters after focal
/// lengths and principal point.
fn distortion(top: &Object<'_>, frame: &Object<'_>) -> Result<(LensModel, Vec<f64>)> {
    let family = family(top, frame)?;
    let listed = listed(top, frame)?;
    if family == Family::Fisheye624 {
        return match listed {
            Some(params) if params.len() == NUM_FISHEYE_624 => {
                Ok((LensModel::RadTanThinPrismFisheye, params))
            }
            _ => {
                let num = listed.map_or(0, |params| params.len());
                let problem = format!("{num} numbers, but FISHEYE624 has {NUM_FISHEYE_624}");
                Err(frame.invalid(PARAMS, problem).into())
            }
        };
    }
    let [k1, k2, k3, k4, p1, p2] = match listed {
        Some(params) => <[f64; COEFFICIENTS.len()]>::try_from(params.as_slice()).map_err(|_| {
            let problem = format!("{} numbers, not k1, k2, k3, k4, p1, p2", params.len());
            frame.invalid(PARAMS, problem)
        })?,
        None => {
            let mut values = [0.0; COEFFICIENTS.len()];
            for (value, key) in values.iter_mut().zip(COEFFICIENTS) {
                *value = intrinsics::lookup(top, frame, key)?.map_or(0.0, |(_, value)| value);
            }
            values
        }
    };
    let has_tangential = p1 != 0.0 || p2 != 0.0;
    Ok(match family {
        Family::Perspective if k4 != 0.0 => {
            let problem = format!("{k4:?}: a fourth radial coefficient of a perspective lens");
            return Err(frame.unsupported("k4", problem).into());
        }
        Family::Perspective if [k1, k2, k3, p1, p2] == [0.0; 5] => (LensModel::Pinhole, vec![]),
        Family::Perspective if k3 == 0.0 => (LensModel::OpenCv, vec![k1, k2, p1, p2]),
        Family::Perspective => (
            LensModel::FullOpenCv,
            vec![k1, k2, p1, p2, k3, 0.0, 0.0, 0.0],
        ),
        _ if has_tangential => (
            LensModel::ThinPrismFisheye,
            vec![k1, k2, p1, p2, k3, k4, 0.0, 0.0],
        ),
        _ => (LensModel::OpenCvFisheye, vec![k1, k2, k3, k4]),
    })
}

/// `distortion_params`, of the frame or of all.
fn listed(top: &Object<'_>, frame: &Object<'_>) -> Result<Option<Vec<f64>>> {
    for object in [frame, top] {
        if let Some(values) = object.array(PARAMS)? {
            let numbers = values.iter().enumerate().map(|(at, value)| {
                let number = value.as_f64().filter(|number| number.is_finite());
                number.ok_or_else(|| {
                    let problem = format!("{} is not a finite number", excerpt(value));
                    object.invalid(&format!("{PARAMS}[{at}]"), problem).into()
                })
            });
            return numbers.collect::<Result<_>>().map(Some);
        }
    }
    Ok(None)
}
