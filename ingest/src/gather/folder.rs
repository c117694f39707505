//! From the photographs of a folder to stacks, each held against the bracket of the folder.

use super::gathered::Gathered;
use crate::discover::Folder;
use crate::group::{self, Bracket, Key};
use crate::options::IngestOptions;
use crate::problem::{Problem, Remedy};
use crate::stack::{Photograph, Stack};
use eagpt_scene::words::{counted, listed};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Makes stacks of the photographs of a folder.
pub(super) fn folder_stacks(
    folder: &Folder,
    mut shots: Vec<Photograph>,
    options: &IngestOptions,
    gathered: &mut Gathered,
) {
    let stem = |shot: &Photograph| {
        let stem = shot.path.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    };
    // Exposures that an option states stand for the shots of a stack in turn.
    if let Some(exposures_s) = &options.exposures_s {
        for (index, shot) in shots.iter_mut().enumerate() {
            let index = match group::split_name(&stem(shot)) {
                Some((_, index)) if (index as usize) < exposures_s.len() => index as usize,
                _ => index % exposures_s.len(),
            };
            shot.header.metadata.exposure_s = Some(exposures_s[index]);
        }
    }
    let mut unknown: BTreeMap<String, Vec<String>> = BTreeMap::new();
    shots.retain(|shot| {
        let problem = shot.header.metadata.exposure_problem();
        let known = problem.is_none();
        if let Some(problem) = problem {
            unknown.entry(problem).or_default().push(shot.name.clone());
        }
        known
    });
    for (problem, names) in unknown {
        let subject = listed(&names, 3);
        let problem = Problem::new(subject, Remedy::LeaveOutFile, problem);
        gathered.problems.push(problem);
    }
    if shots.is_empty() {
        return;
    }
    let keys: Vec<Key> = shots
        .iter()
        .map(|shot| Key {
            stem: stem(shot),
            time_s: shot.header.metadata.time_s,
            exposure: shot.exposure(),
        })
        .collect();
    let groups = match folder.position {
        Some(_) => vec![group::chronological(&keys)],
        None => group::group(&keys, options.max_pause_s),
    };
    let bracket = Bracket::most_common(&keys, &groups);
    let mut slots: Vec<Option<Photograph>> = shots.into_iter().map(Some).collect();
    for group in groups {
        let stems: Vec<&str> = group.iter().map(|&shot| keys[shot].stem.as_str()).collect();
        let position = folder
            .position
            .clone()
            .unwrap_or_else(|| group::name_of_group(&stems));
        let members: Vec<Photograph> = group
            .iter()
            .filter_map(|&shot| slots[shot].take())
            .collect();
        let mut stack = Stack {
            condition: folder.condition.clone(),
            position,
            shots: members,
        };
        if let Some(bracket) = bracket.as_ref().filter(|_| folder.position.is_none()) {
            let deviation = bracket.deviation(&keys, &group);
            report(&stack, &deviation, bracket, &folder.files, gathered);
        }
        stack.sort();
        gathered.stacks.push(stack);
    }
}

/// Says how a stack differs from the bracket.
fn report(
    stack: &Stack,
    deviation: &group::Deviation,
    bracket: &Bracket,
    files: &[PathBuf],
    gathered: &mut Gathered,
) {
    let name = stack.name();
    let times = |exposure: f64| {
        // Exposures are compared with gain and aperture; people think in times.
        let own = stack.shots.first();
        let per_second = own.map_or(1.0, |s| {
            s.exposure() / s.header.metadata.exposure_s.unwrap_or(1.0)
        });
        seconds(exposure / per_second)
    };
    let explained = unread_of(stack, files, gathered, deviation.missing.len());
    if !deviation.missing.is_empty() && !explained {
        let missing: Vec<String> = deviation.missing.iter().map(|e| times(*e)).collect();
        let files: Vec<String> = stack.shots.iter().map(|shot| shot.name.clone()).collect();
        gathered.problems.push(Problem::new(
            &name,
            Remedy::LeaveOutStack,
            format!(
                "misses {} of {}: {}; has {}",
                missing.len(),
                counted(bracket.0.len(), "exposure"),
                missing.join(", "),
                listed(&files, 6)
            ),
        ));
    }
    for (first, second) in &deviation.double {
        gathered.problems.push(Problem::new(
            &stack.shots[*second].name,
            Remedy::LeaveOutFile,
            format!(
                "one too many in {name}: the exposure of {}, {}",
                stack.shots[*first].name,
                times(stack.shots[*first].exposure())
            ),
        ));
    }
    for extra in &deviation.extra {
        gathered.problems.push(Problem::new(
            &stack.shots[*extra].name,
            Remedy::LeaveOutFile,
            format!(
                "one too many in {name}: {} is not an exposure of the bracket",
                times(stack.shots[*extra].exposure())
            ),
        ));
    }
    if deviation.out_of_order {
        gathered
            .notes
            .push(format!("{name}: shots are in another order than elsewhere"));
    }
    for (odd, expected) in &deviation.odd {
        let shot = &stack.shots[*odd];
        gathered.notes.push(format!(
            "{}: {} where other stacks have {}",
            shot.name,
            times(shot.exposure()),
            times(*expected)
        ));
    }
}

/// Whether files that could not be read explain what a stack misses. They have a line already,
/// which is made to concern the stack.
fn unread_of(
    stack: &Stack,
    files: &[PathBuf],
    gathered: &mut Gathered,
    num_missing: usize,
) -> bool {
    let stem = |path: &Path| {
        path.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let in_stack = |path: &PathBuf| stack.shots.iter().any(|shot| shot.path == *path);
    let mut found = Vec::new();
    for (index, path) in files.iter().enumerate() {
        let name = stem(path);
        let belongs = match group::split_name(&name) {
            Some((prefix, _)) if prefix == stack.position => true,
            // Without a name to go by, whose neighbours are in the stack.
            _ => {
                let before = index.checked_sub(1).and_then(|index| files.get(index));
                before.is_some_and(in_stack) && files.get(index + 1).is_some_and(in_stack)
            }
        };
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let line = gathered.problems.iter().position(|problem| {
            problem.subject.rsplit('/').next() == Some(file.as_ref()) && !in_stack(path)
        });
        found.extend(line.filter(|_| belongs));
    }
    if found.len() < num_missing {
        return false;
    }
    for line in found {
        gathered.problems[line].concerns.push(stack.name());
    }
    true
}

/// An exposure time as people write it.
fn seconds(time_s: f64) -> String {
    if time_s < 0.3 {
        format!("1/{:.0} s", 1.0 / time_s)
    } else {
        format!("{time_s:.1} s")
    }
}
