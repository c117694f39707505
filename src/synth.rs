//! `eagpt synth`: a virtual room, photographed.

use crate::args::{self, GlobalArgs};
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use crate::terminal;
use anyhow::{Context, Result};
use clap::Args;
use eagpt_scene::files;
use eagpt_synth::capture::{self, LightMethod, Parts};
use eagpt_synth::scenes::{self, SCENES};
use eagpt_synth::{SampleNoise, SceneScript, SynthOptions, SynthProgress, simulate};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Photograph a virtual room: RAW brackets, and the truth behind them
///
/// A scene is a TOML file: a room, its furniture, its lights in each condition, cameras and the
/// camera's sensor. Light is path-traced and then photographed as a camera would: through a colour
/// filter array, with vignetting, noise, clipping, in brackets of DNG files.
///
/// In CAPTURE come <condition>/<position>_<exposure>.dng, capture.toml (which files belong
/// together), truth/<condition>/ (a dataset without noise: radiance, emission masks, normals,
/// depth, albedo, cameras, points), colmap/sparse/0 (the model COLMAP would give, in a frame of its
/// own) and synth.json (everything that is true of it).
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct SynthArgs {
    /// Scene file, or the name of a scene that comes with the program
    #[arg(value_name = "SCENE", required_unless_present = "list")]
    pub(crate) scene: Option<String>,
    /// Folder for the capture
    #[arg(long, value_name = "CAPTURE", required_unless_present_any = ["list", "print"])]
    pub(crate) out: Option<PathBuf>,
    /// List the scenes that come with the program
    #[arg(long, conflicts_with_all = ["scene", "print"])]
    list: bool,
    /// Print the scene file, to start another from
    #[arg(long)]
    print: bool,
    /// Parts to write
    #[arg(long, value_enum, default_value = "all")]
    parts: Parts,
    /// Size of the truth images, pixels, 8x8 to 16384x16384; the sensor has more by the rig's
    /// oversampling [default: the scene's]
    #[arg(long, value_name = "WxH", value_parser = args::size(8..=16_384))]
    size: Option<[u32; 2]>,
    /// Number of positions, 1 to 10000 [default: the scene's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: Option<u32>,
    /// Samples for each pixel of the truth, 1 to 65536
    #[arg(long, value_name = "N", default_value_t = SynthOptions::default().num_samples, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    spp: u32,
    /// Method for indirect light
    #[arg(long, value_enum, default_value = "cached")]
    light: LightMethod,
    /// Leave the noise of sampled light in the truth, instead of filtering it
    #[arg(long)]
    unfiltered: bool,
    /// Points of the truth's clouds, 0 to 100000000
    #[arg(long, value_name = "N", default_value_t = SynthOptions::default().num_points, value_parser = clap::value_parser!(u32).range(..=100_000_000))]
    points: u32,
    /// Seed of the random numbers, 0 to 2^63 − 1
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = args::seed())]
    seed: u64,
    /// Replace an earlier result of this command
    #[arg(long)]
    pub(crate) force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt synth furnished-room --out captures/furnished
  eagpt synth small-room --out captures/small --parts truth --views 24
  eagpt synth furnished-room --print > my-room.toml
  eagpt synth my-room.toml --out captures/mine --size 540x360 --spp 256";

/// Options that decide the result, for the record.
#[derive(Serialize)]
struct Recorded<'a> {
    scene: &'a str,
    #[serde(flatten)]
    options: &'a SynthOptions,
}

pub(crate) fn run(args: &SynthArgs, global: &GlobalArgs) -> Result<ExitCode> {
    if args.list {
        let width = SCENES.iter().map(|scene| scene.name.len()).max();
        for scene in SCENES {
            let (name, about, width) = (scene.name, scene.about, width.unwrap_or(0));
            terminal::print(&format!("{name:width$}  {about}\n"))?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    // The parser has made sure of both.
    let scene = args.scene.as_deref().context("SCENE is missing")?;
    let file = PathBuf::from(scene);
    let (text, inputs) = match scenes::embedded(scene) {
        Some(embedded) => (embedded.toml.as_bytes().to_vec(), Vec::new()),
        None => (files::read(&file)?, vec![file.clone()]),
    };
    if args.print {
        terminal::print(&String::from_utf8_lossy(&text))?;
        return Ok(ExitCode::SUCCESS);
    }
    let out = args.out.as_deref().context("--out is missing")?;
    let script = SceneScript::parse(&file, &text)?;
    let options = options(args);
    let mut builder = RecordBuilder::begin(
        "synth",
        &Recorded {
            scene,
            options: &options,
        },
        global,
    )?;
    let target = Target::new(out, "synth", &inputs, args.force);
    target.check(&capture::outputs(&script, &options))?;
    target.prepare()?;
    let mut reporter = Reporter::new(global);
    let summary = reporter.follow(tell, |progress| simulate(&script, out, &options, progress))?;
    let record = &mut builder.record;
    record.inputs = vec![Input {
        path: script.path.clone(),
        blake3: script.blake3.clone(),
    }];
    record.seed = Some(args.seed);
    record.device = Some("cpu".to_owned());
    builder.wrote(&summary.files);
    let record_path = builder.write(out)?;
    reporter.note(&format!(
        "{}: {} positions, {} conditions, {} RAW files",
        out.display(),
        summary.num_views,
        script.conditions.len(),
        summary.num_shots
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": out,
        "record": record_path,
        "conditions": script.conditions,
        "num_views": summary.num_views,
        "num_shots": summary.num_shots,
    }))?;
    Ok(ExitCode::SUCCESS)
}

fn options(args: &SynthArgs) -> SynthOptions {
    SynthOptions {
        parts: args.parts,
        size: args.size,
        num_views: args.views,
        num_samples: args.spp,
        light: args.light,
        noise: if args.unfiltered {
            SampleNoise::Kept
        } else {
            SampleNoise::Filtered
        },
        num_points: args.points,
        seed: args.seed,
    }
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &SynthProgress) -> Result<()> {
    match *message {
        SynthProgress::Lit { .. } => reporter.message(message),
        SynthProgress::Photographing { done, total } => {
            reporter.count(("photographing", "views"), (done, total), message)
        }
    }
}
