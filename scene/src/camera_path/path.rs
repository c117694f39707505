//! The cameras of a path, and the settings that they follow from.

use super::fly::{Fly, Pace};
use super::turntable::{Turntable, TurntableKeys};
use crate::camera::Camera;
use crate::dataset::Dataset;
use serde::Serialize;
use std::path::PathBuf;

/// Most frames that a path may have.
pub(super) const MAX_FRAMES: u32 = 100_000;
/// Most pixels that a frame may have along an axis.
pub(super) const MAX_SIZE: u32 = 16_384;
pub(super) const DEFAULT_FPS: f64 = 24.0;
pub(super) const DEFAULT_SECONDS: f64 = 5.0;

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

impl CameraPath {
    /// Width and height of the frames in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.cameras[0].width, self.cameras[0].height)
    }
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
pub(super) struct Common {
    pub(super) num_frames: u32,
    pub(super) fps: f64,
    pub(super) size: Option<(u32, u32)>,
    pub(super) fov_y_rad: Option<f64>,
    pub(super) ease: bool,
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
    pub(super) fn overridden(mut self, by: &PathOverrides) -> Self {
        self.num_frames = by.num_frames.unwrap_or(self.num_frames);
        self.size = by.size.or(self.size);
        self
    }

    /// A camera of the dataset as the path has it.
    pub(super) fn fitted(&self, camera: &Camera, first: &Camera) -> Camera {
        let (width, height) = self.size.unwrap_or((first.width, first.height));
        let camera = camera.resized(width, height);
        match self.fov_y_rad {
            Some(angle) => camera.with_vertical_fov(angle),
            None => camera,
        }
    }

    /// The cameras at times from 0 to 1: the first and the last camera of an open path are those of
    /// 0 and 1, a closed one ends a step before.
    pub(super) fn sampled(&self, closed: bool, camera: impl Fn(f64) -> Camera) -> Vec<Camera> {
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

/// The camera of a view, or the problem with its name.
pub(super) fn view(dataset: &Dataset, name: &str) -> Result<Camera, String> {
    let found = dataset.frames().iter().find(|frame| frame.name == name);
    found
        .map(|frame| frame.camera)
        .ok_or_else(|| dataset.no_such_view(name))
}

pub(super) fn fly(
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

pub(super) fn turntable(
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
