//! `eagpt demo`: the whole chain on a simulated capture.

use crate::args::GlobalArgs;
use crate::device::DeviceArgs;
use crate::export;
use crate::progress::Reporter;
use crate::run::{self, Project};
use anyhow::{Context, Result, bail};
use clap::Args;
use eagpt_scene::files;
use eagpt_trace::DeviceSelector;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Show the whole chain on a simulated capture
///
/// A virtual camera photographs a furnished room by day and with two of its lamps, in RAW brackets.
/// They are merged, posed, masked and trained on together; then the window goes dark and a lamp
/// goes on that was off in both lights, by an edit script, and what comes out is compared with what
/// that evening really looked like. DIR/run/report.html shows it all, and links to a page of the
/// evening to walk through, DIR/run/bake/evening.html. Takes a few minutes and needs nothing but
/// this program.
///
/// DIR/demo.toml is the project of the demo: `eagpt run DIR/demo.toml` resumes it, and repeats the
/// steps that a change affects.
#[derive(Debug, Args)]
#[command(after_long_help = "Examples:\n  eagpt demo\n  eagpt demo --quick --out out/demo")]
pub(crate) struct DemoArgs {
    /// Folder for everything; created
    #[arg(long, value_name = "DIR", default_value = "eagpt-demo")]
    out: PathBuf,
    /// A smaller room, fewer samples: to see that everything works
    #[arg(long)]
    quick: bool,
    /// Seed of everything, 0 to 2^32 − 1
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u32,
    /// Show the report with the program that opens HTML files
    #[arg(long)]
    open: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

/// The step that the report follows.
const BEFORE_REPORT: &str = "table";
const PROJECT: &str = include_str!("demo/project.toml");
const EVENING: &str = include_str!("demo/evening.toml");

/// Options that make the difference between the demo and its quick form: placeholder, text, text if
/// quick.
const CHOICES: [(&str, &str, &str); 4] = [
    (
        "{synth}",
        "spp = 8",
        "spp = 4\nviews = 24\nsize = \"120x80\"",
    ),
    (
        "{train}",
        "preset = \"draft\"\ngaussians = 40000\niterations = 1800\nset = [\"albedo.num_samples=128\"]",
        "preset = \"draft\"\ngaussians = 8000\niterations = 400\nalbedo_iterations = 60",
    ),
    ("{render}", "spp = 16", "spp = 8"),
    ("{bake}", "samples = 128", "samples = 32\nbounces = 4"),
];

pub(crate) fn run(args: &DemoArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let mut project = PROJECT.replace("{seed}", &args.seed.to_string());
    for (placeholder, text, quick) in CHOICES {
        let text = if args.quick { quick } else { text };
        let device = match placeholder {
            "{train}" | "{render}" | "{bake}" => device_line(&args.device.device),
            _ => String::new(),
        };
        project = project.replace(placeholder, &format!("{text}{device}"));
    }
    let path = args.out.join("demo.toml");
    // A project that somebody has changed is theirs.
    keep(&path, &project)?;
    keep(&args.out.join("evening.toml"), EVENING)?;
    let project = Project::read(&path, None)?;
    let code = run::run_project(&project, Some(BEFORE_REPORT), global)?;
    if code != ExitCode::SUCCESS {
        return Ok(code);
    }
    // The report links to pages that are there when it is written.
    let evening = args.out.join("run/bake/evening.ply");
    let dataset = args.out.join("run/capture/truth/evening");
    let page = evening.with_extension("html");
    export::write_page(&evening, &dataset, &page, global)?;
    let code = run::run_step(&project, "report", global)?;
    if code != ExitCode::SUCCESS {
        return Ok(code);
    }
    let report = args.out.join("run/report.html");
    Reporter::new(global).note(&format!("report: {}", report.display()));
    if args.open {
        open_file(&report)?;
    }
    Ok(code)
}

/// Shows a file with the program that the system has for its kind.
///
/// # Errors
/// If there is no such program.
fn open_file(path: &Path) -> Result<()> {
    let program = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    std::process::Command::new(program)
        .arg(path)
        .spawn()
        .map(|_| ())
        .with_context(|| format!("{program} {}", path.display()))
}

/// Line of a project section about the device: empty, unless one is asked for.
fn device_line(device: &DeviceSelector) -> String {
    match device {
        DeviceSelector::Auto => String::new(),
        device => format!("\ndevice = {}", toml::Value::String(device.to_string())),
    }
}

/// Writes a file, or makes sure that it is the one that is there.
fn keep(path: &Path, text: &str) -> Result<()> {
    if path.exists() {
        if files::read(path)? == text.as_bytes() {
            return Ok(());
        }
        bail!(
            "{}: is not what these options write: `eagpt run` takes it as it is, --out names another folder",
            path.display()
        );
    }
    crate::output::create_parent(path)?;
    Ok(files::write_bytes_atomic(path, text.as_bytes())?)
}
