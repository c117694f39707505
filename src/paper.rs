//! `eagpt paper`: the tables of the paper, for any dataset.
//!
//! Everything is a project of `eagpt run`: one for each scene that is trained, one for each row
//! that renders it. What has to run again, and where a run goes on, is decided there.
//!
//! - [`rows`]: what each row changes.
//! - [`published`]: the numbers of the paper.
//! - [`projects`]: the projects of all rows.

mod projects;
mod published;
mod rows;

use crate::args::GlobalArgs;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{FILE_NAME, RecordBuilder};
use crate::run::{self, Plan, PlanStep, Project};
use crate::{interrupt, terminal};
use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use eagpt_eval::tabulate::FILES;
use eagpt_eval::tabulate::repeats::{RepeatOptions, tabulate_repeats};
use eagpt_scene::Shard;
use eagpt_scene::files::{self, Key, Ledger, ledger};
use eagpt_train::Preset;
use projects::{Base, Group, RowProject};
use rows::{ROWS, Row};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Make the tables of the paper for datasets of your own
///
/// A row is a way of rendering (0-bounce, 1-bounce, path, baked), measured in the light of the
/// photographs and in every other light that the dataset brings; or an ablation: path tracing of a
/// scene trained without normal maps, without agreement of normals and depths, with inaccurate
/// masks, with fewer Gaussians; with 3, 7, 11 bounces; with 256, 1,024, 4,096 samples a pixel. Rows
/// of one scene share its training. With several seeds a number is their mean ± standard deviation.
/// Published numbers stand beside those of a dataset that is called like one of the paper's scenes.
///
/// Everything is a project of `eagpt run`, in a folder of its own: the same command resumes,
/// and makes only what is new.
#[derive(Debug, Args)]
#[command(after_long_help = OUTPUTS_AND_EXAMPLES)]
pub(crate) struct PaperArgs {
    /// Datasets: folders, or project files of `eagpt run`, whose `[[relight]]` are the other
    /// lights that are measured. NAME= before one gives it a name [default: that of the folder or
    /// file]; b-kitchen, b-livingroom, f-classroom and f-conference are the paper's
    #[arg(value_name = "[NAME=]DATASET", required = true, value_parser = named)]
    datasets: Vec<Named>,
    /// Project file whose sections the DATASETs that are folders take; its own dataset does not
    /// count
    #[arg(long, value_name = "PROJECT.toml")]
    config: Option<PathBuf>,
    /// Options of DATASETs that are folders, where --config says nothing
    #[arg(long, value_enum, default_value = "fast")]
    preset: Preset,
    /// Rows, separated by commas [default: all]
    #[arg(long, value_name = "ROW,…", value_delimiter = ',', value_parser = row())]
    rows: Vec<&'static Row>,
    /// Seeds, separated by commas, each 0 to 2^32 − 1; every row is made with each
    #[arg(long, value_name = "S,…", value_delimiter = ',', default_value = "0")]
    seeds: Vec<u32>,
    /// Metrics of each light, separated by commas: keys of `mean` in metrics.json
    #[arg(long, value_name = "KEY,…", value_delimiter = ',', default_values = ["psnr_srgb_db", "flip_hdr"])]
    metrics: Vec<String>,
    /// Folder for everything; created
    #[arg(long, value_name = "DIR", default_value = "paper")]
    out: PathBuf,
    /// Make only part I of N of the scenes, each with its rows, 1 to N. Parts share DIR and may run
    /// at once, on machines that share it; when all are there, the same command without --shard
    /// writes the tables
    #[arg(long, value_name = "I/N", conflicts_with = "force")]
    shard: Option<Shard>,
    /// Print what would be made, which commands that takes, and do nothing
    #[arg(long)]
    dry_run: bool,
    /// Make everything here, whatever parts of it others have begun
    #[arg(long)]
    force: bool,
}

const OUTPUTS_AND_EXAMPLES: &str = "Rows: 0-bounce, 1-bounce, path, baked; no-normal-supervision, no-normal-consistency, inaccurate-masks, fewer-gaussians,
bounces-3, bounces-7, bounces-11, spp-256, spp-1024, spp-4096.

Files in DIR:
  NAME/table/               table.md, table.tex, table.csv, table.json
  NAME/scenes/SCENE/seed-S/ a training, with its project seed-S.toml beside it
  NAME/rows/ROW/seed-S/     renderings, metrics and report of a row, likewise
  record.json               version, options, times

Examples:
  eagpt paper b-kitchen=kitchen.toml --preset paper --seeds 0,1,2
  eagpt paper kitchen --rows 0-bounce,path,bounces-3 --dry-run
  eagpt paper a.toml b.toml --shard 1/8      (and 2/8 … elsewhere, then without --shard)";

/// A dataset and its name.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Named {
    name: String,
    path: PathBuf,
}

fn named(text: &str) -> Result<Named, String> {
    let (name, path) = match text.split_once('=') {
        // A folder may have the sign in its own name.
        Some((name, path)) if !Path::new(text).exists() => (name.to_owned(), path),
        _ => {
            let stem = Path::new(text).file_stem().unwrap_or_default();
            (stem.to_string_lossy().into_owned(), text)
        }
    };
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if name.is_empty() || !name.chars().all(is_plain) {
        return Err(format!(
            "`{name}` is no name of letters, digits, - and _; NAME={path} gives one"
        ));
    }
    Ok(Named {
        name,
        path: path.into(),
    })
}

fn row() -> impl TypedValueParser<Value = &'static Row> {
    let find = |name: String| {
        let found = ROWS.iter().find(|row| row.name == name);
        found.ok_or_else(|| format!("`{name}` is no row"))
    };
    PossibleValuesParser::new(ROWS.iter().map(|row| row.name)).try_map(find)
}

pub(crate) fn run(args: &PaperArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let chosen =
        |row: &&Row| args.rows.is_empty() || args.rows.iter().any(|of| of.name == row.name);
    let rows: Vec<&Row> = ROWS.iter().filter(chosen).collect();
    let nothing = RepeatOptions {
        cells: Vec::new(),
        metrics: args.metrics.clone(),
    };
    tabulate_repeats(&nothing, Vec::new()).context("--metrics")?;
    let bases = bases(args)?;
    let mut groups = Vec::new();
    for base in &bases {
        for seed in &args.seeds {
            groups.extend(base.groups(&rows, *seed)?);
        }
    }
    // Errors of a project are reported before the others have run for days.
    for row in groups.iter().flat_map(Group::projects) {
        Plan::of(&row.project)?;
    }
    if args.dry_run {
        return dry_run(&groups, global);
    }
    Target::new(&args.out, "paper", &[], true).check(&[])?;
    files::create_dir(&args.out)?;
    if args.force {
        ledger::clear(&args.out, "paper")?;
    }
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    // The projects know what decides the result; a part only has to exist.
    let key = Key::new().with_value("version", &env!("CARGO_PKG_VERSION"))?;
    let mut ledger = Ledger::open(&args.out, "paper", &key, shard, ledger::ADVICE)?;
    ledger.check_shards()?;
    let mut builder = RecordBuilder::begin("paper", &recorded(args, &rows), global)?;
    let reporter = Reporter::new(global);
    if !make(&groups, shard, (&mut ledger, &mut builder), global)? {
        return Ok(interrupt::exit_code());
    }
    if shard != Shard::WHOLE {
        ledger.complete()?;
        reporter.note(&format!("{}: part {shard}", args.out.display()));
        return Ok(ExitCode::SUCCESS);
    }
    for base in &bases {
        let options = RepeatOptions {
            cells: base.cells(&rows, &args.seeds),
            metrics: args.metrics.clone(),
        };
        let table = tabulate_repeats(&options, base.notes(&rows, &args.seeds))?;
        let out = base.out.join("table");
        table.write(&out)?;
        let relative = out.strip_prefix(&args.out).unwrap_or(&out);
        builder.wrote(FILES.map(|file| relative.join(file)));
        reporter.message(&serde_json::json!({
            "message": "table",
            "dataset": base.name,
            "path": out.join("table.json"),
        }))?;
        if !global.json && !global.quiet {
            terminal::print(&format!("{}\n\n{}\n", base.name, table.markdown()))?;
        }
    }
    builder.write(&args.out)?;
    ledger.close()?;
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out.join(FILE_NAME),
    }))?;
    Ok(ExitCode::SUCCESS)
}

/// The datasets as projects.
fn bases(args: &PaperArgs) -> Result<Vec<Base>> {
    let mut bases: Vec<Base> = Vec::new();
    for Named { name, path } in &args.datasets {
        if bases.iter().any(|base| base.name == *name) {
            bail!("two datasets are called `{name}`: NAME=DATASET names one");
        }
        let is_project = path.extension().is_some_and(|end| end == "toml");
        let project = if is_project {
            Project::absolute(path)?
        } else {
            let config = args.config.as_deref().map(Project::absolute).transpose()?;
            projects::of_folder(path, config, (args.preset.name(), run::spp(args.preset)))?
        };
        let out = std::path::absolute(args.out.join(name))
            .with_context(|| format!("{}", args.out.display()))?;
        bases.push(Base::new(name, path, project, &out)?);
    }
    Ok(bases)
}

fn recorded(args: &PaperArgs, rows: &[&Row]) -> serde_json::Value {
    let datasets = args.datasets.iter();
    let datasets: serde_json::Map<_, _> = datasets
        .map(|of| (of.name.clone(), of.path.display().to_string().into()))
        .collect();
    let rows: Vec<&str> = rows.iter().map(|row| row.name).collect();
    serde_json::json!({
        "datasets": datasets,
        "config": args.config,
        "preset": args.preset.name(),
        "rows": rows,
        "seeds": args.seeds,
        "metrics": args.metrics,
    })
}

/// Runs the projects of a shard; `false` if it was stopped. One that fails does not keep the others
/// from running.
fn make(
    groups: &[Group],
    shard: Shard,
    (ledger, builder): (&mut Ledger, &mut RecordBuilder),
    global: &GlobalArgs,
) -> Result<bool> {
    let reporter = Reporter::new(global);
    let mine = groups.iter().enumerate();
    let mine: Vec<&Group> = mine
        .filter(|(place, _)| shard.has(*place))
        .map(|(_, group)| group)
        .collect();
    let total = mine
        .iter()
        .map(|group| group.projects().count())
        .sum::<usize>();
    let (mut done, mut failed) = (0, Vec::new());
    for group in mine {
        let started = Instant::now();
        for row in group.projects() {
            done += 1;
            reporter.note(&format!("({done}/{total}) {}", row.name));
            reporter.message(&serde_json::json!({
                "message": "paper-row",
                "row": row.name,
                "index": done,
                "total": total,
            }))?;
            match work(row, global) {
                Ok(code) if code == ExitCode::SUCCESS => {}
                Ok(_) => return Ok(false),
                Err(error) => {
                    reporter.warning(&format!("{}: {}", row.name, terminal::one_line(&error)));
                    failed.push(row.name.as_str());
                    // Its rows have no scene.
                    if row.until.is_some() {
                        break;
                    }
                }
            }
        }
        let seconds = started.elapsed().as_secs_f64();
        builder.took(&group.scene.name, seconds);
        ledger.add(&group.scene.name, seconds, &[])?;
    }
    if !failed.is_empty() {
        bail!(
            "no tables without {}: the same command tries again",
            failed.join(", ")
        );
    }
    Ok(true)
}

fn work(row: &RowProject, global: &GlobalArgs) -> Result<ExitCode> {
    let project = &row.project;
    crate::output::create_parent(project.path())?;
    files::write_bytes_atomic(project.path(), project.text().as_bytes())?;
    run::run_project(project, row.until, global)
}

fn dry_run(groups: &[Group], global: &GlobalArgs) -> Result<ExitCode> {
    let reporter = Reporter::new(global);
    let mut text = String::new();
    let (mut num_projects, mut num_done) = (0, 0);
    for row in groups.iter().flat_map(Group::projects) {
        let is_done = row.is_done()?;
        num_projects += 1;
        num_done += usize::from(is_done);
        let state = if is_done { "done" } else { "to do" };
        text += &format!("{}: {state}\n", row.name);
        let steps = Plan::of(&row.project)?.steps;
        let last = steps
            .iter()
            .position(|step| Some(step.name.as_str()) == row.until);
        let steps = steps.iter().take(last.map_or(steps.len(), |last| last + 1));
        let commands: Vec<String> = steps.map(PlanStep::shown).collect::<Result<_>>()?;
        for command in &commands {
            text += &format!("    {command}\n");
        }
        reporter.message(&serde_json::json!({
            "message": "paper-row",
            "row": row.name,
            "project": row.project.path(),
            "done": is_done,
            "commands": commands,
        }))?;
    }
    text += &format!(
        "{} scenes to train, {} projects in all, {num_done} of them done\n",
        groups.len(),
        num_projects
    );
    if !global.json {
        terminal::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}
