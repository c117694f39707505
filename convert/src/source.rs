//! Datasets of other programs, read into one form.
//!
//! | format | what is read | world |
//! |---|---|---|
//! | [`fipt`] | `cam.txt`, `K_list.txt`, `Image/{i:03}_0001.exr` | y up |
//! | [`fipt_synthetic`] | `{train,val}/transforms.json`, `Image/`, `DiffCol/`, `Emit/` | z up |
//! | [`eyeful`] | `cameras.json`, `splits.json`, `images-*/` | y up, metres |
//! | [`nerfstudio`] | `transforms.json` and what it names; of instant-NGP and Blender as well | z up |
//! | [`eagpt`] | our own layout, that of EAG-PT | as stored |
//!
//! A reader reads cameras and headers of images, not pixels. It continues after a frame that cannot
//! be used and reports its problem.

pub(crate) mod eagpt;
pub(crate) mod eyeful;
pub(crate) mod fipt;
pub(crate) mod fipt_synthetic;
mod lens;
pub(crate) mod nerfstudio;

use crate::color::ColorTransform;
use crate::error::{Cause, ConvertError, Problem, Result};
use crate::options::ImportOptions;
use eagpt_scene::Lens;
use eagpt_scene::dataset::{DatasetInfo, POINTS_FILE, TRANSFORMS_FILE};
use eagpt_scene::pictures;
use glam::DAffine3;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// A layout that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum SourceFormat {
    /// Real scene of FIPT
    Fipt,
    /// Synthetic scene of FIPT
    FiptSynthetic,
    /// Scene of Eyeful Tower
    Eyeful,
    /// nerfstudio's transforms.json
    Nerfstudio,
    /// instant-NGP's transforms.json, Blender's transforms_train.json
    InstantNgp,
    /// Our own layout, that of EAG-PT
    Eagpt,
}

impl SourceFormat {
    /// All formats with their names in options.
    pub const ALL: [(Self, &'static str); 6] = [
        (Self::Fipt, "fipt"),
        (Self::FiptSynthetic, "fipt-synthetic"),
        (Self::Eyeful, "eyeful"),
        (Self::Nerfstudio, "nerfstudio"),
        (Self::InstantNgp, "instant-ngp"),
        (Self::Eagpt, "eagpt"),
    ];

    /// The name in options.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// Detects the layout of a folder or a `transforms.json`: from its files and their keys, never
    /// from the folder's name.
    ///
    /// # Errors
    /// [`ConvertError::UnknownFormat`], or a file that cannot be read.
    pub fn detect(path: &Path) -> Result<Self> {
        let has = |name: &str| path.join(name).is_file();
        if has(fipt::CAMERAS_FILE) && has(fipt::INTRINSICS_FILE) {
            return Ok(Self::Fipt);
        }
        if has("train/transforms.json") && path.join("train/Image").is_dir() {
            return Ok(Self::FiptSynthetic);
        }
        if has(eyeful::CAMERAS_FILE) {
            return Ok(Self::Eyeful);
        }
        if path.is_file() || has(TRANSFORMS_FILE) {
            return nerfstudio::dialect(path);
        }
        if has("transforms_train.json") {
            return Ok(Self::InstantNgp);
        }
        Err(ConvertError::UnknownFormat {
            path: path.to_owned(),
            problem: "there is neither cam.txt with K_list.txt, nor train/transforms.json with train/Image, nor cameras.json, \
                      nor transforms.json, nor transforms_train.json; --format names a layout"
                .to_owned(),
        })
    }
}

impl fmt::Display for SourceFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A dataset of another program, not loaded.
#[derive(Debug, Clone)]
pub struct SourceDataset {
    /// Its layout.
    pub format: SourceFormat,
    /// Its folder.
    pub root: PathBuf,
    /// The file of cameras, the first if there are several.
    pub cameras_file: PathBuf,
    /// Further files of cameras.
    pub more_cameras: Vec<PathBuf>,
    /// Frames that can be used, in the order of the file.
    pub frames: Vec<SourceFrame>,
    /// Up axis, unit, and the source's own split.
    pub info: DatasetInfo,
    /// A coloured point cloud.
    pub points: Option<PathBuf>,
    /// From the source's values to linear Rec.709.
    pub color: ColorTransform,
    /// Frames that cannot be used.
    pub problems: Vec<Problem>,
    /// A warning about the result.
    pub warnings: Vec<String>,
    /// Findings and decisions.
    pub notes: Vec<String>,
}

/// A posed image of a source.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceFrame {
    /// Unique name, no extension.
    pub name: String,
    /// The lens, for the size of the image.
    pub lens: Lens,
    /// Pose in the source's world, OpenCV axes.
    pub world_from_camera: DAffine3,
    /// Its files.
    pub(crate) files: SourceFiles,
}

/// The files of a frame; those that are there.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct SourceFiles {
    /// The photograph.
    pub radiance: PathBuf,
    /// Emission.
    pub(crate) emission: Option<Emission>,
    /// World-space normals.
    pub normal: Option<PathBuf>,
    /// Opacity.
    pub alpha: Option<PathBuf>,
    /// Depth along the optical axis.
    pub(crate) depth: Option<Depth>,
    /// Diffuse albedo, linear Rec.709.
    pub albedo: Option<PathBuf>,
    /// Mask of clipped channels; PNG and JPEG say themselves.
    pub clipped: Option<PathBuf>,
    /// Mask of pixels to use: not black.
    pub valid: Option<PathBuf>,
}

/// Source of a frame's emission mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Emission {
    /// A mask, 0 to 1.
    Mask(PathBuf),
    /// Emitted radiance: pixels above 0 are emitters.
    Radiance(PathBuf),
}

impl Emission {
    /// The file.
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::Mask(path) | Self::Radiance(path) => path,
        }
    }
}

/// A depth image and its unit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Depth {
    /// The file.
    pub path: PathBuf,
    /// Scene units that a value of 1 stands for.
    pub unit: f64,
}

impl SourceDataset {
    /// Reads the cameras of a source and finds its images. `format` absent: it is detected.
    ///
    /// # Errors
    /// [`ConvertError`]: a layout that is not there, a file that is wrong as a whole, no usable
    /// frame, an option that does not fit.
    pub fn open(
        path: &Path,
        format: Option<SourceFormat>,
        options: &ImportOptions,
    ) -> Result<Self> {
        options.validate()?;
        let format = match format {
            Some(format) => format,
            None => SourceFormat::detect(path)?,
        };
        if format != SourceFormat::Eyeful && options.scene.is_some() {
            let problem = "names a scene of Eyeful Tower, which this is not";
            return Err(ConvertError::option("scene", problem));
        }
        let mut source = match format {
            SourceFormat::Fipt => fipt::read(path, options),
            SourceFormat::FiptSynthetic => fipt_synthetic::read(path, options),
            SourceFormat::Eyeful => eyeful::read(path, options),
            SourceFormat::Nerfstudio | SourceFormat::InstantNgp => {
                nerfstudio::read(path, format, options)
            }
            SourceFormat::Eagpt => eagpt::read(path),
        }?;
        source.settle(options)?;
        Ok(source)
    }

    fn new(format: SourceFormat, root: &Path, cameras_file: PathBuf) -> Self {
        Self {
            format,
            root: root.to_owned(),
            cameras_file,
            more_cameras: Vec::new(),
            frames: Vec::new(),
            info: DatasetInfo::default(),
            points: None,
            color: ColorTransform::default(),
            problems: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Number of frames, usable or not.
    pub fn num_frames(&self) -> usize {
        self.frames.len() + self.problems.len()
    }

    /// The files of cameras.
    pub fn camera_files(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.cameras_file).chain(&self.more_cameras)
    }

    /// All files that an import reads.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut all: Vec<PathBuf> = self.camera_files().cloned().collect();
        all.extend(self.points.clone());
        for frame in &self.frames {
            let files = &frame.files;
            all.push(files.radiance.clone());
            all.extend(files.emission.as_ref().map(|e| e.path().to_owned()));
            all.extend(files.depth.as_ref().map(|depth| depth.path.clone()));
            let others = [
                &files.normal,
                &files.alpha,
                &files.albedo,
                &files.clipped,
                &files.valid,
            ];
            all.extend(others.into_iter().flatten().cloned());
        }
        all
    }

    /// Adds a frame, or its problem.
    fn add(&mut self, name: &str, frame: Result<SourceFrame>) {
        match frame {
            Ok(frame) => self.frames.push(frame),
            Err(error @ ConvertError::NoImage { .. }) => {
                let problem = Problem::caused(name, Cause::Missing, &error);
                self.problems.push(problem);
            }
            Err(error) => self.problems.push(Problem::new(name, &error)),
        }
    }

    /// Applies options and rules common to all formats.
    fn settle(&mut self, options: &ImportOptions) -> Result<()> {
        if let Some(gains) = options.white_balance {
            self.color.gains = gains;
        }
        self.color.scale *= options.radiance_scale;
        self.info.up_axis = options.up_axis.or(self.info.up_axis);
        self.info.metres_per_unit = options.metres_per_unit.or(self.info.metres_per_unit);
        if self.num_frames() == 0 {
            return Err(ConvertError::invalid(&self.cameras_file, "frames", "none"));
        }
        self.check_names()?;
        self.set_aside_display_referred(options);
        if self.frames.is_empty() {
            return Err(self.bad_frames());
        }
        let names: HashSet<&str> = self.frames.iter().map(|f| f.name.as_str()).collect();
        for list in self.info.lists_mut() {
            if let Some(listed) = list {
                let before = listed.len();
                listed.retain(|name| names.contains(name.as_str()));
                let num_lost = before - listed.len();
                if num_lost > 0 {
                    self.warnings.push(format!(
                        "{num_lost} of {before} names in the split of {} are not usable frames",
                        self.root.display()
                    ));
                }
                // An empty list is not a valid rule.
                if listed.is_empty() {
                    *list = None;
                }
            }
        }
        Ok(())
    }

    fn check_names(&self) -> Result<()> {
        let mut seen = HashSet::new();
        match self
            .frames
            .iter()
            .find(|frame| !seen.insert(frame.name.as_str()))
        {
            None => Ok(()),
            Some(twice) => {
                let problem = format!("two frames are called `{}`", twice.name.escape_debug());
                Err(ConvertError::invalid(&self.cameras_file, "frames", problem))
            }
        }
    }

    /// Eight-bit images are no measurement of light: they are imported only on request.
    fn set_aside_display_referred(&mut self, options: &ImportOptions) {
        let is_linear = |frame: &SourceFrame| pictures::is_exr(&frame.files.radiance);
        let num = self.frames.iter().filter(|frame| !is_linear(frame)).count();
        if num == 0 {
            return;
        }
        if options.ldr == crate::options::Ldr::Srgb {
            self.warnings.push(format!(
                "{num} of {} images are PNG or JPEG: decoded as sRGB, but lights are clipped at 1 and what the camera did to the curve is \
                 not undone; radiances are no measurement",
                self.num_frames()
            ));
            return;
        }
        let (kept, aside): (Vec<_>, Vec<_>) = std::mem::take(&mut self.frames)
            .into_iter()
            .partition(is_linear);
        self.frames = kept;
        self.problems.extend(aside.iter().map(|frame| {
            let path = frame.files.radiance.display();
            let extension = frame.files.radiance.extension();
            let cause = match extension.is_some_and(|e| e.eq_ignore_ascii_case("png")) {
                true => Cause::Png,
                false => Cause::Jpeg,
            };
            let problem =
                format!("{path}: not linear EXR; --ldr srgb decodes PNG and JPEG as sRGB");
            Problem::caused(&frame.name, cause, problem)
        }));
    }

    /// The error of all frames that cannot be used.
    pub fn bad_frames(&self) -> ConvertError {
        ConvertError::BadFrames {
            path: self.root.clone(),
            num_frames: self.num_frames(),
            problems: self.problems.clone(),
        }
    }
}

/// `path`, if the file exists.
fn if_there(path: PathBuf) -> Option<PathBuf> {
    path.is_file().then_some(path)
}

/// The point cloud beside the cameras, where every format may have one.
fn points_beside(root: &Path) -> Option<PathBuf> {
    if_there(root.join(POINTS_FILE))
}

/// The size of an image that must exist.
fn size_of(path: &Path) -> Result<(u32, u32)> {
    if !path.is_file() {
        return Err(ConvertError::NoImage {
            path: path.to_owned(),
        });
    }
    Ok(pictures::size(path)?)
}
