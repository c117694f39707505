//! `eagpt lamps`: the lamps of a scene, and how they compare with those of a virtual room.

mod fit;

use crate::args::GlobalArgs;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use crate::terminal;
use anyhow::Result;
use clap::{Args, Subcommand};
use eagpt_eval::{ComparedLamp, LampComparison, TrueLamps, compare_lamps};
use eagpt_report::lamps::LampTable;
use eagpt_scene::lamps::{LAMPS_FILE, read_lamps};
use eagpt_scene::{Lamps, files};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// File of a virtual capture that tells of its lamps.
const TRUTH_FILE: &str = "synth.json";

/// List the lamps that training has found, and measure them against the truth
///
/// Prints place and size (scene units), radiance, power (radiance × scene units² × sr, R G B), the
/// number of views and pixels that show each lamp, the deviation of its power between views, and
/// the factor by which the solution of all powers has corrected its radiance.
///
/// With --reference, found lamps are matched to those of a virtual room by their place: which were
/// found, which are none, and the ratio of found to true power. The scene has to be trained on the
/// truth of that room, or in its world.
#[derive(Debug, Clone, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_long_help = EXAMPLES
)]
pub(crate) struct LampsArgs {
    #[command(subcommand)]
    command: Option<LampsCommand>,
    /// lamps.json, or the folder of a training with that file
    #[arg(value_name = "LAMPS", required = true)]
    lamps: Option<PathBuf>,
    /// True lamps: synth.json, or the folder of a capture of `eagpt synth`
    #[arg(long, value_name = "SYNTH.json")]
    reference: Option<PathBuf>,
    /// Condition of the reference that the scene was trained on [default: its first]
    #[arg(long, value_name = "NAME", requires = "reference")]
    condition: Option<String>,
    /// Write lamps and comparison as JSON
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// Replace the file if it is there
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Subcommand)]
enum LampsCommand {
    Fit(Box<fit::FitArgs>),
}

const EXAMPLES: &str = "Examples:
  eagpt lamps runs/kitchen
  eagpt lamps runs/bedroom/lamps.json --reference captures/bedroom --out bedroom-lamps.json
  eagpt lamps fit bakes/room.ply --reference room/evening --before room/day --out evening.toml";

/// The list as it is told and written.
#[derive(Serialize)]
struct Outcome<'a> {
    lamps: &'a [eagpt_scene::Lamp],
    comparison: Option<&'a LampComparison>,
}

pub(crate) fn run(args: &LampsArgs, global: &GlobalArgs) -> Result<ExitCode> {
    if let Some(LampsCommand::Fit(fit)) = &args.command {
        return fit::run(fit, global);
    }
    // Without a command, the argument is required.
    let path = file_in(args.lamps.as_deref().unwrap_or(Path::new("")), LAMPS_FILE);
    let reference = args.reference.as_deref();
    let reference = reference.map(|path| file_in(path, TRUTH_FILE));
    if let Some(out) = &args.out {
        let inputs: Vec<&Path> = [Some(&path), reference.as_ref()]
            .into_iter()
            .flatten()
            .map(PathBuf::as_path)
            .collect();
        output::check_part(out, &inputs, Replace::from_flag(args.force))?;
    }
    let lamps = read_lamps(&path)?;
    let comparison = match &reference {
        Some(path) => {
            let truth = TrueLamps::read(path)?;
            Some(compare_lamps(&lamps, &truth, args.condition.as_deref())?)
        }
        None => None,
    };
    let outcome = Outcome {
        lamps: &lamps.lamps,
        comparison: comparison.as_ref(),
    };
    let reporter = Reporter::new(global);
    if !global.json && !global.quiet {
        terminal::print(&text(&lamps, comparison.as_ref()))?;
    }
    if let Some(out) = &args.out {
        output::create_parent(out)?;
        let json = serde_json::to_string_pretty(&outcome)? + "\n";
        files::write_bytes_atomic(out, json.as_bytes())?;
        reporter.note(&format!("{}: {} lamps", out.display(), lamps.lamps.len()));
    }
    let mut done = serde_json::to_value(&outcome)?;
    done["message"] = "done".into();
    done["path"] = serde_json::to_value(&args.out)?;
    reporter.message(&done)?;
    Ok(ExitCode::SUCCESS)
}

/// The file of this name if `path` is a folder.
fn file_in(path: &Path, name: &str) -> PathBuf {
    if path.is_dir() {
        path.join(name)
    } else {
        path.to_owned()
    }
}

fn text(lamps: &Lamps, comparison: Option<&LampComparison>) -> String {
    let table = LampTable::new(lamps);
    let mut text = match table.rows.len() {
        0 => "no lamps\n".to_owned(),
        _ => columns(&table.headings, &table.rows),
    };
    let Some(found) = comparison else {
        return text;
    };
    text.push('\n');
    let headings = ["true lamp", "found", "power", "of true", "R", "G", "B"];
    let rows: Vec<_> = found.lamps.iter().map(compared).collect();
    text += &columns(&headings, &rows);
    let percent = |value: Option<f64>| {
        value.map_or_else(
            || "--".to_owned(),
            |value| format!("{:.1} %", 100.0 * value),
        )
    };
    let names = match found.false_lamps.len() {
        0 => "none".to_owned(),
        _ => found.false_lamps.join(", "),
    };
    text += &format!(
        "\ncondition {}: {} of {} lamps found ({}); false: {names}\n\
         error of the power: median {}, largest {}; all power {} of the true\n",
        found.condition,
        found.num_found,
        found.lamps.len(),
        percent(found.recall),
        percent(found.median_error),
        percent(found.largest_error),
        percent(found.total_ratio),
    );
    text
}

/// A row of the table of true lamps.
fn compared(lamp: &ComparedLamp) -> [String; 7] {
    let ratio =
        |value: Option<f64>| value.map_or_else(|| "--".to_owned(), |value| format!("{value:.3}"));
    let found = match lamp.found.len() {
        0 => "--".to_owned(),
        _ => lamp.found.join(", "),
    };
    let [r, g, b] = lamp.ratio_rgb.map(ratio);
    let power = lamp.power.map(|value| format!("{value:.3}")).join(" ");
    [lamp.name.clone(), found, power, ratio(lamp.ratio), r, g, b]
}

/// Texts below headings, all but the first aligned to the right.
fn columns<const N: usize>(headings: &[&str; N], rows: &[[String; N]]) -> String {
    let headings = headings.map(str::to_owned).to_vec();
    let rows = rows.iter().map(|row| row.to_vec());
    let lines: Vec<_> = std::iter::once(headings).chain(rows).collect();
    terminal::columns(&lines, 1)
}
