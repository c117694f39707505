//! Photographs read, undistorted and written.

use super::report::ImportProgress;
use super::views::Photograph;
use crate::error::{ColmapError, Result};
use eagpt_scene::dataset::{DatasetWriter, View};
use eagpt_scene::{Image, exr};
use glam::DAffine3;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

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
