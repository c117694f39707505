//! Finding the photographs of a capture: folders are conditions or stacks.

use crate::error::Result;
use crate::problem::{Problem, Remedy};
use crate::raw::{FileKind, kind_of};
use crate::stack::{ONLY_CONDITION, natural};
use eagpt_scene::files;
use eagpt_scene::words::{counted, listed};
use std::path::{Path, PathBuf};

/// The photographs of a folder.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Folder {
    /// Lighting condition.
    pub(crate) condition: String,
    /// Name of the stack that the folder is; `None` if it holds many.
    pub(crate) position: Option<String>,
    /// Files in the order of their names.
    pub(crate) files: Vec<PathBuf>,
}

/// Contents of a capture.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Found {
    pub(crate) folders: Vec<Folder>,
    pub(crate) problems: Vec<Problem>,
    /// Notes about files that were ignored.
    pub(crate) notes: Vec<String>,
}

/// Contents of a folder, sorted by name.
struct Listing {
    files: Vec<PathBuf>,
    folders: Vec<PathBuf>,
}

/// Lists the photographs of a capture. With `stacks_in_folders`, a folder with photographs is a
/// stack, else a condition.
///
/// # Errors
/// If a folder cannot be read.
pub(crate) fn discover(capture: &Path, stacks_in_folders: bool) -> Result<Found> {
    let mut found = Found::default();
    let top = list(capture)?;
    if let Some(files) = photographs(capture, "", &top.files, &mut found) {
        found.folders.push(Folder {
            condition: ONLY_CONDITION.to_owned(),
            position: None,
            files,
        });
    }
    for folder in &top.folders {
        let condition = name_of(folder);
        let inside = list(folder)?;
        let files = photographs(capture, &condition, &inside.files, &mut found);
        match files {
            Some(files) if stacks_in_folders && inside.folders.is_empty() => {
                found.folders.push(Folder {
                    condition: ONLY_CONDITION.to_owned(),
                    position: Some(condition.clone()),
                    files,
                });
            }
            Some(files) => found.folders.push(Folder {
                condition: condition.clone(),
                position: None,
                files,
            }),
            None => {}
        }
        for stack in &inside.folders {
            let position = name_of(stack);
            let label = format!("{condition}/{position}");
            if let Some(files) = photographs(capture, &label, &list(stack)?.files, &mut found) {
                found.folders.push(Folder {
                    condition: condition.clone(),
                    position: Some(position),
                    files,
                });
            }
        }
    }
    let loose = found
        .folders
        .iter()
        .any(|f| f.condition == ONLY_CONDITION && f.position.is_none());
    if loose && found.folders.len() > 1 {
        found.problems.push(Problem::new(
            capture.display().to_string(),
            Remedy::None,
            "photographs lie both in the folder itself and in folders below: one folder for each condition, or none",
        ));
    }
    Ok(found)
}

/// The files of a folder that count, if any.
fn photographs(
    capture: &Path,
    label: &str,
    files: &[PathBuf],
    found: &mut Found,
) -> Option<Vec<PathBuf>> {
    let of_kind = |kind: FileKind| -> Vec<PathBuf> {
        let fitting = files.iter().filter(|file| kind_of(file) == Some(kind));
        fitting.cloned().collect()
    };
    let (raw, linear) = (of_kind(FileKind::Raw), of_kind(FileKind::Linear));
    let (jpeg, display) = (of_kind(FileKind::Jpeg), of_kind(FileKind::Display));
    let names = |files: &[PathBuf]| files.iter().map(|f| name_of(f)).collect::<Vec<_>>();
    let label = if label.is_empty() {
        capture.display().to_string()
    } else {
        label.to_owned()
    };
    let mut aside = |files: &[PathBuf], why: &str| {
        if !files.is_empty() {
            let what = counted(files.len(), "file");
            let names = listed(&names(files), 3);
            found
                .notes
                .push(format!("{label}: {what} left aside, {why}: {names}"));
        }
    };
    if !raw.is_empty() {
        aside(&linear, "no RAW beside RAW");
        aside(&jpeg, "8-bit pictures beside RAW");
        aside(&display, "8-bit pictures beside RAW");
        return Some(raw);
    }
    if !linear.is_empty() {
        aside(&jpeg, "8-bit pictures");
        aside(&display, "8-bit pictures");
        return Some(linear);
    }
    if !jpeg.is_empty() {
        aside(&display, "no JPEG beside JPEG");
        return Some(jpeg);
    }
    if !display.is_empty() {
        found.problems.push(Problem::new(
            label,
            Remedy::LeaveOutFile,
            format!(
                "{} for display and neither RAW nor JPEG ({}): copy the camera's RAW files",
                counted(display.len(), "picture"),
                listed(&names(&display), 3)
            ),
        ));
    }
    None
}

fn list(dir: &Path) -> Result<Listing> {
    let mut paths = files::list(dir)?;
    paths.retain(|path| !name_of(path).starts_with('.'));
    paths.sort_by(|a, b| natural(&name_of(a), &name_of(b)));
    let (folders, files) = paths.into_iter().partition(|path| path.is_dir());
    Ok(Listing { files, folders })
}

pub(crate) fn name_of(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
