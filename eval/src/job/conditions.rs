//! The job: one lighting of a room or several, each with its own renders and references.

use super::EvalProgress;
use super::options::{ConditionsOptions, EvalOptions};
use super::prepared::Prepared;
use crate::error::Result;
use crate::evaluation::{Conditions, Mean};
use crate::report;

/// Compares the renders of each condition with the views of its dataset, and writes the results: of
/// one condition alone into the output folder, of several into a folder each, and those of all
/// together beside.
///
/// Measured are the views that were rendered and that the dataset has: see
/// [`Selection`](super::Selection). All conditions are checked before any comparison; progress
/// counts the views of all of them. Results that are there are replaced.
///
/// # Errors
/// [`EvalError`](crate::EvalError) naming the file or option: no render of a view, a missing render
/// of the subset that was asked for (all are listed), a render of another size or with values that
/// are not finite, a view that the earlier dataset lacks, or whatever reading and writing files
/// returns.
pub fn evaluate(
    options: &ConditionsOptions,
    progress: &mut dyn FnMut(EvalProgress),
) -> Result<Conditions> {
    let prepared = options.conditions.iter().map(Prepared::new);
    let prepared = prepared.collect::<Result<Vec<_>>>()?;
    let is_alone = prepared.len() == 1;
    let names = options.conditions.iter().map(EvalOptions::condition);
    let names: Vec<String> = names.collect();
    for (name, prepared) in names.iter().zip(&prepared) {
        for text in &prepared.warnings {
            let text = match is_alone {
                true => text.clone(),
                false => format!("{name}: {text}"),
            };
            progress(EvalProgress::Warning { text });
        }
    }
    let total = prepared.iter().map(Prepared::num_views).sum();
    progress(EvalProgress::Started { total });
    let mut done = 0;
    let mut conditions = Vec::with_capacity(prepared.len());
    for (condition, prepared) in names.iter().zip(prepared) {
        conditions.push(prepared.run(&mut |view| {
            done += 1;
            let name = match is_alone {
                true => view.to_owned(),
                false => format!("{condition}/{view}"),
            };
            progress(EvalProgress::View { name, done, total });
        })?);
    }
    let found = Conditions {
        means: Mean::of_conditions(&conditions),
        conditions,
    };
    if !is_alone {
        report::write_conditions(&options.out, &found)?;
    }
    Ok(found)
}
