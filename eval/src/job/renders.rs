//! The folder of renders.

use crate::error::{EvalError, Result};
use eagpt_scene::{Frame, Image, SceneError, exr};
use std::path::{Path, PathBuf};

/// Folders of the optional channels.
const CHANNELS: [&str; 4] = ["albedo", "normal", "depth", "emission"];

/// Renders that are known to be there, with the sizes of their views.
#[derive(Debug)]
pub(super) struct Renders {
    folder: PathBuf,
    num_views: usize,
    /// Of each channel, the number of views that have it.
    num_with_channel: [usize; CHANNELS.len()],
}

impl Renders {
    /// Looks for the renders of `frames` and reads their headers, not their pixels.
    ///
    /// # Errors
    /// [`EvalError::MissingRenders`] with all views without a render; [`EvalError::Render`] for
    /// another size than the view's; [`SceneError`] for a file that is no EXR.
    pub(super) fn find(folder: &Path, frames: &[&Frame]) -> Result<Self> {
        let mut found = Self {
            folder: folder.to_owned(),
            num_views: frames.len(),
            num_with_channel: [0; CHANNELS.len()],
        };
        let missing: Vec<String> = frames
            .iter()
            .filter(|frame| !found.path(None, &frame.name).is_file())
            .map(|frame| frame.name.clone())
            .collect();
        if !missing.is_empty() {
            return Err(EvalError::MissingRenders {
                folder: found.folder,
                missing,
                num_views: frames.len(),
            });
        }
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
