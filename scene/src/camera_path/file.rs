//! Camera paths in TOML files.

use super::fly::Pace;
use super::path::{
    CameraPath, Common, DEFAULT_FPS, DEFAULT_SECONDS, MAX_FRAMES, MAX_SIZE, PathOverrides, fly,
    turntable, view,
};
use super::turntable::TurntableKeys;
use crate::dataset::Dataset;
use crate::error::Result;
use crate::script::value::{Array, Number, Whole};
use crate::script::{ScriptFile, Spanned};
use serde::Deserialize;

/// Frames a second are at most this.
const MAX_FPS: f64 = 1000.0;

/// A path as its file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathKeys {
    frames: Option<Whole<1, MAX_FRAMES>>,
    seconds: Option<Spanned<Number>>,
    fps: Option<Spanned<Number>>,
    size: Option<Array<Whole<1, MAX_SIZE>, 2>>,
    fov_y: Option<Spanned<Number>>,
    #[serde(default)]
    ease: bool,
    fly: Option<FlyKeys>,
    turntable: Option<Spanned<TurntableKeys>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlyKeys {
    views: Spanned<Vec<Spanned<String>>>,
    #[serde(default)]
    closed: bool,
    #[serde(default)]
    pace: Pace,
}

pub(super) fn read(
    file: &ScriptFile,
    dataset: &Dataset,
    overrides: &PathOverrides,
) -> Result<CameraPath> {
    let keys: PathKeys = file.parse()?;
    let common = keys.common(file)?.overridden(overrides);
    match (keys.fly, keys.turntable) {
        (Some(keys), None) => keys.path(file, dataset, &common),
        (None, Some(keys)) => {
            let span = keys.span();
            turntable(dataset, keys.into_inner(), &common)
                .map_err(|problem| file.error(span, problem))
        }
        (None, None) => {
            let top = 0..file.text().len();
            Err(file.error(top, "one of fly, turntable is missing"))
        }
        (Some(_), Some(keys)) => {
            let problem = "`turntable` is one too many: only one of fly, turntable";
            Err(file.error(keys.span(), problem))
        }
    }
}

impl PathKeys {
    fn common(&self, file: &ScriptFile) -> Result<Common> {
        let within =
            |number: &Option<Spanned<Number>>, valid: &dyn Fn(f64) -> bool, range: &str| {
                let Some(number) = number else {
                    return Ok(None);
                };
                let value = f64::from(*number.get_ref());
                match valid(value) {
                    true => Ok(Some(value)),
                    false => Err(file.error(number.span(), format!("{value} is not {range}"))),
                }
            };
        let fps = within(
            &self.fps,
            &|fps| fps > 0.0 && fps <= MAX_FPS,
            &format!("above 0 and at most {MAX_FPS}"),
        )?;
        let fps = fps.unwrap_or(DEFAULT_FPS);
        let fov_y = within(
            &self.fov_y,
            &|degrees| degrees > 0.0 && degrees < 180.0,
            "between 0 and 180 degrees",
        )?;
        let num_frames = match (self.frames, &self.seconds) {
            (Some(_), Some(seconds)) => {
                let problem = "a path has `frames` or `seconds`, not both";
                return Err(file.error(seconds.span(), problem));
            }
            (Some(frames), None) => frames.into(),
            (None, Some(seconds)) => {
                let (span, seconds) = (seconds.span(), f64::from(*seconds.get_ref()));
                let num = (seconds * fps).round();
                if !(1.0..=f64::from(MAX_FRAMES)).contains(&num) {
                    return Err(file.error(
                        span,
                        format!(
                            "{seconds} at {fps} frames a second are {num} frames, not 1 to {MAX_FRAMES}"
                        ),
                    ));
                }
                num as u32
            }
            (None, None) => ((DEFAULT_SECONDS * fps).round() as u32).max(1),
        };
        Ok(Common {
            num_frames,
            fps,
            size: self.size.map(|size| <[u32; 2]>::from(size).into()),
            fov_y_rad: fov_y.map(f64::to_radians),
            ease: self.ease,
        })
    }
}

impl FlyKeys {
    fn path(self, file: &ScriptFile, dataset: &Dataset, common: &Common) -> Result<CameraPath> {
        let Self {
            views,
            closed,
            pace,
        } = self;
        let span = views.span();
        let (mut names, mut cameras) = (Vec::new(), Vec::new());
        for name in views.into_inner() {
            let camera = view(dataset, name.get_ref());
            cameras.push(camera.map_err(|problem| file.error(name.span(), problem))?);
            names.push(name.into_inner());
        }
        fly(names, &cameras, closed, pace, common).map_err(|problem| file.error(span, problem))
    }
}
