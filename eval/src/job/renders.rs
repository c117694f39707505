//! The folder of renders.

use crate::error::{EvalError, Result};
use eagpt_scene::{Frame, Image, SceneError, exr};
use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// Folders of the optional channels.
const CHANNELS: [&str; 6] = [
    "albedo",
    "normal",
    "depth",
    "emission",
    "specular",
    "roughness",
];

/// Folders beside the views that are of no view: [`CHANNELS`] and further AOVs of `eagpt render`.
const MORE_CHANNELS: [&str; 1] = ["alpha"];

/// Names of the views that a folder has renders of. What lies in the folder of a channel is a view
/// only if `views` has it by that name.
///
/// # Errors
/// [`SceneError::Io`] if the folder or one within it cannot be read.
pub(super) fn list(folder: &Path, views: &HashSet<&str>) -> Result<BTreeSet<String>> {
    let mut found = BTreeSet::new();
    let mut left = vec![(folder.to_owned(), String::new())];
    while let Some((dir, prefix)) = left.pop() {
        let io = |e| SceneError::io(&dir, "read folder", e);
        for entry in std::fs::read_dir(&dir).map_err(io)? {
            let path = entry.map_err(io)?.path();
            let Some(file) = path.file_name().and_then(|name| name.to_str()) else {
                continue;
            };
            if path.is_dir() {
                left.push((path.clone(), format!("{prefix}{file}/")));
            } else if let Some(stem) = file.strip_suffix(".exr") {
                found.insert(format!("{prefix}{stem}"));
            }
        }
    }
    found.retain(|name| {
        let first = name.split_once('/').map_or("", |(first, _)| first);
        let is_channel = CHANNELS.contains(&first) || MORE_CHANNELS.contains(&first);
        !is_channel || views.contains(name.as_str())
    });
    Ok(found)
}

/// Renders that are known to be there, with the sizes of their views.
#[derive(Debug)]
pub(super) struct Renders {
    folder: PathBuf,
    num_views: usize,
    /// Of each channel, the number of views that have it.
    num_with_channel: [usize; CHANNELS.len()],
}

impl Renders {
    /// Looks for the renders of `frames`, which are there, and reads their headers, not their
    /// pixels.
    ///
    /// # Errors
    /// [`EvalError::Render`] for another size than the view's; [`SceneError`] for a file that is no
    /// EXR.
    pub(super) fn find(folder: &Path, frames: &[&Frame]) -> Result<Self> {
        let mut found = Self {
            folder: folder.to_owned(),
            num_views: frames.len(),
            num_with_channel: [0; CHANNELS.len()],
        };
        for frame in frames {
            check_size(&found.path(None, &frame.name), frame)?;
            for (i, channel) in CHANNELS.into_iter().enumerate() {
                let path = found.path(Some(channel), &frame.name);
                if path.is_file() {
                    check_size(&path, frame)?;
                    found.num_with_channel[i] += 1;
                }
            }
        }
        Ok(found)
    }

    /// Channels that only some views have: their means are over fewer views than those of radiance.
    pub(super) fn warnings(&self) -> Vec<String> {
        CHANNELS
            .iter()
            .zip(self.num_with_channel)
            .filter(|(_, num)| (1..self.num_views).contains(num))
            .map(|(channel, num)| {
                let folder = self.folder.join(channel);
                format!(
                    "{}: {num} of {} views are there",
                    folder.display(),
                    self.num_views
                )
            })
            .collect()
    }

    pub(super) fn radiance(&self, view: &str) -> Result<Image<3>> {
        let path = self.path(None, view);
        finite(&path, exr::read_rgb(&path)?)
    }

    pub(super) fn albedo(&self, view: &str) -> Result<Option<Image<3>>> {
        self.channel("albedo", view, |path| finite(path, exr::read_rgb(path)?))
    }

    pub(super) fn normal(&self, view: &str) -> Result<Option<Image<3>>> {
        self.channel("normal", view, |path| {
            finite(path, exr::read_vectors(path)?)
        })
    }

    /// May be infinite where nothing was hit.
    pub(super) fn depth(&self, view: &str) -> Result<Option<Image<1>>> {
        self.channel("depth", view, |path| Ok(exr::read_single(path)?))
    }

    pub(super) fn emission(&self, view: &str) -> Result<Option<Image<1>>> {
        self.channel("emission", view, |path| {
            finite(path, exr::read_single(path)?)
        })
    }

    pub(super) fn specular(&self, view: &str) -> Result<Option<Image<3>>> {
        self.channel("specular", view, |path| finite(path, exr::read_rgb(path)?))
    }

    pub(super) fn roughness(&self, view: &str) -> Result<Option<Image<1>>> {
        self.channel("roughness", view, |path| {
            finite(path, exr::read_single(path)?)
        })
    }

    pub(super) fn has_emission(&self, view: &str) -> bool {
        self.path(Some("emission"), view).is_file()
    }

    fn channel<T>(
        &self,
        channel: &str,
        view: &str,
        read: impl FnOnce(&Path) -> Result<T>,
    ) -> Result<Option<T>> {
        let path = self.path(Some(channel), view);
        path.is_file().then(|| read(&path)).transpose()
    }

    fn path(&self, channel: Option<&str>, view: &str) -> PathBuf {
        let folder = channel.map_or_else(|| self.folder.clone(), |c| self.folder.join(c));
        folder.join(format!("{view}.exr"))
    }
}

fn check_size(path: &Path, frame: &Frame) -> Result<()> {
    let size = exr::read_size(path)?;
    let expected = (frame.camera.width, frame.camera.height);
    if size == expected {
        return Ok(());
    }
    Err(EvalError::Render {
        path: path.to_owned(),
        problem: format!(
            "{}x{} pixels, the view has {}x{}",
            size.0, size.1, expected.0, expected.1
        ),
    })
}

fn finite<const C: usize>(path: &Path, image: Image<C>) -> Result<Image<C>> {
    let is_bad = |pixel: &[f32; C]| pixel.iter().any(|v| !v.is_finite());
    let Some(first) = image.pixels().iter().position(is_bad) else {
        return Ok(image);
    };
    let num_bad = image.pixels().iter().filter(|p| is_bad(p)).count();
    let width = image.width() as usize;
    Err(SceneError::invalid(
        path,
        format!("pixel ({}, {})", first % width, first / width),
        format!(
            "{:?} is not finite; {num_bad} of {} pixels are like this",
            image.pixels()[first],
            image.pixels().len()
        ),
    )
    .into())
}
