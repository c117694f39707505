//! `eagpt run`: the whole chain from one file.
//!
//! - [`mod@project`]: the file; [`section`]: its parts; [`options`]: the options of each command in
//!   it.
//! - [`plan`]: which commands follow from it, and what each reads and makes.
//! - [`step`]: a command with its options.
//! - [`state`]: digests of inputs and products, so that only what has changed is made again.
//! - [`execute`]: the commands, one after the other.
//! - [`only`]: one of them alone.
//! - [`verify`]: everything again, compared to the bit.

mod execute;
mod init;
mod only;
mod options;
mod plan;
pub(crate) mod project;
mod section;
mod state;
mod step;
mod verify;

pub(crate) use init::{InitArgs, run as init, spp};
pub(crate) use plan::Plan;
pub(crate) use project::{ORIGINAL, Project, ProjectFile};
pub(crate) use section::{Part, Section, part};
pub(crate) use step::PlanStep;

use crate::args::GlobalArgs;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_scene::Shard;
use execute::{Range, Status};
use state::{Folder, SHORT_WAIT};
use std::path::PathBuf;
use std::process::ExitCode;

/// Run the whole chain that a project file describes
///
/// A project is a TOML file with a section for each step, whose keys are the options of the command
/// of that step (`eagpt init` writes one with comments). Steps run only if their options, their
/// inputs or what they take from earlier steps have changed since they last ran; a step that was
/// stopped resumes where it can. All results go into one folder, as the commands write them, with
/// run.json, which says what was made from what.
#[derive(Debug, Args)]
#[command(after_long_help = OUTPUTS_AND_EXAMPLES)]
pub(crate) struct RunArgs {
    /// Project file
    #[arg(value_name = "PROJECT.toml", required_unless_present = "verify")]
    project: Option<PathBuf>,
    /// Folder for all results [default: `out` of the project]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the steps with their commands, what would run and why, time and memory of their
    /// last run, and do nothing
    #[arg(long)]
    dry_run: bool,
    /// Print the steps and do nothing; with --json, what each reads, makes and waits for
    #[arg(long, conflicts_with = "dry_run")]
    list: bool,
    /// Run this step and no other, if it has to be run; what it takes from others has to be there.
    /// Several processes may run steps of one project at once: a workflow engine does, see
    /// workflow/ in the repository
    #[arg(long, value_name = "STEP", conflicts_with_all = ["dry_run", "list", "until", "from"])]
    only: Option<String>,
    /// With --only: part I of N of the step, 1 to N, if it is one of many views (ingest, render,
    /// bake --method views); the step itself, without --shard, then puts the parts together
    #[arg(long, value_name = "I/N", requires = "only")]
    shard: Option<Shard>,
    /// Stop after this step
    #[arg(long, value_name = "STEP")]
    until: Option<String>,
    /// Run this step and everything after it, changed or not
    #[arg(long, value_name = "STEP")]
    from: Option<String>,
    /// Make everything again that a finished run in RUN has made, in a folder of its own, and say
    /// what differs; exit code 1 if anything does
    #[arg(long, value_name = "RUN", conflicts_with_all = ["project", "out", "dry_run", "list", "only", "from"])]
    verify: Option<PathBuf>,
}

const OUTPUTS_AND_EXAMPLES: &str = "Folders in DIR, each as the command of that name writes it:
  ingest/ dataset/ masks/ train/ edit/ bake/ render/CONDITION/MODE/ eval/CONDITION/MODE/ table/
  report.html    everything to look at, one file
  run.json       steps, commands, digests of what was read and made, times
  project.toml   the project as it was run

Examples:
  eagpt init kitchen.toml --dataset kitchen
  eagpt run kitchen.toml --dry-run
  eagpt run kitchen.toml
  eagpt run kitchen.toml --from masks --until train
  eagpt run kitchen.toml --only render/original/path --shard 1/4
  eagpt run --verify runs/kitchen";

pub(crate) fn run(args: &RunArgs, global: &GlobalArgs) -> Result<ExitCode> {
    if let Some(run) = &args.verify {
        return verify::run(run, args.until.as_deref(), global);
    }
    // clap asks for it unless --verify is given.
    let path = args.project.clone().unwrap_or_default();
    let project = Project::read(&path, args.out.as_deref())?;
    let plan = Plan::of(&project)?;
    if args.list {
        return only::list(&plan, global);
    }
    if let Some(step) = &args.only {
        return only::run(&project, &plan, step, args.shard, global);
    }
    let range = Range::new(&plan, args.from.as_deref(), args.until.as_deref())?;
    if args.dry_run {
        let mut folder = Folder::look_at(&project.out)?;
        return execute::dry_run(&plan, &mut folder, &range, global);
    }
    run_steps(&project, &plan, &range, global)
}

/// Runs a project to its end, or to the end of a step.
///
/// # Errors
/// As `eagpt run`.
pub(crate) fn run_project(
    project: &Project,
    until: Option<&str>,
    global: &GlobalArgs,
) -> Result<ExitCode> {
    let plan = Plan::of(project)?;
    let range = Range::new(&plan, None, until)?;
    run_steps(project, &plan, &range, global)
}

/// Runs one step of a project, if it has to be run.
///
/// # Errors
/// As `eagpt run --only`.
pub(crate) fn run_step(project: &Project, step: &str, global: &GlobalArgs) -> Result<ExitCode> {
    only::run(project, &Plan::of(project)?, step, None, global)
}

fn run_steps(
    project: &Project,
    plan: &Plan,
    range: &Range,
    global: &GlobalArgs,
) -> Result<ExitCode> {
    let mut folder = Folder::open(&project.out, SHORT_WAIT)?;
    folder.keep_project(project)?;
    match execute::run(plan, &mut folder, range, global)? {
        Status::Done => Ok(ExitCode::SUCCESS),
        Status::Interrupted => {
            if !global.quiet {
                terminal::line("stopped: the same command resumes");
            }
            Ok(crate::interrupt::exit_code())
        }
    }
}

#[cfg(test)]
mod tests;
