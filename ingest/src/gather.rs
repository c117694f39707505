//! From a folder of photographs to stacks, with everything that is wrong about them.

use crate::discover::{self, Folder, Found};
use crate::error::{IngestError, Result};
use crate::group::{self, Bracket, Key};
use crate::manifest::{self, ListedStack, Manifest};
use crate::options::IngestOptions;
use crate::problem::{Problem, Remedy};
use crate::raw::Decoding;
use crate::stack::{Photograph, Stack};
use eagpt_scene::files;
use eagpt_scene::words::{counted, listed};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The stacks of a capture.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Gathered {
    pub(crate) stacks: Vec<Stack>,
    pub(crate) problems: Vec<Problem>,
    pub(crate) notes: Vec<String>,
    pub(crate) manifest: Option<Manifest>,
}

/// Files whose headers are read between two messages.
const CHUNK: usize = 16;

/// Looks into a capture and makes stacks of what is there; `tell` gets the files done and their
/// number.
///
/// # Errors
/// If a folder cannot be read, or the manifest is wrong.
pub(crate) fn gather(
    capture: &Path,
    options: &IngestOptions,
    decoding: &Decoding,
    tell: &mut dyn FnMut(usize, usize),
) -> Result<Gathered> {
    if !capture.is_dir() {
        return Err(IngestError::Empty {
            capture: capture.to_owned(),
            problem: "is not a folder of photographs".to_owned(),
        });
    }
    let manifest_path = capture.join(manifest::FILE_NAME);
    let mut gathered = Gathered::default();
    let mut read = |paths: &[PathBuf], gathered: &mut Gathered| {
        read_all(capture, paths, decoding, gathered, tell)
    };
    if manifest_path.exists() {
        let manifest = Manifest::read(&manifest_path)?;
        listed_stacks(capture, &manifest.stacks, &mut gathered, &mut read);
        gathered.manifest = Some(manifest);
    } else {
        found_stacks(capture, options, &mut gathered, &mut read)?;
    }
    Ok(gathered)
}

/// Reads the headers of files.
type ReadAll<'a> = &'a mut dyn FnMut(&[PathBuf], &mut Gathered) -> BTreeMap<PathBuf, Photograph>;

fn listed_stacks(
    capture: &Path,
    listed: &[ListedStack],
    gathered: &mut Gathered,
    read: ReadAll<'_>,
) {
    let files = listed.iter().flat_map(|stack| &stack.files);
    let paths: Vec<PathBuf> = files.map(|file| capture.join(file)).collect();
    let mut photographs = read(&paths, gathered);
    for stack in listed {
        let mut shots = Vec::new();
        for (index, file) in stack.files.iter().enumerate() {
            let Some(mut shot) = photographs.remove(&capture.join(file)) else {
                continue;
            };
            if let Some(exposures_s) = &stack.exposures_s {
                shot.header.metadata.exposure_s = Some(exposures_s[index]);
            }
            if let Some(problem) = shot.header.metadata.exposure_problem() {
                let problem = Problem::new(&shot.name, Remedy::LeaveOutStack, problem);
                gathered.problems.push(problem);
                continue;
            }
            shots.push(shot);
        }
        let whole = shots.len() == stack.files.len();
        let mut found = Stack {
            condition: stack.condition.clone(),
            position: stack.position.clone(),
            shots,
        };
        found.sort();
        // Unreadable shots are reported already; an incomplete stack is not merged.
        if whole {
            gathered.stacks.push(found);
        }
    }
}

fn found_stacks(
    capture: &Path,
    options: &IngestOptions,
    gathered: &mut Gathered,
    read: ReadAll<'_>,
) -> Result<()> {
    let Found {
        folders,
        problems,
        notes,
    } = discover::discover(capture, options.stacks_in_folders)?;
    gathered.problems.extend(problems);
    gathered.notes.extend(notes);
    let paths: Vec<PathBuf> = folders
        .iter()
        .flat_map(|folder| folder.files.clone())
        .collect();
    let mut photographs = read(&paths, gathered);
    for folder in folders {
        let shots: Vec<Photograph> = folder
            .files
            .iter()
            .filter_map(|file| photographs.remove(file))
            .collect();
        folder_stacks(&folder, shots, options, gathered);
    }
    name_positions(gathered);
    Ok(())
}

/// Reads all headers, in order; those that cannot be read become problems.
fn read_all(
    capture: &Path,
    paths: &[PathBuf],
    decoding: &Decoding,
    gathered: &mut Gathered,
    tell: &mut dyn FnMut(usize, usize),
) -> BTreeMap<PathBuf, Photograph> {
    let mut photographs = BTreeMap::new();
    for (chunk, files) in paths.chunks(CHUNK).enumerate() {
        let read: Vec<_> = files
            .par_iter()
            .map(|path| decoding.inspect(path))
            .collect();
        for (path, outcome) in files.iter().zip(read) {
            let name = files::relative_name(capture, path);
            match outcome {
                Ok((header, blake3)) => {
                    let path = path.clone();
                    let shot = Photograph {
                        path: path.clone(),
                        name,
                        header,
                        blake3,
                    };
                    photographs.insert(path, shot);
                }
                Err(error) => gathered.problems.push(file_problem(&name, path, &error)),
            }
        }
        tell((chunk * CHUNK + files.len()).min(paths.len()), paths.len());
    }
    photographs
}

/// The problem of a file that an error tells, without the path that its name repeats.
pub(crate) fn file_problem(name: &str, path: &Path, error: &IngestError) -> Problem {
    let text = error.to_string();
    let prefix = format!("{}: ", path.display());
    let text = text.strip_prefix(&prefix).unwrap_or(&text);
    Problem::new(name, Remedy::LeaveOutStack, text)
}

/// Makes stacks of the photographs of a folder.
fn folder_stacks(
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
pub(crate) fn seconds(time_s: f64) -> String {
    if time_s < 0.3 {
        format!("1/{:.0} s", 1.0 / time_s)
    } else {
        format!("{time_s:.1} s")
    }
}

/// Gives the positions of several conditions the same names, which is what poses are shared by.
fn name_positions(gathered: &mut Gathered) {
    let mut of_condition: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, stack) in gathered.stacks.iter().enumerate() {
        of_condition
            .entry(stack.condition.clone())
            .or_default()
            .push(index);
    }
    if of_condition.len() < 2 {
        return;
    }
    let names = |indices: &Vec<usize>| -> BTreeSet<String> {
        indices
            .iter()
            .map(|&i| gathered.stacks[i].position.clone())
            .collect()
    };
    let sets: Vec<BTreeSet<String>> = of_condition.values().map(names).collect();
    let shared = sets
        .iter()
        .flatten()
        .any(|name| sets.iter().filter(|set| set.contains(name)).count() > 1);
    if shared {
        // Names tell; a position that one condition lacks is allowed, but not in silence.
        for (condition, set) in of_condition.keys().zip(&sets) {
            let all: BTreeSet<&String> = sets.iter().flatten().collect();
            let lacking: Vec<String> = all
                .iter()
                .filter(|n| !set.contains(**n))
                .map(|n| (*n).clone())
                .collect();
            if !lacking.is_empty() {
                gathered.notes.push(format!(
                    "{condition}: no {}: {}",
                    counted(lacking.len(), "position")
                        .split_once(' ')
                        .map_or("position", |(_, noun)| noun),
                    listed(&lacking, 6)
                ));
            }
        }
        return;
    }
    let counts: Vec<String> = of_condition
        .iter()
        .map(|(name, list)| format!("{name} {}", list.len()))
        .collect();
    if sets.iter().any(|set| set.len() != sets[0].len()) {
        gathered.problems.push(Problem::new(
            "positions",
            Remedy::None,
            format!(
                "the conditions have different numbers of them ({}), and file names do not tell which belong together: a capture.toml does",
                counts.join(", ")
            ),
        ));
        return;
    }
    gathered.notes.push(format!(
        "positions of the conditions ({}) are matched by their order",
        counts.join(", ")
    ));
    for list in of_condition.values() {
        for (number, &index) in list.iter().enumerate() {
            gathered.stacks[index].position = format!("p{number:03}");
        }
    }
}
