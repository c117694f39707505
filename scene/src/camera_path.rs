//! Camera paths: a camera for each frame of a flight through or around a scene.
//!
//! [`CameraPath::read`] takes the name of a file or a shorthand:
//!
//! | argument | path |
//! |---|---|
//! | `fly:A,B,C` | through the views A, B, C of the dataset; `fly:A,B,C,A` closes the loop |
//! | `turntable` | once around the point that the cameras of the dataset face |
//! | `*.json` | the cameras of a `camera_path.json` of nerfstudio, in the world of the scene |
//! | else | a TOML file |
//!
//! ```toml
//! frames = 120            # or seconds = 5; 5 seconds if nothing is said
//! fps = 24                # for `seconds`, and for a video of the frames
//! size = [960, 540]       # else that of the first view
//! fov_y = 50              # vertical field of view, degrees; else that of the views
//! ease = true             # starts and stops gently; else at full speed
//!
//! [fly]
//! views = ["0000", "0016", "0032"]
//! closed = false          # whether it goes back to the first view
//! pace = "even"           # constant speed, or "views": as long for every leg
//! ```
//!
//! or, instead of `[fly]`, every key optional:
//!
//! ```toml
//! [turntable]
//! centre = [1.0, 0.5, 0.9]   # else the point nearest to the optical axes of all cameras
//! radius = 2.5               # distance from the axis; else the largest circle within the cameras' hull, clear of walls
//! height = 0.6               # above the centre; else the mean of the cameras'
//! look_at = [1.0, 0.5, 0.9]  # else the centre
//! up = "z"                   # the axis of rotation; else up in the dataset
//! start = 0                  # degrees; 0 is the first camera's position
//! degrees = 360              # counter-clockwise seen from above if positive
//! ```
//!
//! A closed path, and a turntable that turns by whole turns, end one step before they would come
//! back to the first frame, so that frames can be played in a loop; others begin and end with their
//! first and last camera.

mod file;
mod fly;
mod nerfstudio;
mod rotation;
mod spline;
mod turntable;

#[cfg(test)]
mod tests;

pub use fly::Pace;
pub use turntable::Turntable;

use crate::camera::Camera;
use crate::dataset::Dataset;
use crate::error::{Result, SceneError};
use crate::files;
use crate::script::ScriptFile;
use fly::Fly;
use serde::Serialize;
use std::path::{Path, PathBuf};
use turntable::TurntableKeys;

/// Most frames that a path may have.
const MAX_FRAMES: u32 = 100_000;
/// Most pixels that a frame may have along an axis.
const MAX_SIZE: u32 = 16_384;
const DEFAULT_FPS: f64 = 24.0;
const DEFAULT_SECONDS: f64 = 5.0;

/// The cameras of a path in order, and its settings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraPath {
    /// The file it was read from; `None` for a shorthand.
    #[serde(skip)]
    pub file: Option<PathBuf>,
    /// Frames a second: how fast the frames are meant to be shown.
    pub fps: f64,
    /// Eases at its start and end.
    pub ease: bool,
    /// Its route.
    pub route: Route,
    /// Frames in order; at least one, all of one size.
    #[serde(skip)]
    pub cameras: Vec<Camera>,
}

/// The route of a path, with defaults filled in.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Route {
    /// Through views of a dataset.
    Fly {
        /// Their names.
        views: Vec<String>,
        /// Returns to the first.
        closed: bool,
        /// Its speed.
        pace: Pace,
    },
    /// Around a point.
    Turntable(Turntable),
    /// A camera for each frame, as the file says.
    Listed,
}

/// Settings of a caller that replace those of a path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PathOverrides {
    /// Number of frames.
    pub num_frames: Option<u32>,
    /// Width and height of a frame in pixels; the vertical field of view stays.
    pub size: Option<(u32, u32)>,
}

/// Settings that all kinds of paths have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Common {
    num_frames: u32,
    fps: f64,
    size: Option<(u32, u32)>,
    fov_y_rad: Option<f64>,
    ease: bool,
}

impl Default for Common {
    fn default() -> Self {
        Self {
            num_frames: (DEFAULT_SECONDS * DEFAULT_FPS) as u32,
            fps: DEFAULT_FPS,
            size: None,
            fov_y_rad: None,
            ease: false,
        }
    }
}

impl Common {
    fn overridden(mut self, by: &PathOverrides) -> Self {
        self.num_frames = by.num_frames.unwrap_or(self.num_frames);
        self.size = by.size.or(self.size);
        self
    }

    /// A camera of the dataset as the path has it.
    fn fitted(&self, camera: &Camera, first: &Camera) -> Camera {
        let (width, height) = self.size.unwrap_or((first.width, first.height));
        let camera = camera.resized(width, height);
        match self.fov_y_rad {
            Some(angle) => camera.with_vertical_fov(angle),
            None => camera,
        }
    }

    /// The cameras at times from 0 to 1: the first and the last camera of an open path are those of
    /// 0 and 1, a closed one ends a step before.
    fn sampled(&self, closed: bool, camera: impl Fn(f64) -> Camera) -> Vec<Camera> {
        let num = self.num_frames;
        let num_steps = if closed { num } else { num.max(2) - 1 };
        let times = (0..num).map(|frame| f64::from(frame) / f64::from(num_steps));
        times
            .map(|time| {
                camera(if self.ease {
                    time * time * (3.0 - 2.0 * time)
                } else {
                    time
                })
            })
            .collect()
    }
}

impl CameraPath {
    /// Reads and checks a path, and works out its cameras.
    ///
    /// # Errors
    /// [`SceneError`] in one line: of a TOML file with file, line, key and value; of a shorthand
    /// with the dataset, whose views it names. A view that is not there, views at the same place,
    /// numbers that cannot be, cameras that look at nothing in common where a centre is needed.
    pub fn read(argument: &str, dataset: &Dataset, overrides: &PathOverrides) -> Result<Self> {
        check_overrides(argument, overrides)?;
        let common = Common::default().overridden(overrides);
        let problem = |problem| SceneError::invalid(dataset.transforms(), argument, problem);
        if argument == "turntable" {
            return turntable(dataset, TurntableKeys::default(), &common).map_err(problem);
        }
        if let Some(list) = argument.strip_prefix("fly:") {
            let mut names: Vec<&str> = list.split(',').collect();
            let closed = names.len() > 2 && names.first() == names.last();
            if closed {
                names.pop();
            }
            let keys = names.iter().map(|name| view(dataset, name));
            let keys = keys.collect::<Result<Vec<_>, _>>().map_err(problem)?;
            let names = names.iter().map(|&name| name.to_owned()).collect();
            return fly(names, &keys, closed, Pace::default(), &common).map_err(problem);
        }
        let file = Path::new(argument);
        let bytes = files::read(file)?;
        let path = if file.extension().is_some_and(|e| e == "json") {
            nerfstudio::read(file, &bytes, overrides)?
        } else {
            file::read(&ScriptFile::new(file, bytes)?, dataset, overrides)?
        };
        Ok(Self {
            file: Some(file.to_owned()),
            ..path
        })
    }

    /// The path of a `camera_path.json` of nerfstudio in memory, called `file`.
    ///
    /// # Errors
    /// [`SceneError`] naming file, key and value.
    pub fn of_nerfstudio(file: &Path, bytes: &[u8]) -> Result<Self> {
        nerfstudio::read(file, bytes, &PathOverrides::default())
    }

    /// Width and height of the frames in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.cameras[0].width, self.cameras[0].height)
    }
}

fn check_overrides(argument: &str, overrides: &PathOverrides) -> Result<()> {
    let refuse =
        |field: &str, problem| Err(SceneError::invalid(Path::new(argument), field, problem));
    if let Some(num) = overrides.num_frames
        && !(1..=MAX_FRAMES).contains(&num)
    {
        return refuse("frames", format!("{num} is outside 1 to {MAX_FRAMES}"));
    }
    if let Some((width, height)) = overrides.size
        && ![width, height]
            .iter()
            .all(|size| (1..=MAX_SIZE).contains(size))
    {
        return refuse(
            "size",
            format!("{width}x{height} is outside 1x1 to {MAX_SIZE}x{MAX_SIZE}"),
        );
    }
    Ok(())
}

/// The camera of a view, or the problem with its name.
fn view(dataset: &Dataset, name: &str) -> Result<Camera, String> {
    let found = dataset.frames().iter().find(|frame| frame.name == name);
    found
        .map(|frame| frame.camera)
        .ok_or_else(|| dataset.no_such_view(name))
}

fn fly(
    views: Vec<String>,
    keys: &[Camera],
    closed: bool,
    pace: Pace,
    common: &Common,
) -> Result<CameraPath, String> {
    let fitted = keys.iter().map(|key| common.fitted(key, &keys[0]));
    let curve = Fly::new(&fitted.collect::<Vec<_>>(), closed, pace)?;
    Ok(CameraPath {
        file: None,
        fps: common.fps,
        ease: common.ease,
        cameras: common.sampled(closed, |time| curve.camera(time)),
        route: Route::Fly {
            views,
            closed,
            pace,
        },
    })
}

fn turntable(
    dataset: &Dataset,
    keys: TurntableKeys,
    common: &Common,
) -> Result<CameraPath, String> {
    let cameras: Vec<Camera> = dataset.frames().iter().map(|frame| frame.camera).collect();
    let table = keys.resolve(&cameras, dataset.up())?;
    let lens = common.fitted(&cameras[0], &cameras[0]);
    Ok(CameraPath {
        file: None,
        fps: common.fps,
        ease: common.ease,
        cameras: common.sampled(table.is_closed(), |time| table.camera(&lens, time)),
        route: Route::Turntable(table),
    })
}
