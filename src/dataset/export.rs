//! `eagpt dataset export`: a dataset for other programs.

use crate::args::GlobalArgs;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use anyhow::Result;
use clap::Args;
use eagpt_convert::export::{Images, planned_files};
use eagpt_convert::{ExportFormat, ExportProgress, export};
use eagpt_scene::Dataset;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Write a dataset for other programs
///
/// The world stays as it is, images are copied byte by byte: what comes back by `eagpt dataset
/// import` has the same cameras and colours. Masks of lights, normals, depths and albedos, for
/// which COLMAP and nerfstudio have no place, go into our own folders beside.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ExportArgs {
    /// Dataset: a folder with a transforms.json, or that file
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// Layout to write
    #[arg(long, value_enum)]
    format: ExportFormat,
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Images to copy
    #[arg(long, value_enum, default_value = "copy")]
    images: Images,
    /// Replace an earlier result of this command
    #[arg(long)]
    force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt dataset export kitchen --format colmap --out kitchen-colmap
  eagpt dataset export kitchen --format nerfstudio --images none --out kitchen-cameras";

#[derive(Serialize)]
struct Recorded<'a> {
    dataset: &'a Path,
    format: ExportFormat,
    images: Images,
}

pub(super) fn run(args: &ExportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let (format, images) = (args.format, args.images);
    let recorded = Recorded {
        dataset: &args.dataset,
        format,
        images,
    };
    let mut builder = RecordBuilder::begin("dataset export", &recorded, global)?;
    let dataset = Dataset::open(&args.dataset)?;
    let inputs = dataset.files();
    let target = Target::new(&args.out, "dataset export", &inputs, args.force);
    let planned = planned_files(&dataset, format, images);
    target.check(&planned)?;
    super::refuse_foreign(&args.out, &planned)?;
    target.prepare()?;
    let mut reporter = Reporter::new(global);
    let summary = reporter.follow(tell, |progress| {
        export(&dataset, format, images, &args.out, progress)
    })?;
    let record = &mut builder.record;
    record.inputs.push(Input::of_cameras(&dataset)?);
    record.warnings.clone_from(&summary.warnings);
    builder.wrote(&summary.outputs);
    builder.write(&args.out)?;
    reporter.note(&format!(
        "{}: {} views, {} points",
        args.out.display(),
        dataset.len(),
        summary.num_points
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out,
        "format": format,
        "num_views": dataset.len(),
        "num_points": summary.num_points,
    }))?;
    Ok(ExitCode::SUCCESS)
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &ExportProgress) -> Result<()> {
    match message {
        ExportProgress::Exporting { done, total } => {
            reporter.count(("exporting", "views"), (*done, *total), message)
        }
        ExportProgress::Warning { text } => {
            reporter.warning(text);
            reporter.message(message)
        }
    }
}
