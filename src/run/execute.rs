//! The steps of a run, one after the other.

use super::plan::Plan;
use super::state::Folder;
use super::step::{PlanStep, Restart, set_force};
use crate::args::GlobalArgs;
use crate::command::JobCommand;
use crate::output;
use crate::progress::{Reporter, duration};
use crate::record;
use crate::terminal;
use anyhow::{Context, Result, bail};
use eagpt_report::run::StepRecord;
use eagpt_scene::files;
use serde::Serialize;
use serde_json::{Value, json};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Status {
    Done,
    /// Ctrl-C.
    Interrupted,
}

/// Which steps may run.
#[derive(Debug)]
pub(super) struct Range {
    /// From here on steps run whether anything has changed or not.
    from: Option<usize>,
    /// The last step.
    until: usize,
}

impl Range {
    /// The steps between two names.
    ///
    /// # Errors
    /// If there is no such step, or the last comes before the first.
    pub(super) fn new(plan: &Plan, from: Option<&str>, until: Option<&str>) -> Result<Self> {
        let last = plan.steps.len() - 1;
        let from_index = from.map(|name| plan.find(name)).transpose()?;
        let until_index = until.map(|name| plan.find_last(name)).transpose()?;
        let range = Self {
            from: from_index,
            until: until_index.unwrap_or(last),
        };
        if range.from.is_some_and(|from| from > range.until) {
            bail!(
                "--from {}: comes after --until {}",
                from.unwrap_or_default(),
                until.unwrap_or_default()
            );
        }
        Ok(range)
    }

    fn is_forced(&self, index: usize) -> bool {
        self.from.is_some_and(|from| index >= from)
    }
}

/// Why a step runs or does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Reason {
    /// It has been done and nothing has changed.
    UpToDate,
    /// It has not been done.
    New,
    /// It was begun and stopped.
    Unfinished,
    /// Its options or what it reads have changed.
    Changed,
    /// Its products have changed or are gone.
    Damaged,
    /// `--from` says so.
    Asked,
    /// A step before it will run, and may change what this one takes.
    Depends,
}

impl Reason {
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::UpToDate => "up to date",
            Self::New => "new",
            Self::Unfinished => "goes on",
            Self::Changed => "changed",
            Self::Damaged => "results were changed",
            Self::Asked => "asked for",
            Self::Depends => "depends on a step before",
        }
    }
}

pub(super) fn reason(step: &PlanStep, folder: &mut Folder, key: &str, forced: bool) -> Reason {
    let Some(record) = folder.record.steps.get(&step.name).cloned() else {
        return Reason::New;
    };
    if forced {
        Reason::Asked
    } else if record.key != key {
        Reason::Changed
    } else if !record.done {
        Reason::Unfinished
    } else if !folder.is_intact(step, &record) {
        Reason::Damaged
    } else {
        Reason::UpToDate
    }
}

/// Runs what has to run.
///
/// # Errors
/// The error of a command, with the name of its step.
pub(super) fn run(
    plan: &Plan,
    folder: &mut Folder,
    range: &Range,
    global: &GlobalArgs,
) -> Result<Status> {
    let stop = crate::interrupt::stop_flag()?;
    let reporter = Reporter::new(global);
    let total = range.until + 1;
    for (index, step) in plan.steps.iter().take(total).enumerate() {
        let key = folder.key(plan, step)?;
        let reason = reason(step, folder, &key, range.is_forced(index));
        reporter.note(&format!(
            "[{}/{total}] {}: {}",
            index + 1,
            step.name,
            reason.text()
        ));
        reporter.message(&message(step, index, total, reason)?)?;
        if reason == Reason::UpToDate {
            continue;
        }
        let context = || format!("step {}", step.name);
        let begun = begin(step, index, folder, (key, reason)).with_context(context)?;
        let (code, seconds) = dispatch(&begun.command, global).with_context(context)?;
        if code == ExitCode::SUCCESS {
            finish(step, folder, begun, seconds).with_context(context)?;
        }
        if stop.load(Ordering::Relaxed) || code == crate::interrupt::exit_code() {
            return Ok(Status::Interrupted);
        }
        if code != ExitCode::SUCCESS {
            bail!("step {}: did not come to its end", step.name);
        }
    }
    Ok(Status::Done)
}

/// A step under way.
pub(super) struct Begun {
    record: StepRecord,
    /// The command that it takes, given what an earlier process has left.
    pub(super) command: JobCommand,
}

/// Notes that a step begins, and removes an earlier result that its command does not continue.
pub(super) fn begin(
    step: &PlanStep,
    index: usize,
    folder: &mut Folder,
    (key, reason): (String, Reason),
) -> Result<Begun> {
    let mut command = step.command.clone();
    let is_unfinished = reason == Reason::Unfinished;
    let out = step.products.first().and_then(|product| product.parent());
    match (step.restart(), &mut command) {
        _ if !folder.record.steps.contains_key(&step.name) => {}
        (Restart::Itself, _) if is_unfinished => {}
        (Restart::Resume(left), JobCommand::Train(args))
            if is_unfinished && out.is_some_and(|out| out.join(left).exists()) =>
        {
            args.resume = true;
        }
        // Before the note: a process that is killed between the two finds its step as it was.
        (Restart::Itself, _) => step.clear()?,
        _ => {
            remove_files(step)?;
            set_force(&mut command);
        }
    }
    let record = StepRecord {
        index,
        command: command.words()?,
        key,
        ..StepRecord::default()
    };
    folder
        .record
        .steps
        .insert(step.name.clone(), record.clone());
    folder.save()?;
    Ok(Begun { record, command })
}

/// Runs a command and returns the seconds it took. The peak of memory is its own afterwards.
pub(super) fn dispatch(command: &JobCommand, global: &GlobalArgs) -> Result<(ExitCode, f64)> {
    record::forget_peak_memory();
    let started = Instant::now();
    let global = GlobalArgs {
        command_line: command.words()?,
        ..global.clone()
    };
    let code = command.run(&global)?;
    Ok((code, started.elapsed().as_secs_f64()))
}

/// Notes what a step has made.
pub(super) fn finish(
    step: &PlanStep,
    folder: &mut Folder,
    begun: Begun,
    seconds: f64,
) -> Result<()> {
    for product in &step.products {
        files::remove_temporaries([product])?;
    }
    let products = folder.products(step)?;
    let done = StepRecord {
        done: true,
        products,
        seconds,
        peak_memory_mib: record::peak_memory_mib(),
        ..begun.record
    };
    folder.record.steps.insert(step.name.clone(), done);
    folder.save()
}

/// Removes products that are single files: one without its record, as of a step that was killed, is
/// nobody's to a command.
fn remove_files(step: &PlanStep) -> Result<()> {
    for product in step.products.iter().filter(|product| product.is_file()) {
        files::remove_if_there(product)?;
        files::remove_if_there(&output::record_path(product))?;
    }
    Ok(())
}

/// A step in JSON messages.
fn message(step: &PlanStep, index: usize, total: usize, reason: Reason) -> Result<Value> {
    Ok(json!({
        "message": "run-step",
        "step": step.name,
        "index": index + 1,
        "total": total,
        "reason": reason,
        "command": step.shown()?,
    }))
}

/// Prints what would run.
///
/// # Errors
/// If what the steps read is not there, or standard output cannot be written.
pub(super) fn dry_run(
    plan: &Plan,
    folder: &mut Folder,
    range: &Range,
    global: &GlobalArgs,
) -> Result<ExitCode> {
    let reporter = Reporter::new(global);
    let mut runs = vec![false; plan.steps.len()];
    let (mut text, mut seconds, mut num_unknown) = (String::new(), 0.0, 0);
    let total = range.until + 1;
    for (index, step) in plan.steps.iter().take(total).enumerate() {
        let key = folder.key(plan, step)?;
        let mut why = reason(step, folder, &key, range.is_forced(index));
        if why == Reason::UpToDate && step.after.iter().any(|&earlier| runs[earlier]) {
            why = Reason::Depends;
        }
        runs[index] = why != Reason::UpToDate;
        reporter.message(&message(step, index, total, why)?)?;
        let mut cost = String::new();
        let known = folder.record.steps.get(&step.name);
        if let Some(record) = known.filter(|record| record.seconds > 0.0) {
            cost = format!(", {} last time", duration(record.seconds));
            if let Some(mib) = record.peak_memory_mib {
                cost += &format!(" and {mib:.0} MiB");
            }
            seconds += if runs[index] { record.seconds } else { 0.0 };
        } else if runs[index] {
            num_unknown += 1;
        }
        text += &format!(
            "[{}/{total}] {}: {}{cost}\n    {}\n",
            index + 1,
            step.name,
            why.text(),
            step.shown()?
        );
    }
    let num = runs.iter().filter(|&&runs| runs).count();
    text += &format!("{num} of {total} steps would run");
    if num > num_unknown {
        text += &format!(": {} by what they took last time", duration(seconds));
    }
    if num_unknown > 0 {
        text += &format!("; {num_unknown} of them never ran");
    }
    text.push('\n');
    if !global.json {
        terminal::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}
