//! From a folder of photographs to stacks, with everything that is wrong about them.

mod folder;
mod gathered;
mod positions;

pub(crate) use gathered::Gathered;

use crate::discover::{self, Found};
use crate::error::{IngestError, Result};
use crate::manifest::{self, ListedStack, Manifest};
use crate::options::IngestOptions;
use crate::problem::{Problem, Remedy};
use crate::raw::Decoding;
use crate::stack::{Photograph, Stack};
use eagpt_scene::files;
use folder::folder_stacks;
use positions::name_positions;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

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
