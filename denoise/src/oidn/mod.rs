//! Open Image Denoise (Áfra 2019–, <https://www.openimagedenoise.org>), version 2, where the machine has it.
//!
//! The library is looked for and loaded at run time, never linked and never downloaded. Its network sees the reflected light with albedo and
//! normals as guides and runs on the CPU, where its results do not depend on the number of threads.

mod library;
mod search;

use crate::error::{DenoiseError, Result};
use crate::frame::Frame;
use eagpt_scene::Image;
use library::{GuideImages, Library};
use std::path::{Path, PathBuf};

/// Environment variable with the library's file, or its folder.
pub const ENVIRONMENT: &str = "EAGPT_OIDN";

/// Oldest version that is used, in the library's own count.
const MIN_VERSION: i32 = 20_000;

/// A library that was loaded and has opened a device.
#[derive(Debug)]
pub struct Oidn {
    library: Library,
    path: PathBuf,
    version: i32,
}

impl Oidn {
    /// Finds the library: at `path` (a file, or a folder it lies in) if there is one, and nowhere else; otherwise where the environment
    /// variable [`ENVIRONMENT`] says, where the dynamic loader looks, and in the usual places.
    ///
    /// # Errors
    /// [`DenoiseError::NotFound`] with all places and what was wrong there.
    pub fn find(path: Option<&Path>) -> Result<Self> {
        let variable = std::env::var_os(ENVIRONMENT).filter(|value| !value.is_empty());
        Self::find_with(path, variable.as_deref().map(Path::new))
    }

    fn find_with(path: Option<&Path>, variable: Option<&Path>) -> Result<Self> {
        let mut looked = Vec::new();
        if let Some(found) = path.or(variable).and_then(|p| Self::at(p, &mut looked)) {
            return Ok(found);
        }
        if path.is_none() {
            for name in search::NAMES {
                // The loader's own words say no more than the name.
                match Self::load(Path::new(name)) {
                    Ok(found) => return Ok(found),
                    Err(error) => tracing::debug!("{error}"),
                }
            }
            looked.push(format!("{} by the loader", search::NAMES.join(" and ")));
            let (files, folders) = search::usual();
            for file in files {
                if let Some(found) = Self::at(&file, &mut looked) {
                    return Ok(found);
                }
            }
            looked.extend(folders.iter().map(|folder| folder.display().to_string()));
        }
        Err(DenoiseError::NotFound { looked })
    }

    /// The library at `path`, or what is wrong there.
    fn at(path: &Path, looked: &mut Vec<String>) -> Option<Self> {
        let files = search::within(path);
        if files.is_empty() {
            looked.push(format!(
                "{} (no {})",
                path.display(),
                search::NAMES.join(" or ")
            ));
        }
        files.iter().find_map(|file| {
            // A bare name would be looked up by the loader, not here.
            let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
            Self::load(&file)
                .map_err(|error| looked.push(error.to_string()))
                .ok()
        })
    }

    fn load(path: &Path) -> Result<Self> {
        let library = Library::load(path)?;
        let version = library.open(1)?.version();
        if version < MIN_VERSION {
            return Err(DenoiseError::Unusable {
                path: path.to_owned(),
                problem: format!("is version {}, older than 2", version_text(version)),
            });
        }
        let path = resolved(path);
        Ok(Self {
            library,
            path,
            version,
        })
    }

    /// Where the library was found.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Version of the library, as in `2.3.0`.
    pub fn version(&self) -> String {
        version_text(self.version)
    }

    /// Denoises the reflected light of a frame.
    ///
    /// # Errors
    /// [`DenoiseError::Failed`] with what the library says.
    pub(crate) fn reflected(&self, frame: &Frame) -> Result<Image<3>> {
        let device = self.library.open(rayon::current_num_threads())?;
        device.denoise(
            &frame.reflected,
            &GuideImages {
                albedo: Some(&frame.albedo),
                normal: &frame.normal,
            },
        )
    }
}

/// `20501` is 2.5.1.
fn version_text(version: i32) -> String {
    format!(
        "{}.{}.{}",
        version / 10_000,
        version / 100 % 100,
        version % 100
    )
}

/// The file of a library that the loader found by its name, as Linux tells; elsewhere the name.
fn resolved(path: &Path) -> PathBuf {
    let name = path.as_os_str().to_string_lossy();
    if path.is_absolute() {
        return path.to_owned();
    }
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let files = maps.lines().filter_map(|line| line.find('/').map(|at| &line[at..]));
    files
        .into_iter()
        .find(|file| file.rsplit('/').next().is_some_and(|f| f.starts_with(&*name)))
        .map_or_else(|| path.to_owned(), PathBuf::from)
}
