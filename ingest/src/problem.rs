//! What is wrong with a capture, one line each.

use serde::Serialize;
use std::fmt;

/// What cannot be used as it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// A file, a stack as `condition/position`, or the capture.
    pub subject: String,
    /// What is wrong with it, with the values, and what helps.
    pub problem: String,
    /// What `--skip-bad` does about it.
    pub remedy: Remedy,
    /// Files or stacks that it concerns, by name.
    pub concerns: Vec<String>,
}

/// What going on without something means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Remedy {
    /// The file is left out; its stack stays.
    LeaveOutFile,
    /// The whole stack is left out.
    LeaveOutStack,
    /// Nothing is there to be left out, or too much: the capture has to be mended.
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

    /// With other files or stacks than the subject that it concerns.
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

/// "1 stack", "3 stacks".
pub(crate) fn counted(num: usize, noun: &str) -> String {
    let plural = if num == 1 { "" } else { "s" };
    format!("{num} {noun}{plural}")
}

/// At most `most` names, and how many more there are.
pub(crate) fn listed(names: &[String], most: usize) -> String {
    let shown = names
        .iter()
        .take(most)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    match names.len().saturating_sub(most) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
