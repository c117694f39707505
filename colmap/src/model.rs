//! COLMAP's sparse models: data types, and their text and binary files.
//!
//! [`Model::read`] takes a folder with `cameras`, `images` and `points3D`, and `rigs` and `frames`
//! where they are (COLMAP 3.12 and later), as `.bin` or `.txt`; a folder with both is read as
//! binary, as COLMAP does. [`Model::write`] writes either form.
//!
//! Memory is about that of the binary files; with [`Observations::Skip`], 64 bytes a point and 150
//! an image, whatever was observed.

mod binary;
mod fields;
mod read;
mod records;
mod rigid;
mod text;
mod write;

#[cfg(test)]
mod tests;

pub use read::read_part;
pub use rigid::{Rigid, Similarity};

use crate::error::Result;
use eagpt_scene::Lens;
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};

/// Declares an id.
macro_rules! id {
    ($(#[$doc:meta])* $name:ident($inner:ty)) => {
        $(#[$doc])*
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
        )]
        pub struct $name(pub $inner);

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

id!(
    /// Number of a camera in its model.
    CameraId(u32)
);
id!(
    /// Number of an image in its model.
    ImageId(u32)
);
id!(
    /// Number of a point in its model.
    PointId(u64)
);
id!(
    /// Number of a rig in its model.
    RigId(u32)
);
id!(
    /// Number of a frame in its model.
    FrameId(u32)
);

/// A camera: a lens that images share.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelCamera {
    /// Number.
    pub id: CameraId,
    /// Lens, for the size of the images that COLMAP saw.
    pub lens: Lens,
}

/// A registered image.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelImage {
    /// Number.
    pub id: ImageId,
    /// Pose.
    pub camera_from_world: Rigid,
    /// Camera.
    pub camera: CameraId,
    /// Path of the file, relative to the folder of images.
    pub name: String,
    /// Features; empty if they were skipped.
    pub observations: Vec<Observation>,
}

/// A feature of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Position, pixels from the image's corner.
    pub at: DVec2,
    /// The point it shows, if it was triangulated.
    pub point: Option<PointId>,
}

/// A triangulated point.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelPoint {
    /// Number.
    pub id: PointId,
    /// Position in the world.
    pub position: DVec3,
    /// 8-bit sRGB colour.
    pub color_srgb8: [u8; 3],
    /// Mean reprojection error, pixels; −1 if COLMAP did not compute it.
    pub error_px: f64,
    /// Number of observations.
    pub track_length: u32,
    /// Observations; empty if they were skipped.
    pub track: Vec<TrackElement>,
}

/// An observation, as a point has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrackElement {
    /// The image.
    pub image: ImageId,
    /// Index among the image's observations.
    pub observation: u32,
}

/// Type of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(i8)]
pub(crate) enum SensorType {
    /// None
    Invalid = -1,
    /// A camera; its number is that of a [`ModelCamera`]
    Camera = 0,
    /// An inertial unit
    Imu = 1,
}

/// A sensor of a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct SensorId {
    /// Kind.
    pub(crate) kind: SensorType,
    /// Number among its kind.
    pub number: u32,
}

/// Sensors that move together.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Number.
    pub id: RigId,
    /// The sensor whose pose is the rig's; a rig without sensors has none.
    pub(crate) reference: Option<SensorId>,
    /// The other sensors and their poses in the rig, where known.
    pub(crate) others: Vec<(SensorId, Option<Rigid>)>,
}

/// A rig at an instant.
#[derive(Debug, Clone, PartialEq)]
pub struct RigFrame {
    /// Number.
    pub id: FrameId,
    /// Rig.
    pub rig: RigId,
    /// Pose.
    pub rig_from_world: Rigid,
    /// Recorded data: a sensor and the number of its datum, for cameras that of an image.
    pub(crate) data: Vec<(SensorId, u64)>,
}

/// A sparse model. Lists are in the order of the files.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Model {
    /// Cameras.
    pub cameras: Vec<ModelCamera>,
    /// Registered images.
    pub images: Vec<ModelImage>,
    /// Points.
    pub points: Vec<ModelPoint>,
    /// Rigs; `None` where the model has no such file.
    pub rigs: Option<Vec<Rig>>,
    /// Frames; `None` where the model has no such file.
    pub frames: Option<Vec<RigFrame>>,
}

/// Whether to keep the observations of points by images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Observations {
    /// Yes: the model can be written.
    Keep,
    /// No: the model takes little memory.
    Skip,
}

/// The two forms of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `.bin`
    Binary,
    /// `.txt`
    Text,
}

/// The files of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// `cameras`
    Cameras,
    /// `images`
    Images,
    /// `points3D`
    Points,
    /// `rigs`
    Rigs,
    /// `frames`
    Frames,
}

impl Form {
    /// The form of the model in `dir`, if there is one.
    pub fn of(dir: &Path) -> Option<Self> {
        [Self::Binary, Self::Text].into_iter().find(|form| {
            Part::NEEDED
                .iter()
                .all(|part| part.path(dir, *form).is_file())
        })
    }
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 5] = [
        Self::Cameras,
        Self::Images,
        Self::Points,
        Self::Rigs,
        Self::Frames,
    ];
    /// Parts that every model has.
    pub const NEEDED: [Self; 3] = [Self::Cameras, Self::Images, Self::Points];

    /// The file in `dir`.
    pub fn path(self, dir: &Path, form: Form) -> PathBuf {
        let stem = match self {
            Self::Cameras => "cameras",
            Self::Images => "images",
            Self::Points => "points3D",
            Self::Rigs => "rigs",
            Self::Frames => "frames",
        };
        dir.join(stem).with_extension(match form {
            Form::Binary => "bin",
            Form::Text => "txt",
        })
    }
}

impl Model {
    /// Reads the model in a folder.
    ///
    /// # Errors
    /// [`crate::ColmapError`]: no model in the folder, or one line with file and byte or line of
    /// what is truncated, out of range, not finite, duplicated, or a dangling reference.
    pub fn read(dir: &Path, observations: Observations) -> Result<Self> {
        read::read(dir, observations)
    }

    /// Writes the model into a folder, which is created; each file atomically. A stale `rigs` or
    /// `frames` file, also of the other form, is removed.
    ///
    /// # Errors
    /// [`crate::ColmapError`] naming the file, or that the observations were skipped.
    pub fn write(&self, dir: &Path, form: Form) -> Result<()> {
        write::write(self, dir, form)
    }

    /// The camera of a number. Every image of a model that was read has its camera.
    pub fn camera(&self, id: CameraId) -> Option<&ModelCamera> {
        self.cameras.iter().find(|camera| camera.id == id)
    }

    /// Transforms the world: positions, images, frames, and the sizes of rigs. What cameras see is
    /// unchanged.
    pub fn transform(&mut self, new_from_old: &Similarity) {
        for image in &mut self.images {
            image.camera_from_world = new_from_old.camera_from_new(&image.camera_from_world);
        }
        for point in &mut self.points {
            point.position = new_from_old.apply(point.position);
        }
        for frame in self.frames.iter_mut().flatten() {
            frame.rig_from_world = new_from_old.camera_from_new(&frame.rig_from_world);
        }
        for rig in self.rigs.iter_mut().flatten() {
            for (_, sensor_from_rig) in &mut rig.others {
                if let Some(pose) = sensor_from_rig {
                    pose.translation *= new_from_old.scale;
                }
            }
        }
    }
}
