//! `eagpt colmap import --dry-run`: what is in a model, and what the search for the floor sees.

use super::tell_alignment;
use crate::progress::Reporter;
use anyhow::Result;
use eagpt_colmap::ColmapError;
use eagpt_colmap::import::{ImportOptions, Survey};
use std::path::Path;

/// Tells what is in a model and where its floor is, or why none was found.
///
/// # Errors
/// If the model cannot be read or an option is out of its range.
pub(super) fn tell(reporter: &Reporter, model: &Path, options: &ImportOptions) -> Result<()> {
    let (survey, alignment) = Survey::new(model, options)?;
    reporter.note(&text(model, &survey));
    reporter.tagged("model", &survey)?;
    match alignment {
        Ok(alignment) => tell_alignment(reporter, &alignment),
        Err(error) => {
            reporter.note(&format!("floor: none; {error}"));
            Ok(())
        }
    }
}

/// An error of the alignment with the options that help.
pub(super) fn with_advice(error: ColmapError) -> anyhow::Error {
    match error {
        ColmapError::Align(_) => anyhow::anyhow!(
            "{error} (--align manual with --floor-points or --floor-at names the floor, --up says what is up, --min-confidence \
             accepts less, --align none takes the world as it is)"
        ),
        error => error.into(),
    }
}

fn text(model: &Path, survey: &Survey) -> String {
    let mut text = format!(
        "{}: {} registered images, {} cameras, {} points, {} of them with at least {} observations and at most {} pixels of error",
        model.display(),
        survey.num_images,
        survey.cameras.len(),
        survey.num_points,
        survey.num_good_points,
        survey.filter.min_track,
        survey.filter.max_error_px
    );
    for camera in &survey.cameras {
        let [width, height] = camera.size;
        text += &format!(
            "\ncamera {}: {} {width}x{height}, {} images",
            camera.id, camera.model, camera.num_images
        );
    }
    match &survey.gravity {
        Some(gravity) => {
            let [x, y, z] = gravity.up;
            text += &format!(
                "\nup: {x:.3},{y:.3},{z:.3} ({}, roll {:.1}°)",
                gravity.held, gravity.roll_deg
            );
        }
        None => text += "\nup: the cameras do not tell",
    }
    if let Some([above, between, below]) = survey.points_by_height {
        text += &format!(
            "\npoints: {above} above all cameras, {between} between them, {below} below them"
        );
    }
    text
}
