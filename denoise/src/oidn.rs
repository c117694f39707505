//! Open Image Denoise (Áfra 2019–, <https://www.openimagedenoise.org>), version 2, where the
//! machine has it.
//!
//! The library is located and loaded at run time, never linked and never downloaded. Its network
//! gets the reflected light with albedo and normals as guides, after [`crate::filter`] has removed
//! the fireflies, and runs on the CPU, where its results do not depend on the number of threads.

mod library;
mod search;

use crate::error::{DenoiseError, Result};
use crate::filter::{self, Settings};
use crate::frame::Frame;
use eagpt_scene::Image;
use library::{GuideImages, Library};
use std::path::{Path, PathBuf};

/// Environment variable with the library's file, or its folder.
pub(crate) const ENVIRONMENT: &str = "EAGPT_OIDN";

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
    /// Finds the library: at `path` (a file, or a folder it lies in) if there is one, and nowhere
    /// else; otherwise at the environment variable `ENVIRONMENT`, on the dynamic loader's path,
    /// and in the usual places.
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
                // The loader's message says no more than the name.
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

    /// Loads the library at `path`.
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
    /// [`DenoiseError::Failed`] with the library's message.
    pub(crate) fn reflected(&self, frame: &Frame) -> Result<Image<3>> {
        let device = self.library.open(rayon::current_num_threads())?;
        // Around a hole with an emitter the network darkens the wall, and at its edge partly
        // covered pixels. Fireflies would leave blotches: the filter's first steps know the
        // samples' variance, the network does not.
        let [calm, excess] = filter::calmed(frame, &Settings::default());
        let color = whole(&calm, &frame.coverage);
        let guides = GuideImages {
            albedo: &whole(&frame.albedo, &frame.coverage),
            normal: &filled(&frame.normal, &frame.coverage),
        };
        let mut denoised = device.denoise(&color, &guides)?;
        let coverage = frame.coverage.pixels();
        let rest = coverage.iter().zip(excess.pixels());
        for (pixel, ([coverage], excess)) in denoised.pixels_mut().iter_mut().zip(rest) {
            for c in 0..3 {
                pixel[c] = pixel[c] * coverage + excess[c];
            }
        }
        Ok(denoised)
    }
}

/// Pixel values divided by their coverage, with holes filled.
fn whole(image: &Image<3>, coverage: &Image<1>) -> Image<3> {
    let mut image = image.clone();
    for (pixel, [coverage]) in image.pixels_mut().iter_mut().zip(coverage.pixels()) {
        if *coverage > 0.0 {
            *pixel = pixel.map(|value| value / coverage);
        }
    }
    filled(&image, coverage)
}

/// The image with its uncovered holes filled from their edges inwards by means of covered
/// neighbours.
fn filled(image: &Image<3>, coverage: &Image<1>) -> Image<3> {
    /// Width of the rim that is filled: beyond it a hole is black, too far from the wall to affect
    /// the network's output.
    const RIM: usize = 8;
    let (width, height) = image.size();
    let mut known: Vec<bool> = coverage.pixels().iter().map(|[c]| *c > 0.0).collect();
    let mut image = image.clone();
    for _ in 0..RIM {
        let mut found = Vec::new();
        for i in (0..known.len()).filter(|&i| !known[i]) {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let (mut sum, mut num) = ([0.0; 3], 0.0);
            for v in y.saturating_sub(1)..(y + 2).min(height) {
                for u in x.saturating_sub(1)..(x + 2).min(width) {
                    if known[(v * width + u) as usize] {
                        let there = image.get(u, v);
                        (0..3).for_each(|c| sum[c] += there[c]);
                        num += 1.0;
                    }
                }
            }
            if num > 0.0 {
                found.push((i, sum.map(|value| value / num)));
            }
        }
        for (i, value) in found {
            image.pixels_mut()[i] = value;
            known[i] = true;
        }
    }
    image
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
    let files = maps
        .lines()
        .filter_map(|line| line.find('/').map(|at| &line[at..]));
    files
        .into_iter()
        .find(|file| {
            file.rsplit('/')
                .next()
                .is_some_and(|f| f.starts_with(&*name))
        })
        .map_or_else(|| path.to_owned(), PathBuf::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_filled_from_their_edges() {
        let mut coverage = Image::filled(30, 3, [1.0]);
        let mut image = Image::filled(30, 3, [2.0; 3]);
        for y in 0..3 {
            for x in 1..29 {
                coverage.pixels_mut()[y * 30 + x] = [0.0];
                image.pixels_mut()[y * 30 + x] = [0.0; 3];
            }
        }
        image.pixels_mut()[30] = [5.0; 3];
        coverage.pixels_mut()[29] = [0.5];
        let whole = whole(&image, &coverage);
        assert_eq!(whole.get(0, 1), [5.0; 3]);
        assert_eq!(whole.get(29, 0), [4.0; 3]);
        assert_eq!(whole.get(1, 1), [3.0; 3]);
        assert!(whole.get(8, 1)[0] > 0.0);
        assert_eq!(whole.get(15, 1), [0.0; 3]);
    }

    #[test]
    fn versions_are_told_as_the_library_counts_them() {
        assert_eq!(version_text(20_501), "2.5.1");
        assert_eq!(version_text(10_402), "1.4.2");
    }
}
