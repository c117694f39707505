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
mod path;
mod rotation;
mod spline;
mod turntable;

#[cfg(test)]
mod tests;

pub use fly::Pace;
pub use path::{CameraPath, PathOverrides, Route};
pub use turntable::Turntable;

use crate::dataset::Dataset;
use crate::error::{Result, SceneError};
use crate::files;
use crate::script::ScriptFile;
use path::{Common, MAX_FRAMES, MAX_SIZE, fly, turntable, view};
use std::path::Path;
use turntable::TurntableKeys;

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
