//! Which stacks a person should look at, or take again.

use crate::capture::{Quality, ShotReport, StackReport};
use crate::noise::median;

/// Errors of stated exposures above this share show as bands of brightness: cameras round 1/32 to 1/30, which is 6.7 %.
const EXPOSURE_ERROR: f64 = 0.03;
/// Share of blocks that may differ between two shots: people breathe, screens flicker.
const MOVED: f64 = 0.05;
/// Share of samples clipped in all shots that a lamp or two cannot explain.
const CLIPPED: f64 = 0.001;
/// Share of samples that are dark in all shots.
const DARK: f64 = 0.05;
/// Sharpness below this share of the capture's median.
const SOFT: f64 = 0.5;
/// Fewer stacks have no usual sharpness.
const MIN_FOR_MEDIAN: usize = 5;

/// What is to be said about a stack by itself.
pub(crate) fn of_stack(
    name: &str,
    shots: &[ShotReport],
    quality: &Quality,
    estimated: bool,
) -> Vec<String> {
    let mut warnings = Vec::new();
    if !estimated {
        for shot in shots
            .iter()
            .filter(|shot| shot.exposure_error.abs() > EXPOSURE_ERROR)
        {
            warnings.push(format!(
                "{}: the exposure is {:+.1} % off what the file says, by the other shots: --exposure-ratios estimate corrects that",
                shot.file,
                100.0 * shot.exposure_error
            ));
        }
    }
    if quality.moved_share > MOVED {
        warnings.push(format!(
            "{name}: {:.0} % of the picture changed between two shots: something moved, or the light did",
            100.0 * quality.moved_share
        ));
    }
    if quality.clipped_share > CLIPPED {
        warnings.push(format!(
            "{name}: {:.2} % of the samples are clipped in all shots: a shorter exposure is missing",
            100.0 * quality.clipped_share
        ));
    }
    if quality.dark_share > DARK {
        warnings.push(format!(
            "{name}: {:.1} % of the samples are dark in all shots: a longer exposure is missing",
            100.0 * quality.dark_share
        ));
    }
    warnings
}

/// Adds what shows only beside other stacks.
pub(crate) fn compare<'a>(reports: impl Iterator<Item = &'a mut StackReport>) {
    let reports: Vec<&mut StackReport> = reports.collect();
    if reports.len() < MIN_FOR_MEDIAN {
        return;
    }
    let mut values: Vec<f32> = reports
        .iter()
        .map(|report| report.quality.sharpness as f32)
        .collect();
    let usual = f64::from(median(&mut values));
    for report in reports {
        if report.quality.sharpness < SOFT * usual {
            report.warnings.push(format!(
                "{}/{}: sharpness {:.3} where {usual:.3} is usual: out of focus, or the camera shook",
                report.condition, report.position, report.quality.sharpness
            ));
        }
    }
}
