//! A finished run made again, and compared.

use super::execute::{self, Range, Status};
use super::plan::Plan;
use super::project::Project;
use super::state::{Folder, SHORT_WAIT};
use crate::args::GlobalArgs;
use crate::progress::Reporter;
use crate::terminal;
use anyhow::{Context, Result, bail};
use eagpt_eval::METRICS_FILE;
use eagpt_report::run::PROJECT_FILE;
use eagpt_scene::files;
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A product, then and now.
#[derive(Debug, Serialize)]
struct Compared {
    message: &'static str,
    step: String,
    product: PathBuf,
    same: bool,
    /// Digest in the run.
    was: String,
    /// Digest of what was made again; null if it was not made.
    is: Option<String>,
}

/// Makes everything again that the run in `dir` has finished, in a folder beside it, and compares
/// digests. The folder goes if all is the same.
///
/// Metrics tell how long a frame took and where its scene lies: they are compared without. Table
/// and report are made of what is compared.
pub(super) fn run(dir: &Path, until: Option<&str>, global: &GlobalArgs) -> Result<ExitCode> {
    let then = Folder::look_at(dir)?;
    if then.record.steps.is_empty() {
        bail!(
            "{}: no run of this program, or one that has not begun",
            dir.display()
        );
    }
    let again = beside(dir);
    let bytes = files::read(&dir.join(PROJECT_FILE))?;
    let project = Project::parse(&then.record.project, bytes, Some(&again))
        .with_context(|| format!("{}", dir.join(PROJECT_FILE).display()))?;
    let plan = Plan::of(&project)?;
    let range = Range::new(&plan, None, until)?;
    let mut now = Folder::open(&again, SHORT_WAIT)?;
    now.keep_project(&project)?;
    match execute::run(&plan, &mut now, &range, global)? {
        Status::Done => {}
        Status::Interrupted => return Ok(crate::interrupt::exit_code()),
    }
    let compared = compare(&plan, &then, &now);
    let num_other = compared.iter().filter(|product| !product.same).count();
    let reporter = Reporter::new(global);
    for product in &compared {
        reporter.message(product)?;
    }
    if !global.json {
        terminal::print(&table(&compared))?;
    }
    if then.record.version != now.record.version {
        reporter.warning(&format!(
            "the run was made by version {}, this is {}",
            then.record.version, now.record.version
        ));
    }
    if num_other > 0 {
        reporter.note(&format!(
            "{num_other} of {} products differ; what was made again is in {}",
            compared.len(),
            again.display()
        ));
        return Ok(ExitCode::FAILURE);
    }
    drop(now);
    std::fs::remove_dir_all(&again).with_context(|| format!("{}: remove", again.display()))?;
    reporter.note(&format!(
        "all {} products are the same to the bit",
        compared.len()
    ));
    Ok(ExitCode::SUCCESS)
}

/// `runs/kitchen.verify` beside `runs/kitchen`.
fn beside(dir: &Path) -> PathBuf {
    let mut name = dir.file_name().unwrap_or_default().to_owned();
    name.push(".verify");
    dir.with_file_name(name)
}

fn compare(plan: &Plan, then: &Folder, now: &Folder) -> Vec<Compared> {
    let mut compared = Vec::new();
    for step in &plan.steps {
        let (Some(was), is) = (
            then.record.steps.get(&step.name).filter(|was| was.done),
            now.record.steps.get(&step.name),
        ) else {
            continue;
        };
        if ["table", "report"].contains(&step.name.as_str()) {
            continue;
        }
        for (product, digest) in &was.products {
            let found = is.and_then(|is| is.products.get(product)).cloned();
            compared.push(Compared {
                message: "compared",
                step: step.name.clone(),
                product: product.clone(),
                same: found.as_ref() == Some(digest)
                    || product.ends_with(METRICS_FILE)
                        && lasting(&then.dir.join(product))
                            .is_some_and(|was| Some(was) == lasting(&now.dir.join(product))),
                was: digest.clone(),
                is: found,
            });
        }
    }
    compared
}

/// The metrics in a file without what another run must have otherwise; `None` if there are none.
fn lasting(metrics: &Path) -> Option<Value> {
    let bytes = std::fs::read(metrics).ok()?;
    let mut value: Value = serde_json::from_slice(&bytes).ok()?;
    let render = value.get_mut("render")?.as_object_mut()?;
    render.remove("seconds_per_frame");
    render.remove("scene");
    Some(value)
}

fn table(compared: &[Compared]) -> String {
    let line = |product: &Compared| {
        let verdict = match (product.same, &product.is) {
            (true, _) => "same",
            (false, Some(_)) => "differs",
            (false, None) => "not made",
        };
        format!("{verdict:>8}  {}\n", product.product.display())
    };
    compared.iter().map(line).collect()
}
