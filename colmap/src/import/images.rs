//! Folders of images: which files there are, by the names of the views.

use super::options::Srgb8;
use crate::MAX_IMAGE_DEPTH;
use crate::error::{ColmapError, Result};
use eagpt_scene::dataset::{ALPHA_DIR, EMISSION_DIR, RADIANCE_DIR};
use eagpt_scene::files;
use eagpt_scene::pictures::{self, Light};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// An image file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ImageFile {
    /// Linear EXR
    Linear(PathBuf),
    /// sRGB PNG or JPEG
    Srgb8(PathBuf),
}

/// A folder of images by their names without extension, "/" between folders.
#[derive(Debug)]
pub struct Folder {
    dir: PathBuf,
    images: BTreeMap<String, ImageFile>,
    /// Names of 8-bit pictures that are not taken, by their last component.
    refused: BTreeSet<String>,
}

impl ImageFile {
    pub(super) fn path(&self) -> &PathBuf {
        match self {
            Self::Linear(path) | Self::Srgb8(path) => path,
        }
    }

    /// Width and height, from the file's header.
    pub(super) fn size(&self) -> Result<(u32, u32)> {
        Ok(pictures::size(self.path())?)
    }

    /// Linear radiance, and the opacity that is in the file itself.
    pub(super) fn read(&self) -> Result<Light> {
        Ok(pictures::read_light(self.path())?)
    }
}

impl Folder {
    /// Finds the images in `dir`, or in its folder `Radiance-exr` if it has one.
    ///
    /// # Errors
    /// If a folder cannot be read, holds no images, or holds two of one name.
    pub fn scan(dir: &Path, srgb8: Srgb8) -> Result<Self> {
        let radiance = dir.join(RADIANCE_DIR);
        let root = if radiance.is_dir() {
            radiance
        } else {
            dir.to_owned()
        };
        let mut folder = Self {
            dir: dir.to_owned(),
            images: BTreeMap::new(),
            refused: BTreeSet::new(),
        };
        let num_pictures = folder.collect(&root, srgb8)?;
        if folder.images.is_empty() {
            let problem = match num_pictures {
                0 => "no images".to_owned(),
                num => format!(
                    "no linear EXR images, but {num} 8-bit pictures, PNG or JPEG: --ldr srgb decodes them"
                ),
            };
            return Err(ColmapError::invalid(&root, problem));
        }
        Ok(folder)
    }

    /// Collects images and returns the number of 8-bit pictures skipped.
    fn collect(&mut self, root: &Path, srgb8: Srgb8) -> Result<usize> {
        let mut num_pictures = 0;
        for path in files::list_below(root, MAX_IMAGE_DEPTH)? {
            let Some(extension) = path.extension().and_then(OsStr::to_str) else {
                continue;
            };
            let name = files::relative_name(root, &path.with_extension(""));
            let source = match extension.to_ascii_lowercase().as_str() {
                "exr" => ImageFile::Linear(path.clone()),
                "png" | "jpg" | "jpeg" if srgb8 == Srgb8::Decode => ImageFile::Srgb8(path.clone()),
                "png" | "jpg" | "jpeg" => {
                    num_pictures += 1;
                    self.refused.insert(last(&name).to_owned());
                    continue;
                }
                _ => continue,
            };
            match self.images.get(&name) {
                // A preview beside its image.
                Some(ImageFile::Linear(_)) if matches!(source, ImageFile::Srgb8(_)) => {}
                Some(ImageFile::Srgb8(_)) if matches!(source, ImageFile::Linear(_)) => {
                    self.images.insert(name, source);
                }
                Some(other) => {
                    let problem = format!("{} has the same name", other.path().display());
                    return Err(ColmapError::invalid(&path, problem));
                }
                None => {
                    self.images.insert(name, source);
                }
            }
        }
        Ok(num_pictures)
    }

    /// Names of all images.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.images.keys().map(String::as_str)
    }

    /// The image of a view and its name in this folder: the full name, or its last component if
    /// that is unique.
    pub(super) fn find(&self, name: &str) -> Option<(&str, &ImageFile)> {
        if let Some((own, source)) = self.images.get_key_value(name) {
            return Some((own, source));
        }
        let expected = last(name);
        let mut ending = self.images.iter().filter(|(own, _)| last(own) == expected);
        let (own, source) = ending.next()?;
        ending.next().is_none().then_some((own.as_str(), source))
    }

    /// Whether a view has a picture that is not taken, since it is an 8-bit one.
    pub(super) fn has_refused(&self, name: &str) -> bool {
        self.refused.contains(last(name))
    }

    /// The emission mask and the opacity of an image of this folder, if present.
    pub(super) fn beside(&self, own_name: &str) -> [Option<PathBuf>; 2] {
        [EMISSION_DIR, ALPHA_DIR].map(|folder| {
            let path = self.dir.join(folder).join(format!("{own_name}.exr"));
            path.is_file().then_some(path)
        })
    }
}

/// The last component of a name.
fn last(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or_default()
}
