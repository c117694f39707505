//! `eagpt export`: a scene for other programs, and for people with a browser.

use crate::args::GlobalArgs;
use crate::output::{self, Replace};
use crate::page::{PageArgs, ScenePage};
use crate::progress::Reporter;
use crate::source::Source;
use anyhow::Result;
use clap::{Args, ValueEnum};
use eagpt_scene::ply::{self, Preview};
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, files};
use eagpt_viewer::page::PageKind;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Write a scene as PLY for other programs, or as a page for a browser
///
/// The format `html` is one file that needs nothing else, opened from disk or sent to someone: the
/// scene to walk through, with its lamps and, with --dataset, its cameras and photographs. Every
/// pixel blends the discs that its ray meets, as renderings of --mode 0-bounce do. Values are
/// quantised; their largest errors are printed. The formats `2dgs` and `3dgs` are for looking:
/// splat viewers open them, with the radiance as display colour, clipped at white. Emission and
/// albedo are lost: `eagpt import` reads such files without them. The format `eagpt` is the scene
/// itself, written anew as binary little endian whatever the file's own encoding was; `eag-pt` is
/// what the code of EAG-PT reads of it, without harmonics and gloss and with albedos up to 1.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ExportArgs {
    /// Scene of 2D Gaussians, as `eagpt train` writes it; or folder of a run or project of `eagpt
    /// run`, whose page has the views of its dataset
    #[arg(value_name = "SCENE.ply|RUN|PROJECT.toml")]
    scene: PathBuf,
    /// Layout of the file to write
    #[arg(long, value_enum)]
    format: Format,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    page: PageArgs,
}

const EXAMPLES: &str = "Examples:
  eagpt export out/run/scene.ply --format 3dgs --out preview.ply
  eagpt export out/run/scene.ply --format html --dataset kitchen --out kitchen.html
  eagpt export runs/kitchen --format html --out kitchen.html";

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
    /// The 17 properties of EAG-PT, whose albedos are at most 1
    EagPt,
    /// A page with the scene, for a browser
    Html,
}

/// The Gaussians with the properties and ranges of EAG-PT.
fn as_in_eag_pt(gaussians: &Gaussians) -> Gaussians {
    let plain = |g: Gaussian| Gaussian {
        albedo: g.albedo.min(Vec3::ONE),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        ..g
    };
    gaussians.iter().map(plain).collect()
}

/// Writes the page of `scene`, with the views of `dataset`, in place of one that is there.
///
/// # Errors
/// As `eagpt export --format html`.
pub(crate) fn write_page(
    scene: &Path,
    dataset: &Path,
    out: &Path,
    global: &GlobalArgs,
) -> Result<ExitCode> {
    let args = ExportArgs {
        scene: scene.to_owned(),
        format: Format::Html,
        out: out.to_owned(),
        force: true,
        page: PageArgs::default().for_run(None, Some(dataset.to_owned())),
    };
    run(&args, global)
}

pub(crate) fn run(args: &ExportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let source = Source::find(&args.scene)?;
    let scene = &source.scene;
    output::check_part(&args.out, &[scene], Replace::from_flag(args.force))?;
    if args.format != Format::Html {
        args.page.refuse()?;
    }
    let gaussians = ply::read_gaussians(scene)?;
    output::create_parent(&args.out)?;
    let mut error = None;
    let reporter = Reporter::new(global);
    match args.format {
        Format::TwoD => ply::write_preview(&args.out, &gaussians, Preview::TwoD)?,
        Format::ThreeD => ply::write_preview(&args.out, &gaussians, Preview::ThreeD)?,
        Format::Eagpt => ply::write_gaussians(&args.out, &gaussians)?,
        Format::EagPt => ply::write_gaussians(&args.out, &as_in_eag_pt(&gaussians))?,
        Format::Html => {
            let page = source.page(&args.page, &reporter)?;
            let page = ScenePage::new(scene, &gaussians, &page)?;
            files::write_bytes_atomic(
                &args.out,
                page.html(&gaussians, PageKind::File)?.as_bytes(),
            )?;
            error = Some(page.pack.error(&gaussians)?);
        }
    }
    reporter.note(&format!(
        "{}: {} Gaussians",
        args.out.display(),
        gaussians.len()
    ));
    if let Some(error) = &error {
        reporter.note(&format!("largest errors of the quantised values: {error}"));
    }
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out,
        "num_gaussians": gaussians.len(),
        "quantisation_error": error,
    }))?;
    Ok(ExitCode::SUCCESS)
}
