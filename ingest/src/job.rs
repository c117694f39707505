//! The job: a folder of photographs in, images of linear light and a report out.

use crate::check::check;
use crate::error::{IngestError, Result};
use crate::gather::{Gathered, file_problem, gather};
use crate::merge_all::{Prepared, merge_all};
use crate::options::IngestOptions;
use crate::output::{self, COMMAND};
use crate::prepare::{self, Decisions};
use crate::problem::{Problem, Remedy};
use crate::request::{IngestProgress, IngestRequest, IngestSummary, Tell};
use crate::survey::{Reader, Survey, survey};
use eagpt_scene::files::ledger::{self, Item};
use eagpt_scene::files::{Key, Ledger};
use eagpt_scene::words::counted;
use std::path::Path;

/// Ingests a capture; `None` if it was one part of several, whose images [`ingest`] of the whole
/// puts together.
///
/// # Errors
/// [`IngestError`]; everything that is wrong with the photographs is told as
/// [`IngestProgress::Problem`] before the error.
pub fn ingest(request: &IngestRequest, tell: Tell<'_>) -> Result<Option<IngestSummary>> {
    let IngestRequest {
        capture,
        out,
        options,
        decoding,
        ..
    } = request;
    options.validate()?;
    prepare::check_places(capture, out)?;
    decoding.check()?;
    let mut gathered = gather(capture, options, decoding, &mut |done, total| {
        tell(IngestProgress::Reading { done, total });
    })?;
    check(&mut gathered, options.max_pause_s);
    let num_stacks = gathered.stacks.len();
    let mut left_out = settle(capture, options, &mut gathered, 0, None)?;
    if request.start_over {
        ledger::clear(out, COMMAND)?;
    }
    // Items have keys of their own: what is made of one stack does not depend on the others.
    let mut ledger = Ledger::open(out, COMMAND, &Key::new(), request.shard, ledger::ADVICE)?;
    // Colours are needed to survey, but a capture whose first stack is bad has none yet.
    let decisions = prepare::decide(request, &gathered);
    let surveys = match &decisions {
        Ok(decisions) => survey_all(request, &mut gathered, decisions, &mut ledger, tell)?,
        Err(_) => Vec::new(),
    };
    let all: Vec<Problem> = left_out.iter().chain(&gathered.problems).cloned().collect();
    for problem in &all {
        tell(IngestProgress::Problem(problem.clone()));
    }
    let unsettled = all.iter().any(|problem| problem.remedy == Remedy::None);
    if !all.is_empty() && (!options.skip_bad || unsettled) {
        return Err(IngestError::BadCapture {
            capture: capture.clone(),
            num_problems: counted(all.len(), "problem"),
            num_stacks,
        });
    }
    let mut surveys = surveys;
    left_out.extend(settle(
        capture,
        options,
        &mut gathered,
        left_out.len(),
        Some(&mut surveys),
    )?);
    let decisions = decisions?;
    let first = gathered
        .stacks
        .first()
        .and_then(|stack| stack.shots.first());
    let display = first.and_then(|shot| shot.header.display.as_ref());
    if let (Some(response), Some(display)) = (&decisions.response, display) {
        gathered.notes.push(response.note(&display.primaries));
    }
    if let Some(aspect) = first.and_then(|shot| shot.header.metadata.pixel_aspect) {
        gathered.notes.extend(pixel_note(aspect));
    }
    for note in &gathered.notes {
        tell(IngestProgress::Note { text: note.clone() });
    }
    let prepared = Prepared {
        gathered,
        surveys,
        decisions: &decisions,
        left_out,
    };
    merge_all(request, prepared, ledger, tell)
}

/// Takes out what the problems concern, so that what follows sees only good stacks, and returns the
/// problems. Without `--skip-bad` the job ends after all of them are known.
fn settle(
    capture: &Path,
    options: &IngestOptions,
    gathered: &mut Gathered,
    num_before: usize,
    mut surveys: Option<&mut Vec<Option<Survey>>>,
) -> Result<Vec<Problem>> {
    let problems = std::mem::take(&mut gathered.problems);
    let concerns = |name: &str, remedy: Remedy| {
        let mut fitting = problems.iter().filter(|problem| problem.remedy == remedy);
        fitting.any(|problem| problem.concerns.iter().any(|concerned| concerned == name))
    };
    let num_stacks = gathered.stacks.len();
    for index in (0..num_stacks).rev() {
        let stack = &mut gathered.stacks[index];
        stack
            .shots
            .retain(|shot| !concerns(&shot.name, Remedy::LeaveOutFile));
        let shot_is_bad = stack
            .shots
            .iter()
            .any(|shot| concerns(&shot.name, Remedy::LeaveOutStack));
        if stack.shots.is_empty() || shot_is_bad || concerns(&stack.name(), Remedy::LeaveOutStack) {
            gathered.stacks.remove(index);
            if let Some(surveys) = surveys.as_deref_mut() {
                surveys.remove(index);
            }
        }
    }
    if gathered.stacks.is_empty() && problems.is_empty() && num_before == 0 {
        return Err(IngestError::Empty {
            capture: capture.to_owned(),
            problem: "no photographs in it".to_owned(),
        });
    }
    if gathered.stacks.is_empty() && options.skip_bad {
        return Err(IngestError::Empty {
            capture: capture.to_owned(),
            problem: "nothing is left without what is bad".to_owned(),
        });
    }
    Ok(problems)
}

/// Surveys all stacks; those that cannot be decoded become problems.
fn survey_all(
    request: &IngestRequest,
    gathered: &mut Gathered,
    decisions: &Decisions,
    ledger: &mut Ledger,
    tell: Tell<'_>,
) -> Result<Vec<Option<Survey>>> {
    let total = gathered.stacks.len();
    let clip = request.options.clip();
    let color = &decisions.color;
    let reader = Reader {
        decoding: &request.decoding,
        response: decisions.response.as_ref(),
    };
    let mut surveys = vec![None; total];
    let mut unreadable_shots = Vec::new();
    let (own, others): (Vec<usize>, Vec<usize>) =
        (0..total).partition(|&index| request.shard.has(index));
    for (done, index) in (1..).zip(own.into_iter().chain(others)) {
        request.check_stop(0, total)?;
        let stack = &gathered.stacks[index];
        let name = output::item("survey", stack);
        let key =
            prepare::item_key(&(prepare::shots_key(stack), color, clip, &decisions.response))?;
        if !request.shard.has(index) && ledger.noted(&name).is_none() {
            ledger.take_others()?;
        }
        let noted = ledger.noted(&name);
        let noted = noted.filter(|item| item.key.as_ref() == Some(&key));
        surveys[index] = match noted.and_then(Item::value) {
            Some(survey) => Some(survey),
            None => match survey(stack, &reader, color, clip) {
                Ok(value) => {
                    ledger.add_with(&name, 0.0, Some(key), &value, &[])?;
                    Some(value)
                }
                Err(unreadable) => {
                    let shot = &stack.shots[unreadable.shot];
                    let problem = file_problem(&shot.name, &shot.path, &unreadable.error);
                    unreadable_shots.push((index, problem));
                    None
                }
            },
        };
        tell(IngestProgress::Surveying { done, total });
    }
    unreadable_shots.sort_by_key(|(index, _)| *index);
    let problems = unreadable_shots.into_iter().map(|(_, problem)| problem);
    gathered.problems.extend(problems);
    Ok(surveys)
}

/// A note about pixels that are not square.
fn pixel_note(aspect: f64) -> Option<String> {
    let text = || format!("pixels are {aspect:.3} times as wide as high: made square");
    (aspect != 1.0).then(text)
}
