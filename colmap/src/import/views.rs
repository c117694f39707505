//! Views to be written, and the files they are made of.

use super::images::ImageFile;
use crate::error::{ColmapError, Result};
use crate::model::Model;
use eagpt_scene::dataset::{ALPHA_DIR, EMISSION_DIR, RADIANCE_DIR, VALID_DIR};
use eagpt_scene::lens::Undistortion;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// A dataset to be written.
#[derive(Debug)]
pub(super) struct Condition {
    pub(super) name: Option<String>,
    pub(super) photographs: Vec<Photograph>,
    pub(super) unregistered: Vec<String>,
    pub(super) missing: Vec<String>,
}

impl Condition {
    /// Where its dataset goes, relative to the folder of results.
    pub(super) fn dir(&self) -> PathBuf {
        self.name
            .as_deref()
            .map_or_else(PathBuf::new, PathBuf::from)
    }
}

/// A view to be written.
#[derive(Debug)]
pub(super) struct Photograph {
    /// Name of the view.
    pub(super) name: String,
    /// Index of the image in the model.
    pub(super) image: usize,
    pub(super) undistortion: Undistortion,
    /// Whether some pixels may be unknown.
    pub(super) may_be_cut: bool,
    pub(super) files: Option<Files>,
}

#[derive(Debug)]
pub(super) struct Files {
    pub(super) radiance: ImageFile,
    pub(super) emission: Option<PathBuf>,
    pub(super) alpha: Option<PathBuf>,
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
