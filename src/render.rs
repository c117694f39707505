//! `eagpt render`: images of a scene from the cameras of a dataset.

mod aov;
mod args;
mod denoise;
mod display;
mod files;
mod light;
mod shots;

use crate::args::GlobalArgs;
use crate::command_line;
use crate::interrupt;
use crate::output::{Replace, Target};
use crate::progress::Reporter;
use crate::record::{FILE_NAME, Input, Record, RecordBuilder};
use anyhow::Result;
use aov::Aov;
pub(crate) use args::{Mode, RenderArgs};
use denoise::{Choice, Denoising};
use eagpt_denoise::Denoiser;
use eagpt_render::{RenderJob, RenderProgress, Shot, render_views};
use eagpt_scene::files::{Key, Ledger, ledger};
use eagpt_scene::tonemap::Display;
use eagpt_scene::{Dataset, Shard, ply};
use eagpt_trace::{Integrator, LightOptions, RenderedView};
use light::SetLight;
use serde::Serialize;
use shots::{PathRecord, Shots};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Options that decide the result, for the record.
#[derive(Serialize)]
struct Options<'a> {
    scene: &'a Path,
    cameras: &'a Path,
    views: &'a [String],
    #[serde(
        skip_serializing_if = "<[_]>::is_empty",
        serialize_with = "command_line::texts"
    )]
    set_light: &'a [SetLight],
    /// Samples are counted for each camera ray.
    integrator: Integrator,
    rays_per_axis: u32,
    light: LightOptions,
    aov: &'a [Aov],
    denoise: Denoising,
    /// Exposure and tone map of the PNGs.
    display: Display,
    camera_path: Option<PathRecord<'a>>,
    /// Another rounds in another way.
    device: String,
}

pub(crate) fn run(args: &RenderArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let (integrator, light) = (args.integrator(), args.light());
    let noisy = integrator != Integrator::ZeroBounce;
    let denoiser = denoise::denoiser(args)?.filter(|_| noisy);
    let mut builder = RecordBuilder::begin("render", &(), global)?;
    if args.denoise != Choice::None && !noisy {
        let warning = "--denoise: 0-bounce samples no light, there is nothing to denoise";
        builder.record.warnings.push(warning.to_owned());
    }
    let dataset = Dataset::open_cameras(&args.cameras)?;
    let shots = Shots::choose(args, &dataset, &mut builder.record.warnings)?;
    let outputs = files::all(args, &shots);
    let mut inputs = dataset.files();
    let path_file = shots.path.as_ref().and_then(|path| path.file.clone());
    inputs.push(args.scene.clone());
    inputs.extend(path_file.clone());
    let lights = light::file(&args.scene, args.lights.as_deref(), &args.set_light);
    inputs.extend(lights.clone());
    let target = |replace| Target {
        replace,
        ..Target::new(&args.out, "render", &inputs, false)
    };
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    check(args, shard, &shots, &outputs, target)?;
    let mut gaussians = ply::read_gaussians(&args.scene)?;
    if let Some(file) = &lights {
        let seconds = light::apply(&mut gaussians, file, &args.set_light)?;
        builder.took("set_light", seconds);
    }
    builder.record.inputs = vec![Input::of(&args.scene)?, Input::of_cameras(&dataset)?];
    for file in path_file.iter().chain(&lights) {
        builder.record.inputs.push(Input::of(file)?);
    }
    let mut reporter = Reporter::new(global);
    let device = args.device.open(&mut reporter)?;
    let scene = device.scene(&gaussians)?;
    let display = args
        .display
        .resolve(scene.as_ref(), &shots.list, &integrator, &light)?;
    builder.set_options(&Options {
        scene: &args.scene,
        cameras: &args.cameras,
        views: &args.views,
        set_light: &args.set_light,
        integrator,
        rays_per_axis: args.antialias,
        light,
        aov: &args.aov,
        display,
        denoise: Denoising {
            asked: args.denoise,
            ran: denoiser.as_ref().map(Denoiser::identity),
        },
        camera_path: shots.path_record(),
        device: device.name(),
    })?;
    target(Replace::from_flag(args.force)).prepare()?;
    if args.force {
        ledger::clear(&args.out, "render")?;
    }
    let key = key(&builder.record, &outputs)?;
    let mut ledger = Ledger::open(&args.out, "render", &key, shard, ledger::ADVICE)?;
    ledger.check_shards()?;
    ledger.clear_temporaries(&files::of_shard(args, shard, &shots))?;

    for warning in &builder.record.warnings {
        reporter.warning(warning);
    }
    let stop = interrupt::stop_flag()?;
    let job = RenderJob {
        scene: scene.as_ref(),
        integrator,
        light,
        rays_per_axis: args.antialias,
        denoiser: denoiser.as_ref(),
        stop: &stop,
    };
    let mine: Vec<Shot> = shots.of_shard(shard).cloned().collect();
    let write = |shot: &Shot, rendered: &RenderedView| {
        files::write(args, &display, scene.as_ref(), (shot, rendered))
    };
    let summary = reporter.follow(tell, |progress| {
        render_views(&job, &mine, &mut ledger, write, progress)
    })?;
    if !summary.complete {
        reporter.note("stopped: the same command resumes");
        return Ok(interrupt::exit_code());
    }
    for (view, seconds) in &summary.views {
        builder.took(&format!("views/{view}"), *seconds);
    }
    if denoiser.is_some() {
        builder.took("denoising", summary.denoising_seconds);
    }
    if shard != Shard::WHOLE {
        ledger.complete()?;
        reporter.note(&format!("{}: part {shard}", args.out.display()));
        reporter.message(&serde_json::json!({
            "message": "done",
            "complete": false,
            "path": args.out.join(ledger::file_name(shard)),
        }))?;
        return Ok(ExitCode::SUCCESS);
    }
    shots.write_cameras(&args.out, &dataset)?;
    let record = &mut builder.record;
    record.seed = Some(light.seed);
    record.device = Some(device.name());
    record.split = shots.split.clone();
    builder.wrote(&outputs);
    builder.write(&args.out)?;
    ledger.close()?;
    let total = shots.list.len();
    reporter.note(&format!("{}: {total} views", args.out.display()));
    if let Some(command) = shots.video_command(&args.out) {
        reporter.note(&format!("as a video: {command}"));
    }
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out.join(FILE_NAME),
    }))?;
    Ok(ExitCode::SUCCESS)
}

/// Checks that the files of the shard may be written. Those of unfinished work may, if it is work
/// on this result: opening its ledger checks that.
fn check<'a>(
    args: &RenderArgs,
    shard: Shard,
    shots: &Shots,
    outputs: &[PathBuf],
    target: impl Fn(Replace) -> Target<'a>,
) -> Result<()> {
    if args.force {
        return target(Replace::Allow).check(outputs);
    }
    target(Replace::Continue).check(outputs)?;
    let left = ledger::shards(&args.out)?;
    // Parts of another division are refused by their own name.
    if left
        .iter()
        .any(|part| *part == shard || part.of != shard.of)
    {
        return Ok(());
    }
    target(Replace::Refuse).check(&files::of_shard(args, shard, shots))
}

/// Everything that decides the result: not where the inputs are, but their content.
fn key(record: &Record, outputs: &[PathBuf]) -> Result<Key> {
    let mut options = record.options.clone();
    if let Some(options) = options.as_object_mut() {
        options.retain(|name, _| name != "scene" && name != "cameras");
    }
    let inputs: Vec<&str> = record.inputs.iter().map(|i| i.blake3.as_str()).collect();
    let key = Key::new()
        .with_value("version", &record.version)?
        .with_value("options", &options)?
        .with_value("inputs", &inputs)?
        .with_value("outputs", &outputs)?;
    Ok(key)
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &RenderProgress) -> Result<()> {
    match message {
        RenderProgress::Started { done, total } => {
            reporter.begin("rendering", "views", *done as u64, *total as u64);
            Ok(())
        }
        RenderProgress::View { view, done, .. } => {
            reporter.advance(*done as u64, || view.clone());
            reporter.message(message)
        }
    }
}
