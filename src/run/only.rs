//! One step of a project by itself, for programs that drive a project across machines.
//!
//! A step looks at `run.json` and notes what it has made as a whole run does, but holds the lock on
//! the run only for that: steps that need nothing of each other, and parts of a step, run at once.

use super::execute::{self, Reason};
use super::plan::Plan;
use super::project::Project;
use super::state::{Folder, LONG_WAIT};
use super::step::{PlanStep, set_shard};
use crate::args::GlobalArgs;
use crate::progress::Reporter;
use crate::terminal;
use anyhow::{Context, Result, bail};
use eagpt_scene::Shard;
use std::process::ExitCode;

/// Runs one step, or a part of it, if it has to be run.
///
/// # Errors
/// If a step that it takes something from is not done, if it has no parts, or as its command.
pub(super) fn run(
    project: &Project,
    plan: &Plan,
    name: &str,
    shard: Option<Shard>,
    global: &GlobalArgs,
) -> Result<ExitCode> {
    let Some(index) = plan.steps.iter().position(|step| step.name == name) else {
        bail!("--only {name}: no step; there are {}", plan.names());
    };
    let step = &plan.steps[index];
    if let Some(shard) = shard.filter(|_| !step.divides()) {
        bail!("--shard {shard}: step {name} has no parts");
    }
    // Digests take their time, which need not be that of others.
    let mut ahead = Folder::look_at(&plan.out)?;
    check_earlier(plan, step, &ahead)?;
    ahead.key(plan, step)?;
    let mut folder = Folder::open(&plan.out, LONG_WAIT)?;
    folder.learn(ahead);
    folder.keep_project(project)?;
    let key = folder.key(plan, step)?;
    let reason = execute::reason(step, &mut folder, &key, false);
    let reporter = Reporter::new(global);
    reporter.note(&format!("{name}: {}", reason.text()));
    if reason == Reason::UpToDate {
        return Ok(ExitCode::SUCCESS);
    }
    let begun = execute::begin(step, index, &mut folder, (key, reason))?;
    drop(folder);

    let mut command = begun.command.clone();
    set_shard(&mut command, shard);
    let (code, seconds) =
        execute::dispatch(&command, global).with_context(|| format!("step {}", step.name))?;
    if code != ExitCode::SUCCESS || shard.is_some() {
        return Ok(code);
    }
    let mut ahead = Folder::look_at(&plan.out)?;
    ahead.products(step)?;
    let mut folder = Folder::open(&plan.out, LONG_WAIT)?;
    folder.learn(ahead);
    execute::finish(step, &mut folder, begun, seconds)?;
    Ok(ExitCode::SUCCESS)
}

fn check_earlier(plan: &Plan, step: &PlanStep, folder: &Folder) -> Result<()> {
    let earlier = step
        .after
        .iter()
        .map(|&index| plan.steps[index].name.as_str());
    let is_done = |name: &&str| folder.record.steps.get(*name).is_some_and(|step| step.done);
    let missing: Vec<&str> = earlier.filter(|name| !is_done(name)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    bail!(
        "{}: step {} needs {}: not done",
        plan.out.display(),
        step.name,
        missing.join(", ")
    );
}

/// Prints the steps without a look at any file; in JSON the command without the name of the
/// program, the steps whose products it takes, what it reads outside of the run and what it makes,
/// whether `--shard` divides it, and the folder of the run.
///
/// # Errors
/// If standard output cannot be written.
pub(super) fn list(plan: &Plan, global: &GlobalArgs) -> Result<ExitCode> {
    let reporter = Reporter::new(global);
    let mut text = String::new();
    for step in &plan.steps {
        let after = step
            .after
            .iter()
            .map(|&index| plan.steps[index].name.as_str());
        reporter.message(&serde_json::json!({
            "message": "step",
            "step": step.name,
            "arguments": step.words()?,
            "after": after.collect::<Vec<_>>(),
            "reads": step.reads,
            "products": step.products,
            "divides": step.divides(),
            "out": plan.out,
        }))?;
        text += &format!("{}\n    {}\n", step.name, step.shown()?);
    }
    if !global.json {
        terminal::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}
