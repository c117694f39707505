//! `eagpt colmap import`: a COLMAP model and linear images become a dataset.

mod args;
mod survey;

use crate::args::GlobalArgs;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use anyhow::Result;
pub(crate) use args::ImportArgs;
use eagpt_colmap::align::Alignment;
use eagpt_colmap::import::{ImportOptions, ImportPlan, ImportProgress, ImportReport};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Options that decide the result, for the record.
#[derive(Serialize)]
struct Recorded<'a> {
    model: &'a PathBuf,
    #[serde(flatten)]
    options: &'a ImportOptions,
}

pub(super) fn run(args: &ImportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = args.options()?;
    let recorded = Recorded {
        model: &args.model,
        options: &options,
    };
    let mut builder = RecordBuilder::begin("colmap import", &recorded, global)?;
    let mut reporter = Reporter::new(global);
    if args.dry_run {
        survey::tell(&reporter, &args.model, &options)?;
    }
    let plan = ImportPlan::new(&args.model, &options).map_err(survey::with_advice)?;
    if !args.dry_run {
        tell_alignment(&reporter, plan.alignment())?;
    }
    for warning in plan.warnings() {
        reporter.warning(warning);
    }
    if args.dry_run {
        let num_images = plan.images().len();
        if options.images.is_some() {
            reporter.note(&format!("images: {num_images} files would be read"));
        }
        return Ok(ExitCode::SUCCESS);
    }
    let mut inputs = plan.images();
    inputs.extend(plan.inputs());
    let target = Target::new(&args.out, "colmap import", &inputs, args.force);
    let files = plan.files();
    target.check(&files)?;
    builder.record.inputs = plan
        .inputs()
        .iter()
        .map(|path| Input::of(path))
        .collect::<Result<_>>()?;
    target.prepare()?;
    let report = reporter.follow(tell, |progress| plan.run(&args.out, progress))?;
    reporter.note(&summary(&report));
    reporter.message(&serde_json::json!({
        "message": "imported",
        "out": args.out,
        "num_views": num_views(&report),
        "num_points": report.points.num_kept,
    }))?;
    builder.record.seed = Some(options.align.seed);
    builder.record.warnings.clone_from(&report.warnings);
    builder.wrote(files.iter().filter(|file| args.out.join(file).is_file()));
    builder.write(&args.out)?;
    Ok(ExitCode::SUCCESS)
}

fn tell(reporter: &mut Reporter, message: &ImportProgress) -> Result<()> {
    match message {
        ImportProgress::Image {
            condition,
            done,
            total,
            ..
        } => {
            let note = || condition.clone().unwrap_or_default();
            reporter.count_with(("images", "images"), (*done, *total), note, message)
        }
        ImportProgress::Warning { text } => {
            reporter.warning(text);
            reporter.message(message)
        }
    }
}

fn tell_alignment(reporter: &Reporter, alignment: &Alignment) -> Result<()> {
    if let Some(floor) = &alignment.floor {
        reporter.note(&format!(
            "floor: {} of {} points, tilt ± {:.2}°, {:.1}° from the cameras' level, {} points below; confidence {:.2}",
            floor.num_inliers,
            floor.num_points,
            floor.residual_tilt_deg,
            floor.tilt_from_gravity_deg,
            floor.num_below + floor.num_mirrored,
            floor.confidence
        ));
    }
    if let Some(walls) = &alignment.walls {
        reporter.note(&format!(
            "walls: {} lines, yaw ± {:.2}°",
            walls.num_lines, walls.yaw_std_deg
        ));
    }
    if let Some(height) = alignment.camera_height {
        let unit = if alignment.is_metric { "m" } else { "units" };
        reporter.note(&format!("cameras: {height:.2} {unit} above the floor"));
    }
    reporter.tagged("aligned", alignment)
}

fn num_views(report: &ImportReport) -> usize {
    report.conditions.iter().map(|c| c.registered.len()).sum()
}

fn summary(report: &ImportReport) -> String {
    let mut text = format!(
        "{} views, {} of {} points",
        num_views(report),
        report.points.num_kept,
        report.points.num_points
    );
    for camera in &report.cameras {
        let [width, height] = camera.image_size;
        let [pinhole_width, pinhole_height] = camera.pinhole_size;
        text += &format!(
            "\ncamera {}: {} {width}x{height} to pinhole {pinhole_width}x{pinhole_height}, {} views",
            camera.camera, camera.model, camera.num_views
        );
    }
    text
}
