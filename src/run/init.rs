//! `eagpt init`: a project file to fill in.

use crate::args::GlobalArgs;
use crate::output;
use crate::progress::Reporter;
use anyhow::{Result, bail};
use clap::Args;
use eagpt_scene::files;
use eagpt_train::Preset;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write a project file with comments, for `eagpt run`
#[derive(Debug, Args)]
#[command(
    after_long_help = "Example:\n  eagpt init kitchen.toml --dataset data/kitchen --preset fast && eagpt run kitchen.toml --dry-run"
)]
pub(crate) struct InitArgs {
    /// File to write
    #[arg(value_name = "PROJECT.toml")]
    project: PathBuf,
    /// Dataset to start from, relative to the folder of the project
    #[arg(long, value_name = "DATASET", default_value = "dataset")]
    dataset: PathBuf,
    /// Set of options
    #[arg(long, value_enum, default_value = "fast")]
    preset: Preset,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(args: &InitArgs, global: &GlobalArgs) -> Result<ExitCode> {
    if args.project.exists() && !args.force {
        bail!(
            "{}: is there already: --force replaces it",
            args.project.display()
        );
    }
    output::create_parent(&args.project)?;
    let dataset = toml::Value::from(args.dataset.display().to_string());
    let text = TEMPLATE
        .replace("{dataset}", &dataset.to_string())
        .replace("{preset}", args.preset.name())
        .replace("{spp}", &spp(args.preset).to_string());
    files::write_bytes_atomic(&args.project, text.as_bytes())?;
    Reporter::new(global).note(&format!("{}", args.project.display()));
    Ok(ExitCode::SUCCESS)
}

/// Samples a pixel of the renderings of a project.
pub(crate) fn spp(preset: Preset) -> i64 {
    match preset {
        Preset::Draft => 16,
        Preset::Fast => 64,
        Preset::Paper => 1024,
    }
}

const TEMPLATE: &str = r#"# A project of eagpt: `eagpt run` does what it says, step by step, and only what has changed since the last time.
#
# Keys of a section are the options of the command of that name, with _ for -; `eagpt train --help` and so on explain them.
# Paths are relative to the folder of this file.

# Folder for all results; without it, the name of this file.
# out = "runs/room"

# Seed of every command.
seed = 0

# Photographs with their cameras: a folder with a transforms.json.
dataset = {dataset}

# The same place in other lights, trained on together with the first. Scripts of [[relight]] then find the lamps of all of them on.
# other_lights = ["dataset-evening"]

# A scene that is trained already, in place of the sections [masks] and [train].
# scene = "scene.ply"

# Which pixels show a light. Without this section, the masks that the dataset has are used.
[masks]
threshold = "auto"          # or a linear radiance; the paper takes 1.5
# labels = "labels/lamps"
# inconsistent = "drop"     # what other views do not confirm

# Which way surfaces face, by an estimator: its maps, or a network that you have. Without this section, the normals that the dataset has.
# [normals]
# maps = "normals/stable-normal"
# onnx = "dsine.onnx"

[train]
preset = "{preset}"
# gaussians = 60000
# set = ["radiance.rates.position=5e-5"]

# Renderings from the test views.
[render]
modes = ["0-bounce", "1-bounce", "path"]
aov = ["normal", "depth", "albedo", "emission", "alpha"]
spp = {spp}
denoise = "auto"

# Options of one mode alone.
# [render.path]
# bounces = 16
# russian_roulette = 1

# Changes of the light, as many as you like: an edit script and, if there is one, a dataset that shows what came of it, with the same views.
# [[relight]]
# name = "lamp"
# script = "lamp.toml"
# reference = "photographs-with-lamp"

# Light of the edited scenes, baked back for viewing at once.
[bake]
method = "gaussians"

[eval]
"#;
