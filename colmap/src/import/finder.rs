//! Search for the photographs of every condition, with all problems found on it.

use super::images::Folder;
use super::options::{ImportOptions, Missing};
use super::report::listed;
use super::views::{Condition, Files, Photograph};
use crate::error::{ColmapError, Result};
use crate::model::{CameraId, Model, ModelImage};
use eagpt_scene::lens::{UndistortOptions, Undistortion};
use std::collections::BTreeMap;
use std::path::Path;

/// Tolerance between the aspect ratios of an image and its camera: sizes are rounded to whole
/// pixels.
const MAX_ASPECT_ERROR: f64 = 0.01;

/// Finds the photographs of every condition. All problems are collected in one error.
pub(super) fn find_conditions(
    model: &Model,
    names: &[String],
    options: &ImportOptions,
    warnings: &mut Vec<String>,
) -> Result<Vec<Condition>> {
    let mut finder = Finder {
        model,
        names,
        options,
        undistortions: BTreeMap::new(),
        problems: Vec::new(),
    };
    let Some(root) = &options.images else {
        let condition = finder.without_images()?;
        return Ok(vec![condition]);
    };
    let mut conditions = Vec::new();
    if options.conditions.is_empty() {
        conditions.push(finder.condition(None, root)?);
    }
    for name in &options.conditions {
        conditions.push(finder.condition(Some(name), &root.join(name))?);
    }
    finder.finish(root)?;
    for condition in &conditions {
        if condition.photographs.iter().any(Photograph::is_srgb8) {
            warnings.push(
                "8-bit sRGB pictures are decoded: light above their white is lost, and lamps are not brighter than paper"
                    .to_owned(),
            );
        }
    }
    warnings.dedup();
    Ok(conditions)
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
struct Finder<'a> {
    model: &'a Model,
    names: &'a [String],
    options: &'a ImportOptions,
    undistortions: BTreeMap<(CameraId, (u32, u32)), Result<Undistortion, String>>,
    problems: Vec<String>,
}

impl Finder<'_> {
    /// All images without their files, of the size that COLMAP saw.
    fn without_images(&mut self) -> Result<Condition> {
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
    fn condition(&mut self, name: Option<&String>, dir: &Path) -> Result<Condition> {
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
    fn finish(&self, root: &Path) -> Result<()> {
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

/// The undistortion of an image of a size.
fn undistortion(
    model: &Model,
    image: &ModelImage,
    size: (u32, u32),
    options: &UndistortOptions,
) -> Result<Undistortion, String> {
    let camera = model
        .camera(image.camera)
        .ok_or_else(|| format!("camera {} is not there", image.camera))?;
    let lens = camera.lens.resized(size)?;
    Undistortion::new(&lens, options).map_err(|problem| format!("camera {}: {problem}", camera.id))
}
