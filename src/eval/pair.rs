//! `eagpt eval pair`: one image against another.

use super::{COLUMN_WIDTH, FlipArgs, table};
use crate::args::GlobalArgs;
use crate::terminal;
use anyhow::{Result, bail};
use clap::Args;
use eagpt_eval::{ImageMetrics, compare};
use eagpt_scene::{Image, exr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Measure one image against its reference
///
/// Both are linear Rec.709 EXR images of the same size. The metrics go to standard output, with
/// --json under the keys of metrics.json; the PSNR of equal images is infinite, which JSON shows as
/// null.
#[derive(Debug, Clone, Args)]
pub(crate) struct PairArgs {
    /// The reference
    #[arg(value_name = "REFERENCE.exr")]
    reference: PathBuf,
    /// The image to measure
    #[arg(value_name = "TEST.exr")]
    test: PathBuf,
    #[command(flatten)]
    flip: FlipArgs,
}

pub(super) fn run(args: &PairArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = args.flip.options()?;
    let reference = read(&args.reference)?;
    let test = read(&args.test)?;
    if reference.size() != test.size() {
        let ((width, height), (wanted_width, wanted_height)) = (test.size(), reference.size());
        bail!(
            "{}: size: {width}x{height}, but {} is {wanted_width}x{wanted_height}",
            args.test.display(),
            args.reference.display()
        );
    }
    let metrics = compare(&reference, &test, &options)?.metrics;
    if global.json {
        terminal::print(&(serde_json::to_string(&metrics)? + "\n"))?;
    } else {
        terminal::print(&text(&metrics))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn read(path: &Path) -> Result<Image<3>> {
    let image = exr::read_rgb(path)?;
    if image.pixels().is_empty() {
        bail!("{}: size: {:?} has no pixels", path.display(), image.size());
    }
    if let Some(index) = image.values().iter().position(|v| !v.is_finite()) {
        let (pixel, width) = (index / 3, image.width() as usize);
        bail!(
            "{}: pixel ({}, {}): {:?} is not finite",
            path.display(),
            pixel % width,
            pixel / width,
            image.values()[index]
        );
    }
    Ok(image)
}

fn text(metrics: &ImageMetrics) -> String {
    let rows = [
        ("psnr_srgb_db", metrics.psnr_srgb_db),
        ("psnr_linear_db", metrics.psnr_linear_db),
        ("psnr_pq_db", metrics.psnr_pq_db),
        ("ssim_srgb", metrics.ssim_srgb),
        ("flip_hdr", metrics.flip_hdr),
        ("flip_ldr_srgb", metrics.flip_ldr_srgb),
    ]
    .map(|(key, value)| (key, vec![Some(value)]));
    let flip = &metrics.flip_hdr_parameters;
    format!(
        "{}HDR-FLIP: {} pixels per degree, {}, {} exposures from {} to {} stops\n",
        table(rows.into_iter(), COLUMN_WIDTH),
        flip.ppd,
        flip.tonemapper.name(),
        flip.num_exposures,
        flip.start_exposure,
        flip.stop_exposure
    )
}
