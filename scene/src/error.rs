//! The error of this crate, which names file, field and value.

use std::path::{Path, PathBuf};

/// Result with [`SceneError`].
pub type Result<T, E = SceneError> = std::result::Result<T, E>;

/// Error of reading, writing or building a type of this crate. Every variant prints as one line
/// that names the file.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The content of a file is wrong; the caller has to mend the file.
    #[error("{}: {field}: {problem}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Place in the file: a key, a property, a channel, a header line.
        field: String,
        /// The problem, with the offending value.
        problem: String,
    },
    /// A script or setting that cannot be, or that does not fit the scene.
    #[error("{}: line {line}: {key}: {problem}", path.display())]
    Script {
        /// The file.
        path: PathBuf,
        /// Line of the key or value, counted from 1.
        line: usize,
        /// Place in the file, as `step[0].then[1].move`; "TOML" if it is no TOML.
        key: String,
        /// The problem, with the value.
        problem: String,
    },
    /// The file is well formed but uses something this version does not read.
    #[error("{}: {field}: not supported: {problem}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Place in the file.
        field: String,
        /// The unsupported feature.
        problem: String,
    },
    /// A folder holds work that this process may not continue or replace.
    #[error("{}: {problem}", path.display())]
    Work {
        /// The folder, or the file that tells.
        path: PathBuf,
        /// Its content, and the remedy.
        problem: String,
    },
    /// There is no file or folder of that name.
    #[error("{}: no such {what}", path.display())]
    NotThere {
        /// The file or folder.
        path: PathBuf,
        /// "file" or "folder".
        what: &'static str,
    },
    /// The operating system refused.
    #[error("{}: {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operation: "read", "read folder", "write", "create folder".
        action: &'static str,
        /// The reason given by the operating system.
        source: std::io::Error,
    },
}

/// Messages of other decoders may have several lines.
fn one_line(text: String) -> String {
    if !text.contains(char::is_control) {
        return text;
    }
    let words: Vec<&str> = text
        .split(|c: char| c.is_control() || c == ' ')
        .filter(|word| !word.is_empty())
        .collect();
    words.join(" ")
}

impl SceneError {
    /// An [`SceneError::Invalid`] for `field` of `path`.
    pub fn invalid(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid {
            path: path.to_owned(),
            field: field.into(),
            problem: one_line(problem.into()),
        }
    }

    /// An [`SceneError::Script`] for `key` of `path`.
    pub fn script(path: &Path, line: usize, key: String, problem: impl Into<String>) -> Self {
        Self::Script {
            path: path.to_owned(),
            line,
            key: one_line(key),
            problem: one_line(problem.into()),
        }
    }

    /// An [`SceneError::Unsupported`] for `field` of `path`.
    pub fn unsupported(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Unsupported {
            path: path.to_owned(),
            field: field.into(),
            problem: one_line(problem.into()),
        }
    }

    /// An [`SceneError::Io`] for `path`, or a [`SceneError::NotThere`] where something to be read
    /// is missing: people have mistyped its name.
    pub fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        match (source.kind(), action) {
            (std::io::ErrorKind::NotFound, "read folder") => Self::no_folder(path),
            (std::io::ErrorKind::NotFound, "read") => Self::NotThere {
                path: path.to_owned(),
                what: "file",
            },
            _ => Self::Io {
                path: path.to_owned(),
                action,
                source,
            },
        }
    }

    /// An [`SceneError::NotThere`] for a folder.
    pub fn no_folder(path: &Path) -> Self {
        Self::NotThere {
            path: path.to_owned(),
            what: "folder",
        }
    }
}
