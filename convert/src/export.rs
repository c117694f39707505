//! Our dataset in the layouts of other programs.
//!
//! | format | what is written | read by |
//! |---|---|---|
//! | colmap | `sparse/0/` (binary), `images/` | whatever reads a COLMAP project |
//! | nerfstudio | `transforms.json`, `images/`, `sparse_pc.ply` | nerfstudio, brush, and we |
//! | eagpt | `transforms.json`, `Radiance-exr/` | EAG-PT, and we |
//!
//! The world stays as it is: poses and points have the digits of the dataset, and a dataset that
//! was imported goes back to the same cameras. Images are copied byte by byte. COLMAP and
//! nerfstudio have no place for emission masks, normals, depths and albedos; these are put into our
//! own folders beside, where an import finds them.

mod colmap;
mod nerfstudio;

use crate::error::{ConvertError, Result};
use eagpt_scene::dataset::{POINTS_FILE, RADIANCE_DIR, TRANSFORMS_FILE, write_transforms};
use eagpt_scene::{Camera, Dataset, Frame, SceneError, files};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Folder of the photographs for programs that are not ours.
const IMAGES_DIR: &str = "images";

/// A layout that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum ExportFormat {
    /// A COLMAP project: sparse/0 (binary, pinhole cameras, points without tracks) and images
    Colmap,
    /// nerfstudio's transforms.json, images and sparse_pc.ply
    Nerfstudio,
    /// EAG-PT's folder, ours
    Eagpt,
}

/// Whether images are copied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Images {
    /// All of them
    #[default]
    Copy,
    /// None: cameras and points alone
    ///
    /// Paths in the files name the images that would be there.
    None,
}

/// Progress messages of the job.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum ExportProgress {
    /// Views are being copied.
    Exporting {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A warning about the result.
    Warning {
        /// The text, one line.
        text: String,
    },
}

/// Result of the job.
#[derive(Debug, Clone)]
pub struct ExportSummary {
    /// Files written, relative to the folder of results.
    pub outputs: Vec<PathBuf>,
    /// Warnings that were reported.
    pub warnings: Vec<String>,
    /// Points written.
    pub num_points: usize,
}

/// A file to copy and where to, relative to the folder of results.
struct Copy {
    from: PathBuf,
    to: PathBuf,
}

/// The files that an export writes, relative to its folder.
pub fn planned_files(dataset: &Dataset, format: ExportFormat, images: Images) -> Vec<PathBuf> {
    let mut planned: Vec<PathBuf> = match format {
        ExportFormat::Colmap => colmap::model_files(),
        ExportFormat::Nerfstudio | ExportFormat::Eagpt => vec![TRANSFORMS_FILE.into()],
    };
    if dataset.points_file().is_some() {
        match format {
            ExportFormat::Colmap => {}
            ExportFormat::Nerfstudio => planned.push(nerfstudio::POINTS_FILE.into()),
            ExportFormat::Eagpt => planned.push(POINTS_FILE.into()),
        }
    }
    if images == Images::Copy {
        let copies = dataset.frames().iter();
        let copies = copies.flat_map(|frame| copies_of(frame, format));
        planned.extend(copies.map(|copy| copy.to));
    }
    planned
}

/// The images of a frame and where they go.
fn copies_of(frame: &Frame, format: ExportFormat) -> Vec<Copy> {
    let photographs = match format {
        ExportFormat::Colmap | ExportFormat::Nerfstudio => IMAGES_DIR,
        ExportFormat::Eagpt => RADIANCE_DIR,
    };
    let file = format!("{}.exr", frame.name);
    let copy = |(folder, from): (&str, &PathBuf)| {
        let folder = if folder == RADIANCE_DIR {
            photographs
        } else {
            folder
        };
        Copy {
            from: from.clone(),
            to: Path::new(folder).join(&file),
        }
    };
    frame.files.all().map(copy).collect()
}

/// Writes a dataset for another program into the folder `out`; images pass through a buffer, never
/// whole.
///
/// # Errors
/// [`ConvertError`]: a file that cannot be read or written, or a camera that the format cannot
/// hold.
pub fn export(
    dataset: &Dataset,
    format: ExportFormat,
    images: Images,
    out: &Path,
    progress: &mut dyn FnMut(ExportProgress),
) -> Result<ExportSummary> {
    let mut warnings = Vec::new();
    let points = dataset.points()?;
    files::create_dir(out)?;
    if images == Images::Copy {
        let total = dataset.len();
        for (index, frame) in dataset.frames().iter().enumerate() {
            for copy in copies_of(frame, format) {
                copy_file(&copy.from, &out.join(&copy.to))?;
            }
            let done = index + 1;
            progress(ExportProgress::Exporting { done, total });
        }
    }
    match format {
        ExportFormat::Colmap => colmap::write(dataset, points.as_ref(), out)?,
        ExportFormat::Nerfstudio => nerfstudio::write(dataset, points.as_ref(), out)?,
        ExportFormat::Eagpt => {
            if let Some(points) = &points {
                eagpt_scene::ply::write_points(&out.join(POINTS_FILE), points)?;
            }
            let frames = dataset.frames().iter();
            let cameras: Vec<(String, Camera)> =
                frames.map(|f| (f.name.clone(), f.camera)).collect();
            write_transforms(&out.join(TRANSFORMS_FILE), &cameras, &dataset.info())?;
        }
    }
    warnings.extend(cautions(dataset, format, points.is_some()));
    for text in &warnings {
        progress(ExportProgress::Warning { text: text.clone() });
    }
    let written = planned_files(dataset, format, images).into_iter();
    Ok(ExportSummary {
        outputs: written.filter(|file| out.join(file).is_file()).collect(),
        warnings,
        num_points: points.map_or(0, |points| points.len()),
    })
}

/// Warnings about data that the target program cannot represent.
fn cautions(dataset: &Dataset, format: ExportFormat, has_points: bool) -> Vec<String> {
    let mut texts = Vec::new();
    if !has_points {
        texts.push("the dataset has no point cloud, and neither has the export".to_owned());
    }
    let num_normals = |f: &&Frame| f.files.normal.is_none();
    let num_without = dataset.frames().iter().filter(num_normals).count();
    match format {
        ExportFormat::Colmap => texts.push(
            "the photographs are linear EXR, which few readers of COLMAP projects know; points have no track: no image observes them"
                .to_owned(),
        ),
        ExportFormat::Eagpt if num_without > 0 => texts.push(format!(
            "{num_without} views have no normals, without which the released code of EAG-PT does not load a dataset"
        )),
        ExportFormat::Nerfstudio | ExportFormat::Eagpt => {}
    }
    texts
}

fn copy_file(from: &Path, to: &Path) -> Result<()> {
    files::create_parent(to)?;
    let mut source = File::open(from).map_err(|e| SceneError::io(from, "read", e))?;
    files::write_atomic(to, |file| {
        std::io::copy(&mut source, file)
            .map(|_| ())
            .map_err(|e| SceneError::io(to, "write", e))
    })
    .map_err(ConvertError::from)
}
