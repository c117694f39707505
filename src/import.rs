//! `eagpt import`: Gaussians of other programs become a scene.

use crate::args::GlobalArgs;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use anyhow::{Result, bail};
use clap::Args;
use eagpt_convert::{SplatColor, SplatOptions, SplatReport, import_splats};
use eagpt_scene::{Dataset, ply};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Make a scene of the Gaussians of another program
///
/// Reads PLY of 3D and of 2D Gaussian Splatting and SPZ (versions 1 to 3), found out from the file.
/// Display colours become linear light; harmonics of degrees 0 to 2 are fitted, by least squares
/// over directions, by the radiance and harmonics of a scene; the error is told. Ellipsoids become
/// discs of their two longest axes. The world stays as it is (that of SPZ as its own tools export
/// PLY), unless --aligned names a dataset.
///
/// Such files tell neither lamps nor material: emission is 0 and albedo 0.5. The scene can be
/// rendered with --mode 0-bounce, and measured; `eagpt train DATASET --start SCENE.ply` trains on
/// from it, with emission masks of `eagpt masks` its emission, and then its albedo.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ImportArgs {
    /// Gaussians of another program: .ply or .spz
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Scene to write
    #[arg(long, value_name = "SCENE.ply")]
    out: PathBuf,
    /// Dataset of `eagpt colmap import`, of whose COLMAP model the Gaussians were trained: moves
    /// them into its world, by its aligned_from_model
    #[arg(long, value_name = "DATASET")]
    aligned: Option<PathBuf>,
    /// Encoding of the colours in FILE
    #[arg(long, value_enum, default_value = "srgb")]
    color: SplatColor,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt import point_cloud.ply --out scene.ply
  eagpt import room.spz --aligned kitchen --out scene.ply
  eagpt render scene.ply --cameras kitchen --mode 0-bounce --out renders/0
  eagpt train kitchen --start scene.ply --out runs/kitchen";

pub(crate) fn run(args: &ImportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    output::check_part(&args.out, &[&args.file], Replace::from_flag(args.force))?;
    let options = SplatOptions {
        color: args.color,
        scene_from_file: args.aligned.as_deref().map(transform).transpose()?,
    };
    let (gaussians, report) = import_splats(&args.file, &options)?;
    output::create_parent(&args.out)?;
    ply::write_gaussians(&args.out, &gaussians)?;
    let reporter = Reporter::new(global);
    for warning in &report.warnings {
        reporter.warning(warning);
    }
    reporter.note(&summary(args, &report));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out,
        "report": report,
    }))?;
    Ok(ExitCode::SUCCESS)
}

fn summary(args: &ImportArgs, report: &SplatReport) -> String {
    format!(
        "{}: {} Gaussians of {}, harmonics of degree {}: light differs by {:.2} % (root mean square), without harmonics by {:.2} %",
        args.out.display(),
        report.num_gaussians,
        report.format,
        report.degree,
        100.0 * report.residual,
        100.0 * report.residual_without_harmonics
    )
}

/// The similarity from a model's world into that of a dataset.
fn transform(path: &Path) -> Result<[[f64; 4]; 4]> {
    let dataset = Dataset::open_cameras(path)?;
    match dataset.aligned_from_model() {
        Some(rows) => Ok(*rows),
        None => bail!(
            "{}: aligned_from_model: missing, the dataset does not know the world of a model",
            dataset.transforms().display()
        ),
    }
}
