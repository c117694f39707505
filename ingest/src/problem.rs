//! Problems of a capture, one line each.

use serde::Serialize;
use std::fmt;

/// A problem of the capture.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// A file, a stack as `condition/position`, or the capture.
    pub subject: String,
    /// The problem, with the values, and the remedy.
    pub problem: String,
    /// Effect of `--skip-bad`.
    pub(crate) remedy: Remedy,
    /// Files or stacks that it concerns, by name.
    pub concerns: Vec<String>,
}

/// Effect of `--skip-bad` on a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Remedy {
    /// The file is left out; its stack stays.
    LeaveOutFile,
    /// The whole stack is left out.
    LeaveOutStack,
    /// Cannot be skipped: the capture has to be fixed.
    None,
}

impl Problem {
    pub(crate) fn new(
        subject: impl Into<String>,
        remedy: Remedy,
        problem: impl Into<String>,
    ) -> Self {
        let subject = subject.into();
        Self {
            concerns: vec![subject.clone()],
            subject,
            problem: problem.into(),
            remedy,
        }
    }

    /// Sets the files or stacks concerned, if other than the subject.
    pub(crate) fn concerning(mut self, names: Vec<String>) -> Self {
        self.concerns = names;
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subject, self.problem)
    }
}
