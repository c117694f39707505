//! `eagpt edit`: a scene changed by a script.

use crate::args::GlobalArgs;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use crate::terminal;
use anyhow::{Context, Result};
use clap::Args;
use eagpt_edit::report::Bounds;
use eagpt_edit::{Edited, Script, StepReport};
use eagpt_scene::light_basis::lights_file_beside;
use eagpt_scene::{LightBasis, files, lamps, ply};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Change a scene by a script
///
/// A script is a TOML file of steps, each of which says what (a region, a range of values, a lamp,
/// a connected cluster, a new surface, a part of another scene) and then (remove, light, albedo,
/// move, rotate, scale, duplicate). All of it is checked before anything is touched, and it is
/// replayed with bit-identical results. Beside E.ply comes E.record.json, with digests of scene,
/// script and imported scenes and what every step found.
///
/// After an edit the radiance that Gaussians carry is no longer what they would reflect: render
/// with --mode path. Unless it only sets lights of a scene that was baked with --per-light: then
/// all Gaussians carry the new light, and E.lights beside E.ply goes on from there.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct EditArgs {
    /// Scene of 2D Gaussians, as `eagpt train` writes it
    #[arg(value_name = "SCENE.ply")]
    pub(crate) scene: PathBuf,
    /// Edit script; files it imports are relative to its folder
    #[arg(value_name = "SCRIPT.toml")]
    pub(crate) script: PathBuf,
    /// Lamps of the scene, for scripts that select some by name [default: lamps.json in its folder]
    #[arg(long, value_name = "LAMPS.json")]
    pub(crate) lamps: Option<PathBuf>,
    /// Light basis, reflected light of each lamp, for scripts that set lights [default:
    /// SCENE.lights, as `eagpt bake --per-light` writes it]
    #[arg(long, value_name = "SCENE.lights")]
    pub(crate) lights: Option<PathBuf>,
    /// Scene to write; needed unless it is a dry run
    #[arg(long, value_name = "E.ply", required_unless_present = "dry_run")]
    pub(crate) out: Option<PathBuf>,
    /// Print how many Gaussians each selection and step finds and where, and write nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Replace an earlier result of this command
    #[arg(long)]
    pub(crate) force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt edit runs/kitchen/scene.ply edit/examples/kitchen-light-ball.toml --dry-run
  eagpt edit runs/kitchen/scene.ply edit/examples/kitchen-light-ball.toml --out edits/ball.ply
  eagpt render edits/ball.ply --cameras kitchen --mode path --spp 256 --out renders/ball";

/// Options that decide the result, and its outcome, for the record.
#[derive(Serialize)]
struct Options<'a> {
    scene: &'a Path,
    script: &'a Path,
    #[serde(skip_serializing_if = "Option::is_none")]
    lamps: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lights: Option<&'a Path>,
    num_gaussians_before: usize,
    steps: &'a [StepReport],
}

pub(crate) fn run(args: &EditArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let mut builder = RecordBuilder::begin("edit", &(), global)?;
    let mut script = Script::read(&args.script)?;
    let lamps = script.needs_lamps().then(|| {
        let beside = || lamps::lamps_file_beside(&args.scene);
        args.lamps.clone().unwrap_or_else(beside)
    });
    if let Some(lamps) = &lamps {
        let problem = || format!("{}: selects lamps", args.script.display());
        script.set_lamps(lamps::read_lamps(lamps).with_context(problem)?)?;
    }
    let lights = script.needs_basis().then(|| {
        let beside = || lights_file_beside(&args.scene);
        args.lights.clone().unwrap_or_else(beside)
    });
    if let Some(lights) = &lights {
        let problem = || format!("{}: sets lights", args.script.display());
        script.set_basis(LightBasis::read(lights).with_context(problem)?)?;
    }
    let mut inputs = vec![args.scene.as_path(), args.script.as_path()];
    inputs.extend(lamps.as_deref());
    inputs.extend(lights.as_deref());
    inputs.extend(script.assets.iter().map(|asset| asset.path.as_path()));
    let out = args.out.as_deref().filter(|_| !args.dry_run);
    if let Some(out) = out {
        let replace = Replace::from_flag(args.force);
        output::check_file(out, "edit", &inputs, replace)?;
        output::check_part(&lights_file_beside(out), &inputs, replace)?;
    }
    let gaussians = ply::read_gaussians(&args.scene)?;
    let num_before = gaussians.len();
    let edited = eagpt_edit::replay(&script, gaussians)?;

    let reporter = Reporter::new(global);
    if args.dry_run && !global.json {
        terminal::print(&table(&edited, num_before))?;
    }
    if args.dry_run {
        for selection in &edited.selections {
            reporter.tagged("selection", selection)?;
        }
    }
    for step in &edited.steps {
        reporter.tagged("step", step)?;
    }
    let Some(out) = out else {
        return Ok(ExitCode::SUCCESS);
    };
    output::create_parent(out)?;
    let lights_out = lights_file_beside(out);
    let mut written = vec![out];
    match &edited.basis {
        Some(basis) => {
            basis.write(&lights_out)?;
            written.push(&lights_out);
        }
        // That of an earlier edit.
        None => files::remove_if_there(&lights_out)?,
    }
    ply::write_gaussians(out, &edited.gaussians)?;
    builder.set_options(&Options {
        scene: &args.scene,
        script: &args.script,
        lamps: lamps.as_deref(),
        lights: lights.as_deref(),
        num_gaussians_before: num_before,
        steps: &edited.steps,
    })?;
    let record = &mut builder.record;
    record.inputs = vec![
        Input::of(&args.scene)?,
        digest(script.file.path(), &script.blake3),
    ];
    for file in lamps.iter().chain(&lights) {
        record.inputs.push(Input::of(file)?);
    }
    let assets = script.assets.iter();
    record
        .inputs
        .extend(assets.map(|asset| digest(&asset.path, &asset.blake3)));
    builder.wrote(written.into_iter().filter_map(Path::file_name));
    let record_path = output::record_path(out);
    builder.write_to(&record_path)?;
    reporter.note(&format!(
        "{}: {} Gaussians, before {num_before}",
        out.display(),
        edited.gaussians.len()
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": out,
        "record": record_path,
        "num_gaussians": edited.gaussians.len(),
    }))?;
    Ok(ExitCode::SUCCESS)
}

fn digest(path: &Path, blake3: &str) -> Input {
    Input {
        path: path.to_owned(),
        blake3: blake3.to_owned(),
    }
}

/// The report of a dry run.
fn table(edited: &Edited, num_before: usize) -> String {
    let mut text = format!("scene: {num_before} Gaussians\n");
    for selection in &edited.selections {
        let found = found(selection.num_selected, selection.bounds);
        text += &format!("selection `{}`: {found}\n", selection.name);
    }
    for step in &edited.steps {
        let title = step
            .title
            .as_deref()
            .map_or(String::new(), |t| format!(" ({t})"));
        let found = found(step.num_selected, step.bounds);
        text += &format!(
            "step[{}], line {}{title}: {} {found}",
            step.step, step.line, step.source
        );
        if step.bounds_after != step.bounds {
            text += &match step.bounds_after {
                Some(bounds) => format!("; then at {}", shown(bounds)),
                None => "; then gone".to_owned(),
            };
        }
        if step.num_shrunk + step.num_dropped > 0 {
            text += &format!(
                "; trimmed: {} shrunk, {} dropped",
                step.num_shrunk, step.num_dropped
            );
        }
        text += &format!("; scene: {} Gaussians\n", step.num_gaussians);
    }
    text
}

fn found(num: usize, bounds: Option<Bounds>) -> String {
    match bounds {
        Some(bounds) => format!("{num} Gaussians at {}", shown(bounds)),
        None => "nothing".to_owned(),
    }
}

fn shown([low, high]: Bounds) -> String {
    let point = |p: [f32; 3]| format!("[{:.3}, {:.3}, {:.3}]", p[0], p[1], p[2]);
    format!("{} to {}", point(low), point(high))
}
