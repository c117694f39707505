//! `eagpt export`: a scene for other programs.

use crate::args::GlobalArgs;
use crate::output;
use crate::progress::Reporter;
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use eagpt_scene::ply::{self, Preview};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Write a scene as PLY for other programs
///
/// The formats `2dgs` and `3dgs` are for looking: splat viewers open them, with the radiance as
/// display colour, clipped at white. Emission and albedo are lost: `eagpt import` reads such files
/// without them.
/// The format `eagpt` is the scene itself, written anew as binary little endian whatever the file's
/// own encoding was.
#[derive(Debug, Clone, Args)]
#[command(
    after_long_help = "Example:\n  eagpt export out/run/scene.ply --format 3dgs --out preview.ply"
)]
pub(crate) struct ExportArgs {
    /// Scene of 2D Gaussians, as `eagpt train` writes it
    #[arg(value_name = "SCENE.ply")]
    scene: PathBuf,
    /// Layout of the file to write
    #[arg(long, value_enum)]
    format: Format,
    /// File to write
    #[arg(long, value_name = "FILE.ply")]
    out: PathBuf,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Viewers of 2D Gaussians: two scales
    #[value(name = "2dgs")]
    TwoD,
    /// Viewers of 3D Gaussians: a third scale of nearly 0
    #[value(name = "3dgs")]
    ThreeD,
    /// The scene with all its properties
    Eagpt,
}

/// Refuses to replace the input, and without `force` any file.
///
/// # Errors
/// If the file is there.
pub(crate) fn check_target(out: &Path, input: &Path, force: bool) -> Result<()> {
    if !out.exists() {
        return Ok(());
    }
    if out.canonicalize().ok() == input.canonicalize().ok() {
        bail!("{}: --out would replace an input", out.display());
    }
    if !force {
        bail!("{}: is there already: --force replaces it", out.display());
    }
    Ok(())
}

pub(crate) fn run(args: &ExportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    check_target(&args.out, &args.scene, args.force)?;
    let gaussians = ply::read_gaussians(&args.scene)?;
    output::create_parent(&args.out)?;
    match args.format {
        Format::TwoD => ply::write_preview(&args.out, &gaussians, Preview::TwoD)?,
        Format::ThreeD => ply::write_preview(&args.out, &gaussians, Preview::ThreeD)?,
        Format::Eagpt => ply::write_gaussians(&args.out, &gaussians)?,
    }
    let reporter = Reporter::new(global);
    reporter.note(&format!(
        "{}: {} Gaussians",
        args.out.display(),
        gaussians.len()
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out,
        "num_gaussians": gaussians.len(),
    }))?;
    Ok(ExitCode::SUCCESS)
}
