//! Warnings about stacks that should be checked or taken again.

use crate::capture::{Quality, ShotReport, StackReport};
use eagpt_scene::median::median_of;

/// Limits of measures above which a warning is given, as shares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    /// Error of a stated exposure: larger errors show as bands of brightness. Cameras round 1/32 to
    /// 1/30, which is 6.7 %.
    pub(crate) exposure_error: f64,
    /// Blocks that differ between two shots: people breathe, screens flicker.
    pub(crate) moved: f64,
    /// Samples clipped in all shots: more than a lamp or two explain.
    pub(crate) clipped: f64,
    /// Samples that are dark in all shots.
    pub(crate) dark: f64,
}

/// The limits.
pub(crate) const LIMITS: Limits = Limits {
    exposure_error: 0.03,
    moved: 0.05,
    clipped: 0.001,
    dark: 0.05,
};
/// Sharpness below this share of the capture's median.
const SOFT: f64 = 0.5;
/// Fewer stacks have no usual sharpness.
const MIN_FOR_MEDIAN: usize = 5;

/// Warnings about a single stack.
pub(crate) fn of_stack(
    name: &str,
    shots: &[ShotReport],
    quality: &Quality,
    estimated: bool,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let wrong = |shot: &&ShotReport| shot.exposure_error.abs() > LIMITS.exposure_error;
    for shot in shots.iter().filter(wrong).filter(|_| !estimated) {
        warnings.push(format!(
            "{}: the exposure is {:+.1} % off the stated value, by the other shots: --exposure-ratios estimate corrects that",
            shot.file,
            100.0 * shot.exposure_error
        ));
    }
    if quality.moved_share > LIMITS.moved {
        warnings.push(format!(
            "{name}: {:.0} % of the picture changed between two shots: something moved, or the light did",
            100.0 * quality.moved_share
        ));
    }
    if quality.clipped_share > LIMITS.clipped {
        warnings.push(format!(
            "{name}: {:.2} % of the samples are clipped in all shots: a shorter exposure is missing",
            100.0 * quality.clipped_share
        ));
    }
    if quality.dark_share > LIMITS.dark {
        warnings.push(format!(
            "{name}: {:.1} % of the samples are dark in all shots: a longer exposure is missing",
            100.0 * quality.dark_share
        ));
    }
    warnings
}

/// Adds warnings that follow from a comparison with other stacks.
pub(crate) fn compare<'a>(reports: impl Iterator<Item = &'a mut StackReport>) {
    let reports: Vec<&mut StackReport> = reports.collect();
    if reports.len() < MIN_FOR_MEDIAN {
        return;
    }
    let sharpness = reports.iter().map(|report| report.quality.sharpness as f32);
    let usual = f64::from(median_of(sharpness));
    for report in reports {
        if report.quality.sharpness < SOFT * usual {
            report.warnings.push(format!(
                "{}/{}: sharpness {:.3} where {usual:.3} is usual: out of focus, or the camera shook",
                report.condition, report.position, report.quality.sharpness
            ));
        }
    }
}
