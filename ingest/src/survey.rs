//! Survey of a stack's light: whether it can be decoded, its noise, and the accuracy of stated
//! exposures.
//!
//! All stacks are surveyed before any is merged, so that all problems are reported at once, and
//! because the scale of the images is shared by the whole capture.

use crate::color::ColorTransform;
use crate::error::IngestError;
use crate::noise::{Noise, estimate};
use crate::raw::{Decoding, RawFrame};
use crate::response::Response;
use crate::stack::{Photograph, Shot, Stack};
use crate::thumb::{Comparison, Thumb, compare};
use eagpt_scene::color::luminance;
use eagpt_scene::median::median_of;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Results of the survey of a stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Survey {
    /// Noise of the sensor.
    pub(crate) noise: Noise,
    /// Measured exposure of each shot over that of the one before; the first is `None`, others may
    /// be.
    pub(crate) ratios: Vec<Option<f64>>,
    /// Share of the comparable blocks in which each shot shows something else than the one before.
    pub(crate) moved: Vec<Option<f64>>,
    /// Share of blocks with a clipped sample, for each shot.
    pub(crate) clipped: Vec<f64>,
    /// Mean of ln(luminance) in units of the range per exposure, over blocks that are bright
    /// enough.
    pub(crate) log_luminance: f64,
}

/// The reason why a stack cannot be surveyed: the shot and its problem.
pub(crate) struct Unreadable {
    pub(crate) shot: usize,
    pub(crate) error: IngestError,
}

/// Reads shots as light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reader<'a> {
    pub(crate) decoding: &'a Decoding,
    /// Response of the camera, for pictures for display; without it their samples are codes.
    pub(crate) response: Option<&'a Response>,
}

impl Reader<'_> {
    /// Decodes a photograph.
    ///
    /// # Errors
    /// As [`Decoding::read`].
    pub(crate) fn read(&self, path: &Path) -> crate::Result<RawFrame> {
        let frame = self.decoding.read(path)?;
        Ok(match self.response {
            Some(response) if frame.header.display.is_some() => response.linearised(frame),
            _ => frame,
        })
    }
}

/// Reads all shots of a stack.
///
/// # Errors
/// The first shot that cannot be decoded.
pub(crate) fn read_shots(stack: &Stack, reader: &Reader<'_>) -> Result<Vec<RawFrame>, Unreadable> {
    let read: Vec<_> = stack
        .shots
        .par_iter()
        .map(|shot| reader.read(&shot.path))
        .collect();
    let mut frames = Vec::with_capacity(read.len());
    for (shot, outcome) in read.into_iter().enumerate() {
        match outcome {
            Ok(frame) => frames.push(frame),
            Err(error) => return Err(Unreadable { shot, error }),
        }
    }
    Ok(frames)
}

/// Surveys a stack, its shots sorted by exposure.
///
/// # Errors
/// As [`read_shots`].
pub(crate) fn survey(
    stack: &Stack,
    reader: &Reader<'_>,
    color: &ColorTransform,
    clip: f32,
) -> Result<Survey, Unreadable> {
    let frames = read_shots(stack, reader)?;
    let thumbs: Vec<Thumb> = frames.iter().map(Thumb::new).collect();
    let exposures: Vec<f64> = stack.shots.iter().map(Photograph::exposure).collect();
    let profile = stack
        .shots
        .iter()
        .find_map(|shot| shot.header.metadata.noise);
    let known = profile.map_or(Noise::ASSUMED, Noise::from_profile);
    let compared = |noise: &Noise| -> Vec<Comparison> {
        let pairs = thumbs.windows(2);
        pairs
            .map(|pair| compare(&pair[0], &pair[1], noise, clip))
            .collect()
    };
    // Noise is measured between shots whose ratio is known, and ratios are taken where noise is
    // low: one after the other.
    let first = compared(&known);
    let noise = if profile.is_some() {
        known
    } else {
        let mut measured = exposures.clone();
        for (index, comparison) in first.iter().enumerate() {
            let stated = exposures[index + 1] / exposures[index];
            measured[index + 1] = measured[index] * comparison.ratio.unwrap_or(stated);
        }
        let shots: Vec<Shot<'_>> = frames
            .iter()
            .zip(&measured)
            .map(|(frame, &exposure)| Shot { frame, exposure })
            .collect();
        estimate(&shots, clip).unwrap_or(Noise::ASSUMED)
    };
    let second = compared(&noise);
    let after_none = |of: fn(&Comparison) -> Option<f64>| {
        let rest = second.iter().map(of);
        std::iter::once(None).chain(rest).collect::<Vec<_>>()
    };
    Ok(Survey {
        noise,
        ratios: after_none(|c| c.ratio),
        moved: after_none(|c| c.moved),
        clipped: thumbs
            .iter()
            .map(|thumb| thumb.clipped_share(clip))
            .collect(),
        log_luminance: log_luminance(&thumbs, &exposures, color, clip),
    })
}

/// Mean of ln(luminance) over blocks, each from the longest shot that does not clip there.
fn log_luminance(thumbs: &[Thumb], exposures: &[f64], color: &ColorTransform, clip: f32) -> f64 {
    let num_blocks = thumbs.first().map_or(0, |thumb| thumb.means.len());
    let (mut sum, mut count) = (0.0, 0_usize);
    for block in 0..num_blocks {
        let unclipped = thumbs
            .iter()
            .zip(exposures)
            .rev()
            .find(|(thumb, _)| thumb.largest[block] < clip);
        let Some((thumb, exposure)) = unclipped.or_else(|| thumbs.iter().zip(exposures).next())
        else {
            continue;
        };
        let mean = thumb.means[block];
        let balanced = [0, 1, 2].map(|c| mean[c] * color.white_balance[c]);
        let light = f64::from(luminance(color.apply(balanced)));
        // Blocks at the noise floor have no logarithm worth keeping.
        if light > 1e-5 {
            sum += (light / exposure).ln();
            count += 1;
        }
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// Exposures of the shots of a stack by what was measured; ratios that are unknown are taken as
/// stated. The factor that ratios leave open keeps the median of the shots in place, so that one
/// wrong shot moves no other.
pub(crate) fn estimated(stated: &[f64], ratios: &[Option<f64>]) -> Vec<f64> {
    let mut exposures = stated.to_vec();
    for index in 1..stated.len() {
        let ratio = ratios.get(index).copied().flatten();
        exposures[index] =
            exposures[index - 1] * ratio.unwrap_or(stated[index] / stated[index - 1]);
    }
    let factors = exposures.iter().zip(stated);
    let factors = factors.map(|(e, s)| (e / s).ln() as f32);
    let offset = f64::from(median_of(factors)).exp();
    exposures.iter().map(|exposure| exposure / offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_exposure_moves_no_other() {
        // 0.052 stands where 0.04 was: measured ratios are those of 0.01, 0.04, 0.16.
        let stated = [0.0025, 0.01, 0.052, 0.16, 0.64];
        let ratios = [None, Some(4.0), Some(4.0), Some(4.0), None];
        let found = estimated(&stated, &ratios);
        for (found, expected) in found.iter().zip([0.0025, 0.01, 0.04, 0.16, 0.64]) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        }
    }
}
