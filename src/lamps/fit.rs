//! `eagpt lamps fit`: powers and colours of lamps that explain photographs in another light.

use super::columns;
use crate::args::GlobalArgs;
use crate::device::DeviceArgs;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_scene::files;
use eagpt_scene::light_basis::lights_file_beside;
use eagpt_train::light_fit::{
    FitViews, FittedLight, LightFit, LightFitProgress, LightFitRequest, fit_lights,
};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Find the powers and colours of all lamps that explain photographs in another light
///
/// The scene has been baked with `--per-light`. Of a few views in the new light, non-negative least
/// squares gives each light's factor, by channel: its light as parts of that of the bake. Prints
/// the factors with their standard errors, and writes an edit script that sets them: `eagpt edit`
/// then gives the whole scene that light.
///
/// A scene reflects somewhat too much or too little of a lamp. --before names photographs of the
/// same views in the light of the bake: factors are then relative to those that explain these, and
/// are powers, where without it they are what makes the scene look most like the photographs.
///
/// A view that shows a lamp says most of it. Standard errors are by how much blocks of pixels
/// disagree (an eighth of the width of a view); they do not tell what the scene gets wrong
/// everywhere. Clipped channels and unknown pixels do not count.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct FitArgs {
    /// Scene as `eagpt bake --per-light` writes it
    #[arg(value_name = "BAKED.ply")]
    scene: PathBuf,
    /// Photographs in the new light: a dataset in the world of the scene
    #[arg(long, value_name = "DATASET")]
    reference: PathBuf,
    /// Photographs of the same views in the light of the bake
    #[arg(long, value_name = "DATASET")]
    before: Option<PathBuf>,
    /// Views to fit, separated by commas [default: --num-views of them]
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    views: Vec<String>,
    /// Views to fit, at least 1: of those of the reference the ones that tell most of the lights,
    /// as they show the lamps themselves
    #[arg(long, value_name = "N", default_value_t = 3, conflicts_with = "views", value_parser = clap::value_parser!(u32).range(1..))]
    num_views: u32,
    /// Light basis, reflected light of each lamp [default: BAKED.lights beside BAKED.ply]
    #[arg(long, value_name = "BAKED.lights")]
    lights: Option<PathBuf>,
    /// Edit script to write, which sets the lights
    #[arg(long, value_name = "LIGHT.toml")]
    out: Option<PathBuf>,
    /// Replace the script if it is there
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

const EXAMPLES: &str = "Examples:
  eagpt bake runs/room/scene.ply --cameras room/day --per-light --out bakes/room.ply
  eagpt lamps fit bakes/room.ply --reference room/evening --before room/day --out evening.toml
  eagpt edit bakes/room.ply evening.toml --out edits/evening.ply";

pub(super) fn run(args: &FitArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let beside = || lights_file_beside(&args.scene);
    let lights = args.lights.clone().unwrap_or_else(beside);
    if let Some(out) = &args.out {
        let inputs = [args.scene.as_path(), &lights];
        output::check_part(out, &inputs, Replace::from_flag(args.force))?;
    }
    let views = match args.views.is_empty() {
        true => FitViews::Best(args.num_views as usize),
        false => FitViews::Named(args.views.clone()),
    };
    let mut reporter = Reporter::new(global);
    let request = LightFitRequest {
        scene: args.scene.clone(),
        lights,
        reference: args.reference.clone(),
        before: args.before.clone(),
        views,
        device: args.device.open(&mut reporter)?,
    };
    let fit = reporter.follow(tell, |progress| fit_lights(&request, progress))?;
    if !global.json && !global.quiet {
        terminal::print(&table(&fit))?;
    }
    if let Some(out) = &args.out {
        output::create_parent(out)?;
        files::write_bytes_atomic(out, script(&args.reference, &fit).as_bytes())?;
        reporter.note(&format!("{}: {} lights", out.display(), fit.lights.len()));
    }
    let mut done = serde_json::to_value(&fit)?;
    done["message"] = "done".into();
    done["path"] = serde_json::to_value(&args.out)?;
    reporter.message(&done)?;
    Ok(ExitCode::SUCCESS)
}

fn tell(reporter: &mut Reporter, message: &LightFitProgress) -> Result<()> {
    let LightFitProgress::Rendering { done, total } = *message;
    reporter.count(("rendering", "lights"), (done, total), message)
}

fn table(fit: &LightFit) -> String {
    let numbers = |values: [f64; 3]| values.map(|value| format!("{value:.3}")).join(" ");
    let rows: Vec<[String; 4]> = (fit.lights.iter())
        .map(|light| {
            let [factor, error] = match light.is_seen {
                true => [light.factor, light.error].map(numbers),
                false => ["not seen".to_owned(), "--".to_owned()],
            };
            let before = light.before.map_or_else(|| "--".to_owned(), numbers);
            [light.name.clone(), factor, error, before]
        })
        .collect();
    let headings = ["light", "factor R G B", "standard error", "before"];
    columns(&headings, &rows)
        + &format!(
            "{:.1} % of the light of {} is left unexplained\n",
            100.0 * fit.unexplained,
            fit.views.join(", ")
        )
}

/// The edit script that sets the lights.
fn script(reference: &Path, fit: &LightFit) -> String {
    let title = toml::Value::from(format!("Light of {}", reference.display()));
    let views = fit.views.join(", ");
    let mut text = format!(
        "# Fitted by `eagpt lamps fit` to the views {views}. Comments are standard errors.\n\n\
         [[step]]\ntitle = {title}\n\n[step.set_light]\n"
    );
    for light in &fit.lights {
        text += &line(light);
    }
    text
}

fn line(light: &FittedLight) -> String {
    let name = toml::Value::from(light.name.as_str());
    if !light.is_seen {
        return format!("# {name} is not seen\n");
    }
    let list = |values: [f64; 3]| values.map(|value| format!("{value:.5}")).join(", ");
    let mut line = format!("{name} = [{}]", list(light.factor));
    // Writing to a string does not fail.
    writeln!(line, "  # {}", list(light.error)).ok();
    line
}
