//! FLIP: the perceived difference of two images when alternating between them.
//!
//! LDR-FLIP (Andersson et al. 2020, "FLIP: A difference evaluator for alternating images") blurs
//! both images as the eye does at a viewing distance, takes a colour distance, and sharpens it
//! where edges or points differ. HDR-FLIP (Andersson et al. 2021) shows both images at several
//! exposures through a tone curve and keeps the largest error of each pixel. Errors are in [0, 1],
//! 0 for equal images.
//!
//! Agrees with NVIDIA's flip-evaluator 1.7, whose own values differ in the last digits between
//! systems. The border repeats the outermost pixels. All work is done in bands of rows, so memory
//! is that of the error map and a few rows, and the result is bit-identical for any number of
//! threads.

mod band;
mod color;
mod exposures;
mod filters;
mod magma;
mod math;
mod pass;
mod shown;

pub use eagpt_scene::tonemap::ToneMapper;
pub use exposures::FlipOptions;
pub(crate) use exposures::FlipParameters;
pub use magma::magma_rgb8;

use crate::encode::assert_comparable;
use crate::error::Result;
use band::{BandScratch, Pair};
use eagpt_scene::Image;
use filters::Filters;
use rayon::prelude::*;
use shown::Shown;

/// Errors of HDR-FLIP, and what they were computed with.
#[derive(Debug, Clone)]
pub struct FlipHdr {
    /// Mean of `error`.
    pub mean: f64,
    /// Error of each pixel in [0, 1].
    pub error: Image<1>,
    /// The settings, with the exposures that were chosen.
    pub parameters: FlipParameters,
}

/// Errors of LDR-FLIP.
#[derive(Debug, Clone)]
pub struct FlipLdr {
    /// Mean of `error`.
    pub mean: f64,
    /// Error of each pixel in [0, 1].
    pub error: Image<1>,
}

/// HDR-FLIP of two linear Rec.709 images. Negative values and NaN count as black.
///
/// # Errors
/// As `for_reference`.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub fn flip_hdr(reference: &Image<3>, test: &Image<3>, options: &FlipOptions) -> Result<FlipHdr> {
    assert_comparable(reference, test);
    let parameters = FlipParameters::for_reference(options, reference)?;
    let factors = parameters.factors().into_iter();
    let exposures: Vec<Shown> = factors
        .map(|factor| Shown::Exposed {
            tonemapper: parameters.tonemapper,
            factor,
        })
        .collect();
    let error = error_map(reference, test, parameters.ppd, &exposures);
    Ok(FlipHdr {
        mean: mean(&error),
        error,
        parameters,
    })
}

/// LDR-FLIP of two sRGB images, clipped to [0, 1] and black where NaN, at `ppd` pixels per degree
/// of vision.
///
/// # Errors
/// As [`FlipOptions::validate`] for `ppd`.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub fn flip_ldr(reference_srgb: &Image<3>, test_srgb: &Image<3>, ppd: f32) -> Result<FlipLdr> {
    assert_comparable(reference_srgb, test_srgb);
    let options = FlipOptions {
        ppd,
        ..FlipOptions::default()
    };
    options.validate()?;
    let error = error_map(reference_srgb, test_srgb, ppd, &[Shown::Srgb]);
    Ok(FlipLdr {
        mean: mean(&error),
        error,
    })
}

/// The largest error of each pixel over all display mappings `shown`.
fn error_map(reference: &Image<3>, test: &Image<3>, ppd: f32, shown: &[Shown]) -> Image<1> {
    let pair = Pair {
        filters: &Filters::new(ppd),
        width: reference.width() as usize,
        height: reference.height() as usize,
        images: [reference.pixels(), test.pixels()],
    };
    // Bands share no sums, so their height is free: low enough to occupy all threads, high enough
    // that the rows recomputed around a band do not dominate.
    let num_rows = (pair.height / (2 * rayon::current_num_threads())).clamp(32, 256);
    let mut error = Image::filled(reference.width(), reference.height(), [0.0]);
    error
        .pixels_mut()
        .par_chunks_mut(num_rows * pair.width)
        .enumerate()
        .for_each_init(BandScratch::default, |scratch, (index, out)| {
            let first = index * num_rows;
            let rows = first..first + out.len() / pair.width;
            pair.raise_errors(&rows, shown, scratch, out);
        });
    error
}

/// Mean in f64, row after row.
pub(crate) fn mean(error: &Image<1>) -> f64 {
    let sum: f64 = error.values().iter().map(|v| f64::from(*v)).sum();
    sum / error.values().len() as f64
}

#[cfg(test)]
mod tests;
