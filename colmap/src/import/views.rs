//! Views: their files found, read, undistorted, written.

use super::images::{Folder, ImageFile};
use super::{Condition, ImportOptions, ImportProgress, Missing, listed, undistortion};
use crate::error::{ColmapError, Result};
use crate::model::{CameraId, Model};
use eagpt_scene::dataset::{ALPHA_DIR, DatasetWriter, EMISSION_DIR, RADIANCE_DIR, VALID_DIR, View};
use eagpt_scene::lens::Undistortion;
use eagpt_scene::{Image, exr};
use glam::DAffine3;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Tolerance between the aspect ratios of an image and its camera: sizes are rounded to whole
/// pixels.
const MAX_ASPECT_ERROR: f64 = 0.01;

/// A view to be written.
#[derive(Debug)]
pub(super) struct Photograph {
    /// Name of the view.
    pub(super) name: String,
    /// Index of the image in the model.
    pub(super) image: usize,
    pub(super) undistortion: Undistortion,
    /// Whether some pixels may be unknown.
    may_be_cut: bool,
    files: Option<Files>,
}

#[derive(Debug)]
struct Files {
    radiance: ImageFile,
    emission: Option<PathBuf>,
    alpha: Option<PathBuf>,
}

impl Photograph {
    pub(super) fn is_srgb8(&self) -> bool {
        let files = self.files.as_ref();
        files.is_some_and(|files| matches!(files.radiance, ImageFile::Srgb8(_)))
    }

    /// Files that are read.
    pub(super) fn sources(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.iter().flat_map(|files| {
            let others = files.emission.iter().chain(&files.alpha);
            std::iter::once(files.radiance.path()).chain(others)
        })
    }

    /// Files that are written, relative to the dataset.
    pub(super) fn targets(&self) -> Vec<PathBuf> {
        let Some(files) = &self.files else {
            return Vec::new();
        };
        let folders = [
            (RADIANCE_DIR, true),
            (EMISSION_DIR, files.emission.is_some()),
            (
                ALPHA_DIR,
                files.alpha.is_some() || matches!(files.radiance, ImageFile::Srgb8(_)),
            ),
            (VALID_DIR, self.may_be_cut),
        ];
        let used = folders.into_iter().filter(|(_, used)| *used);
        used.map(|(folder, _)| Path::new(folder).join(format!("{}.exr", self.name)))
            .collect()
    }
}

/// Names of views of a model's images: those of the files, without extension.
///
/// # Errors
/// If two are the same or one cannot be the name of a view.
pub(super) fn names(path: &Path, model: &Model) -> Result<Vec<String>> {
    let mut first = HashMap::new();
    let mut names = Vec::with_capacity(model.images.len());
    for image in &model.images {
        let clean = image.name.replace('\\', "/");
        let clean = clean.trim_start_matches("./");
        let folder = clean.rfind('/').map_or(0, |slash| slash + 1);
        let stem = match clean[folder..].rfind('.') {
            Some(dot) if dot > 0 => &clean[..folder + dot],
            _ => clean,
        };
        let plain = stem.split('/').all(|part| !matches!(part, "" | "." | ".."));
        if !plain || stem.contains(char::is_control) {
            let problem = format!("`{}` cannot name a view", image.name.escape_debug());
            return Err(ColmapError::invalid(path, problem));
        }
        if let Some(other) = first.insert(stem.to_owned(), &image.name) {
            let problem = format!("`{other}` and `{}` would be one view", image.name);
            return Err(ColmapError::invalid(path, problem));
        }
        names.push(stem.to_owned());
    }
    Ok(names)
}

/// Missing images by cause, with the option that helps.
fn by_cause(folder: &Folder, missing: &[String]) -> String {
    let (refused, absent): (Vec<String>, Vec<String>) = missing
        .iter()
        .cloned()
        .partition(|name| folder.has_refused(name));
    let causes = [
        (&refused, "PNG or JPEG, for --ldr srgb to decode"),
        (&absent, "missing, for --skip-missing to leave out"),
    ];
    let told = causes.iter().filter(|(names, _)| !names.is_empty());
    let told = told.map(|(names, what)| format!("{} {what}: {}", names.len(), listed(names)));
    told.collect::<Vec<_>>().join("; ")
}

/// Finds photographs and collects their problems.
pub(super) struct Finder<'a> {
    pub(super) model: &'a Model,
    pub(super) names: &'a [String],
    pub(super) options: &'a ImportOptions,
    pub(super) undistortions: BTreeMap<(CameraId, (u32, u32)), Result<Undistortion, String>>,
    pub(super) problems: Vec<String>,
}

impl Finder<'_> {
    /// All images without their files, of the size that COLMAP saw.
    pub(super) fn without_images(&mut self) -> Result<Condition> {
        let mut photographs = Vec::new();
        for index in self.order() {
            let size = self
                .model
                .camera(self.model.images[index].camera)
                .map(|c| c.lens.size());
            photographs.extend(self.photograph(index, size.unwrap_or_default(), None));
        }
        self.finish(Path::new("cameras"))?;
        Ok(Condition {
            name: None,
            photographs,
            unregistered: Vec::new(),
            missing: Vec::new(),
        })
    }

    /// The images of a folder.
    pub(super) fn condition(&mut self, name: Option<&String>, dir: &Path) -> Result<Condition> {
        let folder = Folder::scan(dir, self.options.srgb8)?;
        let mut photographs = Vec::new();
        let mut missing = Vec::new();
        let mut registered = std::collections::HashSet::new();
        for index in self.order() {
            let Some((own, radiance)) = folder.find(&self.names[index]) else {
                missing.push(self.names[index].clone());
                continue;
            };
            registered.insert(own.to_owned());
            let size = match radiance.size() {
                Ok(size) => size,
                Err(error) => {
                    self.problems.push(error.to_string());
                    continue;
                }
            };
            let [emission, alpha] = folder.beside(own);
            let files = Files {
                radiance: radiance.clone(),
                emission,
                alpha,
            };
            photographs.extend(self.photograph(index, size, Some(files)));
        }
        if !missing.is_empty() && self.options.missing == Missing::Refuse {
            self.problems.push(format!(
                "{} of {} registered images have no file in {}: {}",
                missing.len(),
                self.names.len(),
                dir.display(),
                by_cause(&folder, &missing)
            ));
        } else if photographs.is_empty() && self.problems.is_empty() {
            self.problems.push(format!(
                "no registered image has a file in {}",
                dir.display()
            ));
        }
        let unregistered = folder.names().filter(|name| !registered.contains(*name));
        Ok(Condition {
            name: name.cloned(),
            photographs,
            unregistered: unregistered.map(str::to_owned).collect(),
            missing,
        })
    }

    /// # Errors
    /// All problems, in one line.
    pub(super) fn finish(&self, root: &Path) -> Result<()> {
        const MAX_SHOWN: usize = 5;
        if self.problems.is_empty() {
            return Ok(());
        }
        let shown = self
            .problems
            .iter()
            .take(MAX_SHOWN)
            .cloned()
            .collect::<Vec<_>>();
        let mut text = shown.join("; ");
        if self.problems.len() > MAX_SHOWN {
            text += &format!("; and {} more problems", self.problems.len() - MAX_SHOWN);
        }
        Err(ColmapError::invalid(root, text))
    }

    /// Images by their names: the order in a model is that of their registration.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.names.len()).collect();
        order.sort_by(|a, b| self.names[*a].cmp(&self.names[*b]));
        order
    }

    fn photograph(
        &mut self,
        index: usize,
        size: (u32, u32),
        files: Option<Files>,
    ) -> Option<Photograph> {
        let image = &self.model.images[index];
        let camera = self.model.camera(image.camera)?;
        let name = &self.names[index];
        let aspect = |(width, height): (u32, u32)| f64::from(width) / f64::from(height);
        let ratio = aspect(size) / aspect(camera.lens.size());
        if files.is_some() && (ratio - 1.0).abs() > MAX_ASPECT_ERROR {
            let (width, height) = camera.lens.size();
            self.problems.push(format!(
                "{name} is {}x{}, another shape than its camera's {width}x{height}",
                size.0, size.1
            ));
            return None;
        }
        let options = &self.options.undistort;
        let made = self
            .undistortions
            .entry((image.camera, size))
            .or_insert_with(|| undistortion(self.model, image, size, options));
        match made {
            Ok(undistortion) => Some(Photograph {
                name: name.clone(),
                image: index,
                may_be_cut: !options.shows_known_pixels_only() && !undistortion.is_identity(),
                undistortion: *undistortion,
                files,
            }),
            Err(problem) => {
                if !self.problems.contains(problem) {
                    self.problems.push(problem.clone());
                }
                None
            }
        }
    }
}

/// Counts gathered while writing images.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Outcome {
    pub(super) num_unknown: u64,
    pub(super) num_negative: u64,
}

/// Writer of a condition's images.
pub(super) struct ConditionWriter<'a> {
    pub(super) writer: DatasetWriter,
    pub(super) condition: Option<&'a str>,
    /// Images written before.
    pub(super) done: usize,
    pub(super) total: usize,
    pub(super) progress: &'a mut dyn FnMut(ImportProgress),
}

impl ConditionWriter<'_> {
    /// Writes the images, as many at a time as there are threads.
    pub(super) fn write(&mut self, photographs: &[Photograph]) -> Result<Outcome> {
        let mut outcome = Outcome::default();
        for chunk in photographs.chunks(rayon::current_num_threads()) {
            let writer = &self.writer;
            let written: Vec<Result<Outcome>> = chunk
                .par_iter()
                .map(|photograph| write_one(writer, photograph))
                .collect();
            for (photograph, written) in chunk.iter().zip(written) {
                let one = written?;
                outcome.num_unknown += one.num_unknown;
                outcome.num_negative += one.num_negative;
                self.done += 1;
                if photograph.files.is_some() {
                    (self.progress)(ImportProgress::Image {
                        condition: self.condition.map(str::to_owned),
                        name: photograph.name.clone(),
                        done: self.done,
                        total: self.total,
                    });
                }
            }
        }
        Ok(outcome)
    }
}

fn write_one(writer: &DatasetWriter, photograph: &Photograph) -> Result<Outcome> {
    let Some(files) = &photograph.files else {
        return Ok(Outcome::default());
    };
    let path = files.radiance.path();
    let mut light = files.radiance.read()?;
    let num_negative = clean(path, &mut light.radiance)?;
    let remapped = photograph
        .undistortion
        .apply(&light.radiance)
        .map_err(|problem| ColmapError::invalid(path, problem))?;
    let num_unknown = remapped.num_unknown() as u64;
    let mask = |path: &Option<PathBuf>, within: Option<Image<1>>| -> Result<Option<Image<1>>> {
        let (path, mask) = match (path, within) {
            (Some(path), _) => (path, exr::read_single(path)?),
            (None, Some(mask)) => (files.radiance.path(), mask),
            (None, None) => return Ok(None),
        };
        let remapped = photograph.undistortion.apply(&mask);
        let image = remapped
            .map_err(|problem| ColmapError::invalid(path, problem))?
            .image;
        Ok(Some(image))
    };
    let view = View {
        name: photograph.name.clone(),
        camera: photograph.undistortion.camera(DAffine3::IDENTITY),
        radiance: remapped.image,
        emission: mask(&files.emission, None)?,
        normal: None,
        alpha: mask(&files.alpha, light.alpha)?,
        depth: None,
        albedo: None,
        specular: None,
        roughness: None,
        clipped: None,
        valid: (num_unknown > 0).then_some(remapped.valid),
    };
    writer.write_images(&view)?;
    Ok(Outcome {
        num_unknown,
        num_negative,
    })
}

/// Clamps negative radiance, noise about a black level, to 0 and counts its pixels; values that are
/// not finite are an error.
fn clean(path: &Path, image: &mut Image<3>) -> Result<u64> {
    let width = image.width() as usize;
    let mut num_negative = 0;
    for (at, pixel) in image.pixels_mut().iter_mut().enumerate() {
        if let Some(bad) = pixel.iter().find(|value| !value.is_finite()) {
            let (x, y) = (at % width, at / width);
            let problem = format!("pixel ({x}, {y}): {bad:?} is not finite");
            return Err(ColmapError::invalid(path, problem));
        }
        if pixel.iter().any(|value| *value < 0.0) {
            num_negative += 1;
            *pixel = pixel.map(|value| value.max(0.0));
        }
    }
    Ok(num_negative)
}
