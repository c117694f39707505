//! Import of a source as our dataset.
//!
//! Light becomes linear Rec.709, cameras pinholes; images of a lens that distorts are resampled,
//! others keep their pixels. Negative radiances, from a source's noise or its wider primaries,
//! become 0 and are counted; values that are not finite make a bad frame.
//!
//! By default the pinhole image is a rectangle of known pixels. If it is chosen to show more, or if
//! the source has masks of valid pixels, [`VALID_DIR`] marks known pixels: 1 known, 0 not. Opacity
//! (`Alpha-exr`) is a different quantity: the coverage of a known pixel.

mod report;
mod view;

pub use crate::options::{BadFrames, ImportOptions, Ldr};
pub(crate) use report::LensReport;
pub use report::{ImportReport, REPORT_FILE, ViewReport};

use crate::error::{ConvertError, Problem, Result};
use crate::source::{SourceDataset, SourceFrame};
use crate::world;
use eagpt_scene::dataset::{
    ALBEDO_DIR, ALPHA_DIR, CLIPPED_DIR, DEPTH_DIR, DatasetWriter, EMISSION_DIR, NORMAL_DIR,
    POINTS_FILE, RADIANCE_DIR, TRANSFORMS_FILE, UpAxis, VALID_DIR,
};
use eagpt_scene::lens::Undistortion;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::{Lens, files, ply};
use glam::DMat3;
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use view::Imported;

/// Progress messages of the importer.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum ImportProgress {
    /// Views are being written.
    Importing {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A frame that cannot be used.
    Bad(Problem),
    /// A finding or decision.
    Note {
        /// The text, one line.
        text: String,
    },
    /// A warning about the result.
    Warning {
        /// The text, one line.
        text: String,
    },
}

/// Result of the importer.
#[derive(Debug, Clone)]
pub struct ImportSummary {
    /// Report of the import.
    pub report: ImportReport,
    /// Files written, relative to the dataset's folder.
    pub outputs: Vec<PathBuf>,
}

/// The files that an import may write, relative to the dataset's folder.
pub fn planned_files(source: &SourceDataset) -> Vec<PathBuf> {
    let mut planned: Vec<PathBuf> = [TRANSFORMS_FILE, REPORT_FILE].map(PathBuf::from).into();
    if source.points.is_some() {
        planned.push(POINTS_FILE.into());
    }
    for frame in &source.frames {
        let files = &frame.files;
        // A PNG may have an alpha channel, and clipped pixels as a JPEG.
        let is_display = !eagpt_scene::pictures::is_exr(&files.radiance);
        let kinds = [
            (RADIANCE_DIR, true),
            (ALPHA_DIR, files.alpha.is_some() || is_display),
            (CLIPPED_DIR, files.clipped.is_some() || is_display),
            (EMISSION_DIR, files.emission.is_some()),
            (NORMAL_DIR, files.normal.is_some()),
            (DEPTH_DIR, files.depth.is_some()),
            (ALBEDO_DIR, files.albedo.is_some()),
            (VALID_DIR, true),
        ];
        let there = kinds.into_iter().filter(|(_, is_there)| *is_there);
        planned.extend(there.map(|(folder, _)| image_file(folder, &frame.name)));
    }
    planned
}

fn image_file(folder: &str, name: &str) -> PathBuf {
    Path::new(folder).join(format!("{name}.exr"))
}

/// Imports a source into the folder `out`; as many views are in memory as there are threads.
///
/// # Errors
/// [`ConvertError::BadFrames`] with all frames that cannot be used, before anything is written
/// where no pixels are needed for that; an option out of range; a file that cannot be written.
pub fn import(
    source: &SourceDataset,
    out: &Path,
    options: &ImportOptions,
    progress: &mut dyn FnMut(ImportProgress),
) -> Result<ImportSummary> {
    options.validate()?;
    let mut source = source.clone();
    let lenses = Lenses::choose(&mut source, options)?;
    for problem in &source.problems {
        progress(ImportProgress::Bad(problem.clone()));
    }
    if source.frames.is_empty()
        || (!source.problems.is_empty() && options.bad_frames == BadFrames::Refuse)
    {
        return Err(source.bad_frames());
    }
    for text in &source.notes {
        progress(ImportProgress::Note { text: text.clone() });
    }
    let up = source.info.up_axis.unwrap_or_default();
    let importer = Importer {
        new_from_source: options.world.new_from_source(up),
        matrix: (!source.color.is_identity()).then(|| source.color.matrix()),
        lenses: &lenses,
    };
    let points = points(&source, importer.new_from_source)?;
    let mut writer = DatasetWriter::create(out, options.precision)?;
    let mut views = Vec::new();
    let total = source.frames.len();
    let mut num_done = 0;
    // Views are done in batches and listed in their order.
    for batch in source.frames.chunks(rayon::current_num_threads().max(1)) {
        let done: Vec<Result<Imported>> = batch
            .par_iter()
            .map(|frame| importer.view(frame, &writer))
            .collect();
        for (frame, outcome) in batch.iter().zip(done) {
            match outcome {
                Ok(imported) => {
                    writer.list(&frame.name, imported.camera);
                    views.push(imported.report);
                }
                Err(error) => {
                    let problem = Problem::new(&frame.name, error);
                    progress(ImportProgress::Bad(problem.clone()));
                    source.problems.push(problem);
                }
            }
            num_done += 1;
            progress(ImportProgress::Importing {
                done: num_done,
                total,
            });
        }
    }
    let has_failed = !source.problems.is_empty() && options.bad_frames == BadFrames::Refuse;
    if views.is_empty() || has_failed {
        source.frames.truncate(views.len());
        return Err(source.bad_frames());
    }
    if let Some(cloud) = &points {
        writer.write_points(cloud)?;
    }
    let mut info = source.info.clone();
    if options.world == world::World::ZUp {
        info.up_axis = Some(UpAxis::Z);
    }
    if let Some(rows) = &mut info.aligned_from_model {
        *rows = turned_rows(importer.new_from_source, rows);
    }
    let is_there = |name: &String| views.iter().any(|view: &ViewReport| view.name == *name);
    for list in info.lists_mut().into_iter().flatten() {
        list.retain(is_there);
    }
    writer.finish(&info)?;
    let mut report = ImportReport::new(&source, options, importer.new_from_source);
    report.lenses = lenses.report();
    report.num_points = points.as_ref().map(PointCloud::len);
    report.views = views;
    report.warn_of_views();
    for text in &report.warnings {
        progress(ImportProgress::Warning { text: text.clone() });
    }
    files::write_json(&out.join(REPORT_FILE), &report)?;
    let written = planned_files(&source).into_iter();
    Ok(ImportSummary {
        report,
        outputs: written.filter(|file| out.join(file).is_file()).collect(),
    })
}

/// The point cloud in the dataset's world.
fn points(source: &SourceDataset, new_from_source: DMat3) -> Result<Option<PointCloud>> {
    let Some(path) = &source.points else {
        return Ok(None);
    };
    let mut cloud = ply::read_points(path)?;
    for position in &mut cloud.positions {
        *position = (new_from_source * position.as_dvec3()).as_vec3();
    }
    Ok(Some(cloud))
}

/// Rows of a similarity into a rotated world.
fn turned_rows(turn: DMat3, rows: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    let mut new = *rows;
    for (r, row) in new.iter_mut().take(3).enumerate() {
        for (c, value) in row.iter_mut().enumerate() {
            *value = (0..3).map(|k| turn.col(k)[r] * rows[k][c]).sum();
        }
    }
    new
}

/// Pinhole cameras for the lenses of a source.
struct Lenses {
    chosen: Vec<Undistortion>,
}

impl Lenses {
    /// Chooses a pinhole for every lens; frames whose lens has none become bad ones.
    fn choose(source: &mut SourceDataset, options: &ImportOptions) -> Result<Self> {
        let mut chosen: Vec<Undistortion> = Vec::new();
        let mut failed: Vec<(Lens, String)> = Vec::new();
        let frames = std::mem::take(&mut source.frames);
        for frame in frames {
            let lens = frame.lens;
            if !chosen.iter().any(|c| *c.lens() == lens) && !failed.iter().any(|(f, _)| *f == lens)
            {
                match pinhole(&lens, options) {
                    Ok(undistortion) => chosen.push(undistortion),
                    Err(problem) => failed.push((lens, problem)),
                }
            }
            match failed.iter().find(|(f, _)| *f == lens) {
                Some((_, problem)) => source.problems.push(Problem::new(&frame.name, problem)),
                None => source.frames.push(frame),
            }
        }
        Ok(Self { chosen })
    }

    fn of(&self, lens: &Lens) -> Option<&Undistortion> {
        self.chosen.iter().find(|chosen| chosen.lens() == lens)
    }

    fn report(&self) -> Vec<LensReport> {
        self.chosen.iter().map(LensReport::new).collect()
    }
}

fn pinhole(lens: &Lens, options: &ImportOptions) -> Result<Undistortion, String> {
    let undistortion = Undistortion::new(lens, &options.undistort)?;
    let camera = undistortion.camera(glam::DAffine3::IDENTITY);
    let longest = camera.width.max(camera.height);
    match options.max_edge {
        Some(edge) if edge < longest => {
            let by = f64::from(edge) / f64::from(longest);
            let shrunk = |n: u32| ((f64::from(n) * by).round() as u32).max(1);
            undistortion.resized((shrunk(camera.width), shrunk(camera.height)))
        }
        _ => Ok(undistortion),
    }
}

struct Importer<'a> {
    new_from_source: DMat3,
    /// Of colours, if they change.
    matrix: Option<DMat3>,
    lenses: &'a Lenses,
}

impl Importer<'_> {
    /// Reads, converts and writes the images of a frame.
    fn view(&self, frame: &SourceFrame, writer: &DatasetWriter) -> Result<Imported> {
        let undistortion = self.lenses.of(&frame.lens).ok_or_else(|| {
            ConvertError::invalid(
                &frame.files.radiance,
                "lens",
                "no pinhole was chosen for it",
            )
        })?;
        let (view, imported) = view::convert(
            frame,
            undistortion,
            self.matrix.as_ref(),
            self.new_from_source,
        )?;
        writer.write_images(&view)?;
        Ok(imported)
    }
}
