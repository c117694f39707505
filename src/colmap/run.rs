//! `eagpt colmap run`: drives an installed COLMAP.

use crate::args::GlobalArgs;
use crate::command_line;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::RecordBuilder;
use anyhow::Result;
use clap::Args;
use eagpt_colmap::model::{Form, Part};
use eagpt_colmap::run::{
    Cameras, Done, LOG_FILE, Matcher, REPORT_FILE, RunOptions, RunProgress, list_images, run as job,
};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Run an installed COLMAP on a folder of photographs
///
/// Finds features, matches and a sparse model with settings that suit rooms, on the CPU and without
/// a display, and says which images got a pose and which did not. Needs the program `colmap`, 3.8
/// or later: `apt-get install colmap`.
///
/// COLMAP reads 8-bit pictures; give it the pictures that were developed beside the linear
/// images, under the same names. It is not repeatable to the bit.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = OUTPUTS_AND_EXAMPLES)]
pub(crate) struct RunArgs {
    /// Folder of pictures (JPEG, PNG, TIFF)
    #[arg(value_name = "IMAGES")]
    pub(crate) images: PathBuf,
    /// Folder for the model; created
    #[arg(long, value_name = "MODEL")]
    pub(crate) out: PathBuf,
    /// Camera model, by COLMAP's name
    #[arg(long, value_name = "NAME", default_value_t = RunOptions::default().camera_model)]
    camera_model: String,
    /// Which images share a camera
    #[arg(long, value_enum, default_value = "auto")]
    #[serde(serialize_with = "command_line::value")]
    cameras: Cameras,
    /// Which images are compared
    #[arg(long, value_enum, default_value = "auto")]
    #[serde(serialize_with = "command_line::value")]
    matcher: Matcher,
    /// Folder of masks, NAME.EXT.png for the picture NAME.EXT; black is ignored
    #[arg(long, value_name = "DIR")]
    masks: Option<PathBuf>,
    /// Longest edge of the images for feature detection, pixels, at least 1
    #[arg(long, value_name = "PX", default_value_t = RunOptions::default().max_image_size)]
    max_image_size: u32,
    /// Maximum number of features of an image, at least 1
    #[arg(long, value_name = "N", default_value_t = RunOptions::default().max_features)]
    max_features: u32,
    /// The program: its name, or a path
    #[arg(long, value_name = "PROGRAM", default_value = "colmap")]
    colmap: PathBuf,
    /// Replace an earlier run in MODEL
    #[arg(long)]
    pub(crate) force: bool,
}

const OUTPUTS_AND_EXAMPLES: &str = "Files in MODEL:
  cameras.bin, images.bin, points3D.bin  the model; with rigs.bin and frames.bin if COLMAP writes them
  run.json                               registered and lost images
  colmap.log                             what COLMAP said
  record.json                            version, options, times, memory

Examples:
  eagpt colmap run capture/previews --out sparse
  eagpt colmap run capture/previews --out sparse --masks capture/masks --camera-model OPENCV_FISHEYE
  eagpt colmap import sparse --images capture --out kitchen";

impl RunArgs {
    fn options(&self, global: &GlobalArgs) -> RunOptions {
        RunOptions {
            program: self.colmap.clone(),
            camera_model: self.camera_model.clone(),
            cameras: self.cameras,
            matcher: self.matcher,
            masks: self.masks.clone(),
            max_image_size: self.max_image_size,
            max_features: self.max_features,
            threads: global.threads.and_then(|num| u32::try_from(num.get()).ok()),
        }
    }
}

#[derive(Serialize)]
struct Recorded<'a> {
    images: &'a PathBuf,
    #[serde(flatten)]
    options: &'a RunOptions,
}

pub(super) fn run(args: &RunArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = args.options(global);
    let recorded = Recorded {
        images: &args.images,
        options: &options,
    };
    let mut builder = RecordBuilder::begin("colmap run", &recorded, global)?;
    options.validate()?;
    let names = list_images(&args.images)?;
    let inputs: Vec<PathBuf> = names.iter().map(|name| args.images.join(name)).collect();
    let target = Target::new(&args.out, "colmap run", &inputs, args.force);
    let parts = Part::ALL.map(|part| part.path("".as_ref(), Form::Binary));
    let mut files = parts.to_vec();
    files.extend([REPORT_FILE, LOG_FILE].map(PathBuf::from));
    target.check(&files)?;
    target.prepare()?;
    let mut reporter = Reporter::new(global);
    let num_images = names.len() as u64;
    let report = reporter.follow(
        |reporter, message| tell(reporter, message, num_images),
        |progress| job(&args.images, &args.out, &options, progress),
    )?;
    reporter.note(&format!(
        "{}: {} of {} images registered, {} points",
        report.version,
        report.registered.len(),
        names.len(),
        report.num_points
    ));
    if report.num_models > 1 {
        let text = format!(
            "the images fell into {} models; the largest was taken",
            report.num_models
        );
        reporter.warning(&text);
        builder.record.warnings.push(text);
    }
    if !report.lost.is_empty() {
        let text = format!(
            "{} images lost: {}",
            report.lost.len(),
            report.lost.join(", ")
        );
        reporter.warning(&text);
        builder.record.warnings.push(text);
    }
    reporter.tagged("registered", &report)?;
    builder.record.device = Some(report.version.clone());
    builder.wrote(files.iter().filter(|file| args.out.join(file).is_file()));
    builder.write(&args.out)?;
    Ok(ExitCode::SUCCESS)
}

fn tell(reporter: &mut Reporter, message: &RunProgress, num_images: u64) -> Result<()> {
    if let RunProgress::Line { step, text, done } = message {
        tracing::info!("{step}: {text}");
        if let Some(Done { done, total }) = done {
            // The mapper counts images and does not know how many will be.
            let total = if *total == 0 { num_images } else { *total };
            let unit = match *step {
                "matches" => "parts",
                _ => "images",
            };
            reporter.show((step, unit), (*done, total), String::new);
        }
    }
    reporter.message(message)
}
