//! The error of this crate.

use eagpt_scene::SceneError;
use eagpt_scene::words::listed;
use std::path::{Path, PathBuf};

/// Result with [`ConvertError`].
pub type Result<T, E = ConvertError> = std::result::Result<T, E>;

/// Why a dataset could not be read, written or completed. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// A file could not be read or written; the message is that of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A COLMAP model could not be written; the message is that of the colmap crate.
    #[error(transparent)]
    Colmap(#[from] eagpt_colmap::ColmapError),
    /// An option is out of its range or does not go with the data.
    #[error("option {field}: {problem}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// The problem, with the value.
        problem: String,
    },
    /// A folder has no known layout.
    #[error("{}: format auto: {problem}", path.display())]
    UnknownFormat {
        /// The folder or file.
        path: PathBuf,
        /// The files searched for.
        problem: String,
    },
    /// The photograph of a frame is missing.
    #[error("{}: no such file", path.display())]
    NoImage {
        /// The file.
        path: PathBuf,
    },
    /// Frames that cannot be used, all of them.
    #[error("{}: {} of {num_frames} frames cannot be used: {}", path.display(), problems.len(), grouped(problems, *num_frames))]
    BadFrames {
        /// The dataset.
        path: PathBuf,
        /// Total number of frames.
        num_frames: usize,
        /// The problem of each.
        problems: Vec<Problem>,
    },
    /// A network or the library that runs it.
    #[error("{}: {problem}", path.display())]
    Network {
        /// The model or the library.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// The axes of normal maps are neither given nor detectable.
    #[error("{}: axes auto: {problem}", path.display())]
    UnclearAxes {
        /// The folder of maps.
        path: PathBuf,
        /// The problem, and what to do about it.
        problem: String,
    },
}

/// Why a frame cannot be used, as far as an option helps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The photograph is a JPEG, which is decoded on request.
    Jpeg,
    /// The photograph is a PNG, which is decoded on request.
    Png,
    /// There is no photograph.
    Missing,
    /// Something else, as the text says.
    Other,
}

/// A problem of one frame.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Problem {
    /// Name of the frame.
    pub view: String,
    /// The problem, with file, field and value.
    pub problem: String,
    /// Key by which problems are counted.
    #[serde(skip)]
    pub cause: Cause,
}

impl Problem {
    /// A problem of a frame.
    pub fn new(view: &str, problem: impl std::fmt::Display) -> Self {
        Self::caused(view, Cause::Other, problem)
    }

    /// A problem of a frame, of a known cause.
    pub fn caused(view: &str, cause: Cause, problem: impl std::fmt::Display) -> Self {
        Self {
            view: view.to_owned(),
            problem: problem.to_string(),
            cause,
        }
    }

    /// Common part of problems of one kind: the cause, and the text without the file in front
    /// of it and without numbers.
    fn kind(&self) -> (Cause, String) {
        if self.cause != Cause::Other {
            return (self.cause, String::new());
        }
        let text = self
            .problem
            .split_once(": ")
            .map_or(&*self.problem, |p| p.1);
        let mut kind = String::new();
        for c in text.chars() {
            match c.is_ascii_digit() {
                true if kind.ends_with('#') => {}
                true => kind.push('#'),
                false => kind.push(c),
            }
        }
        (self.cause, kind)
    }
}

impl ConvertError {
    /// A [`ConvertError::Option`].
    pub fn option(field: &'static str, problem: impl Into<String>) -> Self {
        Self::Option {
            field,
            problem: problem.into(),
        }
    }

    /// A [`SceneError::Invalid`] for `field` of `path`.
    pub fn invalid(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        SceneError::invalid(path, field, problem).into()
    }

    /// A [`SceneError::Unsupported`] for `field` of `path`.
    pub fn unsupported(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        SceneError::unsupported(path, field, problem).into()
    }
}

/// Problems in one line, by their causes, with the option that helps.
fn grouped(problems: &[Problem], num_frames: usize) -> String {
    const MAX_KINDS: usize = 8;
    let mut groups: Vec<((Cause, String), Vec<&Problem>)> = Vec::new();
    for problem in problems {
        let kind = problem.kind();
        match groups.iter_mut().find(|(of, _)| *of == kind) {
            Some((_, of_kind)) => of_kind.push(problem),
            None => groups.push((kind, vec![problem])),
        }
    }
    groups.sort_by_key(|((cause, _), of_kind)| (*cause, std::cmp::Reverse(of_kind.len())));
    let mut texts: Vec<String> = groups
        .iter()
        .take(MAX_KINDS)
        .map(|((cause, _), of_kind)| told(*cause, of_kind))
        .collect();
    let more: usize = groups.iter().skip(MAX_KINDS).map(|(_, of)| of.len()).sum();
    if more > 0 {
        texts.push(format!("and {more} more"));
    }
    let has_others = groups.iter().any(|((cause, _), _)| *cause == Cause::Other);
    if has_others && problems.len() < num_frames {
        texts.push("--skip-bad leaves such frames out".to_owned());
    }
    texts.join("; ")
}

/// Problems of one kind.
fn told(cause: Cause, problems: &[&Problem]) -> String {
    const MAX_NAMES: usize = 4;
    let num = problems.len();
    let names: Vec<&str> = problems.iter().map(|p| p.view.as_str()).collect();
    let names = listed(&names, MAX_NAMES);
    let are = if num == 1 { "is" } else { "are" };
    match cause {
        Cause::Jpeg => format!("{num} {are} JPEG, for --ldr srgb to decode: {names}"),
        Cause::Png => format!("{num} {are} PNG, for --ldr srgb to decode: {names}"),
        Cause::Missing => format!("{num} {are} missing, for --skip-bad to leave out: {names}"),
        Cause::Other if num == 1 => format!("{names}: {}", problems[0].problem),
        Cause::Other => format!("{num} as {}: {names}", problems[0].problem),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(problems: Vec<Problem>) -> String {
        let error = ConvertError::BadFrames {
            path: "room".into(),
            num_frames: 90,
            problems,
        };
        error.to_string()
    }

    #[test]
    fn causes_are_counted_with_the_option_that_helps() {
        let mut problems: Vec<Problem> = (0..17)
            .map(|i| Problem::caused(&format!("m{i}"), Cause::Missing, "no file"))
            .collect();
        let jpeg = |i| Problem::caused(&format!("{i:03}"), Cause::Jpeg, "JPEG");
        problems.extend((0..50).map(jpeg));
        assert_eq!(
            message(problems),
            "room: 67 of 90 frames cannot be used: 50 are JPEG, for --ldr srgb to decode: 000, 001, 002, 003 and 46 more; \
             17 are missing, for --skip-bad to leave out: m0, m1, m2, m3 and 13 more"
        );
    }

    #[test]
    fn other_problems_are_counted_by_what_they_say() {
        let size = |i| {
            Problem::new(
                &format!("{i:03}"),
                format!("a/{i}.exr: size: {i}x9, not 5x9"),
            )
        };
        let mut problems: Vec<Problem> = (6..9).map(size).collect();
        problems.push(Problem::new("x", "t.json: frames[3].w: missing"));
        assert_eq!(
            message(problems),
            "room: 4 of 90 frames cannot be used: 3 as a/6.exr: size: 6x9, not 5x9: 006, 007, 008; \
             x: t.json: frames[3].w: missing; --skip-bad leaves such frames out"
        );
    }
}
