//! Whether a run fits into memory.

use super::lights::Light;
use super::request::TrainRequest;
use crate::error::{Result, TrainError};
use crate::options::{StageChoice, TrainOptions};
use eagpt_scene::machine::available_memory;

/// Bytes a Gaussian takes while it is trained: raw values, moments, gradients (4 × 17 floats), its
/// activated and prepared forms.
const BYTES_PER_GAUSSIAN: u64 = 4 * 17 * 4 + 17 * 4 + 2 * 64 + 64;
/// Bytes that the coefficients of a Gaussian's harmonics take: values, moments, gradients, those of
/// the Gaussian, prepared ones; and its attributes as a camera sees them.
const BYTES_PER_HARMONICS: u64 = 6 * 24 * 4 + 64;
/// Bytes that one of several lights takes for each Gaussian: values and moments, and the Gaussian
/// in it when training ends; and its harmonics.
const BYTES_PER_LIGHT: u64 = 3 * 4 * 4 + 17 * 4;
const BYTES_PER_LIGHT_HARMONICS: u64 = 4 * 24 * 4;
/// Bytes a pixel of the current view takes: features and their gradient (16 floats each), some
/// forty recorded hits, images of the loss.
const BYTES_PER_PIXEL: u64 = 2 * 64 + 40 * 12 + 200;
/// Bytes a pixel of a prepared view takes: radiance, normal, mask, opacity, irradiance and where
/// emitters are, all as floats, its point of the cloud, and the target.
const BYTES_PER_VIEW_PIXEL: u64 = (3 + 3 + 1 + 1 + 4 + 4 + 1) * 4 + 3 * 2;

/// Memory that a run takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Memory {
    /// Bytes without which it is refused: one view at a time.
    least: u64,
    /// Bytes of the images, all of them prepared.
    images: u64,
    /// Bytes of the largest of them.
    largest_image: u64,
}

/// Plans the memory of training.
///
/// # Errors
/// If the points cannot be read.
fn memory(lights: &[Light], options: &TrainOptions) -> Result<Memory> {
    let pixels = || {
        lights.iter().flat_map(|light| {
            let frames = light.dataset.frames();
            let views = light.split.train.iter();
            views.map(|&i| frames[i].camera.num_pixels() as u64)
        })
    };
    let largest = pixels().max().unwrap_or(0);
    let images: u64 = pixels().sum::<u64>() * BYTES_PER_VIEW_PIXEL;
    let num_gaussians = options.gaussians_for(options.num_points(&lights[0].dataset)?) as u64;
    let bytes_per_gaussian = match options.radiance.harmonics.degree {
        0 => BYTES_PER_GAUSSIAN,
        _ => BYTES_PER_GAUSSIAN + BYTES_PER_HARMONICS,
    };
    let bytes_per_light = match (lights.len(), options.radiance.harmonics.degree) {
        (1, _) => 0,
        (_, 0) => BYTES_PER_LIGHT,
        _ => BYTES_PER_LIGHT + BYTES_PER_LIGHT_HARMONICS,
    };
    let bytes_per_gaussian = bytes_per_gaussian + lights.len() as u64 * bytes_per_light;
    let fixed = num_gaussians * bytes_per_gaussian + largest * BYTES_PER_PIXEL;
    let irradiance = if options.stage == StageChoice::Radiance {
        0
    } else {
        images / 5
    };
    let largest_image = largest * BYTES_PER_VIEW_PIXEL;
    Ok(Memory {
        least: fixed + largest_image + irradiance,
        images,
        largest_image,
    })
}

/// Checks the job's memory against the machine's and says how many bytes images may take.
pub(super) fn image_budget(request: &TrainRequest, lights: &[Light]) -> Result<usize> {
    let Memory {
        least,
        images,
        largest_image,
    } = memory(lights, &request.options)?;
    let Some(available) = available_memory() else {
        return Ok(request.image_budget.unwrap_or(images as usize));
    };
    if least > available {
        return Err(TrainError::Memory {
            needed_mib: least >> 20,
            available_mib: available >> 20,
            advice: "fewer Gaussians (--gaussians) or smaller images would help".to_owned(),
        });
    }
    Ok(request
        .image_budget
        .unwrap_or(((available - least) / 2).min(images) as usize)
        .max(largest_image as usize))
}
