//! `eagpt eval DIR… --reference DATASET…`: renderings of one condition or of several.

use super::{COLUMN_WIDTH, EvalArgs, table};
use crate::args::GlobalArgs;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder, SplitRecord};
use crate::terminal;
use anyhow::{Result, bail};
use eagpt_eval::{
    Conditions, ConditionsOptions, EvalOptions, EvalProgress, Evaluation, METRICS_FILE, Mean,
    RESULT_FILES, Selection, evaluate,
};
use eagpt_scene::Dataset;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The files of a job.
#[derive(Default)]
struct Files {
    /// Everything that will be written, relative to the output folder.
    outputs: Vec<PathBuf>,
    /// Files that an evaluation must never replace.
    inputs: Vec<PathBuf>,
}

pub(super) fn run(args: &EvalArgs, global: &GlobalArgs) -> Result<ExitCode> {
    // clap asks for it unless a subcommand is given.
    let out = args.out.clone().unwrap_or_default();
    let job = options(args, &out)?;
    let mut builder = match job.conditions.as_slice() {
        [alone] => RecordBuilder::begin("eval", alone, global)?,
        _ => RecordBuilder::begin("eval", &job, global)?,
    };
    let files = files(&job, &out, &mut builder)?;
    let target = Target::new(&out, "eval", &files.inputs, args.force);
    target.check(&files.outputs)?;
    let mut reporter = Reporter::new(global);
    let tell = |reporter: &mut Reporter, message: &_| tell(reporter, message, &target);
    let found = reporter.follow(tell, |progress| evaluate(&job, progress))?;
    let warnings = warnings(&found);
    let record = &mut builder.record;
    record.device = Some("cpu".to_owned());
    record.warnings.clone_from(&warnings);
    builder.wrote(&files.outputs);
    builder.write(&out)?;
    for warning in &warnings {
        reporter.warning(warning);
    }
    finish(&reporter, &out, &found, global)?;
    Ok(ExitCode::SUCCESS)
}

/// The conditions that the arguments name.
fn options(args: &EvalArgs, out: &Path) -> Result<ConditionsOptions> {
    let num = args.reference.len();
    if args.renders.len() != num {
        bail!(
            "--reference: given {num} times for {} folders of renderings: each folder needs its own",
            args.renders.len()
        );
    }
    if !args.name.is_empty() && args.name.len() != num {
        bail!(
            "--name: given {} times for {num} conditions",
            args.name.len()
        );
    }
    let before = of_each("--before", &args.before, num)?;
    let subset = of_each("--split", &args.split, num)?;
    let split = of_each("--split-rule", &args.split_rule, num)?;
    let mut conditions = Vec::with_capacity(num);
    for (i, (renders, dataset)) in args.renders.iter().zip(&args.reference).enumerate() {
        conditions.push(EvalOptions {
            before: before.get(i).cloned(),
            name: args.name.get(i).cloned(),
            split: split.get(i).copied(),
            subset: subset.get(i).copied(),
            flip: args.flip.options()?,
            ..EvalOptions::new(renders, dataset, out)
        });
    }
    Ok(ConditionsOptions::new(conditions, out)?)
}

/// Warnings of all conditions, of several with their names.
fn warnings(found: &Conditions) -> Vec<String> {
    if let [alone] = found.conditions.as_slice() {
        return alone.warnings.clone();
    }
    let conditions = found.conditions.iter();
    let warnings = conditions.flat_map(|condition| {
        let texts = condition.warnings.iter();
        texts.map(|text| format!("{}: {text}", condition.name))
    });
    warnings.collect()
}

/// A value for each of `num` conditions from one for all or one for each; none if none is given.
fn of_each<T: Clone>(flag: &str, values: &[T], num: usize) -> Result<Vec<T>> {
    match values {
        [one] => Ok(vec![one.clone(); num]),
        _ if values.is_empty() || values.len() == num => Ok(values.to_vec()),
        _ => bail!(
            "{flag}: given {} times for {num} conditions: once for all, or once for each",
            values.len()
        ),
    }
}

/// Finds the files of all conditions, and puts the datasets into the record.
fn files(job: &ConditionsOptions, out: &Path, builder: &mut RecordBuilder) -> Result<Files> {
    let mut files = Files::default();
    let is_alone = job.conditions.len() == 1;
    if !is_alone {
        files.outputs.extend(result_files());
    }
    for condition in &job.conditions {
        for folder in [out, &condition.out] {
            if same_folder(folder, &condition.renders) {
                bail!(
                    "{}: --out is the folder of the renderings",
                    folder.display()
                );
            }
        }
        let selection = Selection::new(condition)?;
        let dataset = selection.dataset();
        builder.record.inputs.push(Input::of_cameras(dataset)?);
        if is_alone {
            builder.record.split = Some(SplitRecord {
                rule: selection.split.as_ref().map(|split| split.rule),
                num_train: selection.split.as_ref().map(|split| split.train.len()),
                num_test: selection.split.as_ref().map(|split| split.test.len()),
                subset: selection.subset,
                num_views: selection.frames().count(),
            });
        }
        let maps = selection
            .frames()
            .map(|frame| Path::new("flip").join(format!("{}.png", frame.name)));
        // Relative to the output folder: its own name, or nothing.
        let folder = condition.out.strip_prefix(out).unwrap_or(Path::new(""));
        let outputs = result_files().chain(maps);
        files.outputs.extend(outputs.map(|file| folder.join(file)));
        let renders = dataset.frames().iter();
        let renders = renders.map(|frame| condition.renders.join(format!("{}.exr", frame.name)));
        files.inputs.extend(dataset.files());
        files.inputs.extend(renders);
        if let Some(before) = &condition.before {
            let before = Dataset::open(before)?;
            builder.record.inputs.push(Input::of_cameras(&before)?);
            files.inputs.extend(before.files());
        }
    }
    Ok(files)
}

fn result_files() -> impl Iterator<Item = PathBuf> {
    RESULT_FILES.into_iter().map(PathBuf::from)
}

fn same_folder(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

fn tell(reporter: &mut Reporter, message: &EvalProgress, target: &Target<'_>) -> Result<()> {
    match message {
        // The inputs have been checked: from here on an earlier result may go.
        EvalProgress::Started { total } => {
            target.prepare()?;
            reporter.begin("comparing", "views", 0, *total as u64);
        }
        EvalProgress::View { name, done, .. } => {
            reporter.advance(*done as u64, || name.clone());
        }
        // Shown at the end, where they are not lost above a table.
        EvalProgress::Warning { .. } => {}
    }
    reporter.message(message)
}

/// The means, as the last thing on the screen.
fn finish(reporter: &Reporter, out: &Path, found: &Conditions, global: &GlobalArgs) -> Result<()> {
    let path = out.join(METRICS_FILE);
    let keyed = |means: &[Mean]| -> Map<String, Value> {
        let means = means.iter();
        means
            .map(|mean| (mean.metric.key.to_owned(), mean.value.into()))
            .collect()
    };
    let mut done = json!({ "message": "done", "path": path, "mean": keyed(&found.means) });
    let several = Some(&found.conditions).filter(|conditions| conditions.len() > 1);
    if let Some(several) = several {
        let conditions = several.iter();
        let conditions = conditions.map(|c| json!({ "name": c.name, "mean": keyed(&c.means) }));
        done["conditions"] = conditions.collect();
    }
    reporter.message(&done)?;
    if global.json || global.quiet {
        return Ok(());
    }
    let mut names: Vec<&str> = Vec::new();
    if let Some(several) = several {
        names.extend(several.iter().map(|c| c.name.as_str()));
        names.push("mean");
    }
    let widths = names.iter().map(|name| name.chars().count());
    let width = widths.max().unwrap_or_default().max(COLUMN_WIDTH);
    if !names.is_empty() {
        let heading: String = names
            .iter()
            .map(|name| format!(" {name:>width$}"))
            .collect();
        terminal::print(&format!("{:<22}{heading}\n", ""))?;
    }
    let rows = found.means.iter().map(|mean| {
        let mut values = Vec::new();
        if let Some(several) = several {
            let of_each = several.iter();
            values.extend(of_each.map(|condition| condition.mean(mean.metric.key)));
        }
        values.push(Some(mean.value));
        (mean.metric.key, values)
    });
    terminal::print(&table(rows, width))?;
    let sum = |of: fn(&Evaluation) -> usize| found.conditions.iter().map(of).sum::<usize>();
    reporter.note(&format!(
        "{}: {} views of {} rendered",
        path.display(),
        sum(|condition| condition.views.len()),
        sum(|condition| condition.num_rendered)
    ));
    Ok(())
}
