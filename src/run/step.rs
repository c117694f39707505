//! A command of the chain, with what it reads and makes.

use crate::command::JobCommand;
use crate::command_line;
use crate::output;
use anyhow::{Result, anyhow};
use eagpt_scene::files;
use std::path::PathBuf;

/// One command of the chain.
#[derive(Debug)]
pub(super) struct Step {
    /// Its name, as `render/original/path`.
    pub(super) name: String,
    /// Its arguments, the command's name first.
    pub(super) arguments: Vec<String>,
    /// Files and folders outside of the run that it reads.
    pub(super) reads: Vec<PathBuf>,
    /// Indices of the steps whose products it takes.
    pub(super) after: Vec<usize>,
    /// Files and folders that others take from it.
    pub(super) products: Vec<PathBuf>,
    /// How it goes on after it was stopped.
    pub(super) restart: Restart,
}

/// What to do about what a step has left that was stopped, or whose inputs have changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Restart {
    /// It begins again.
    Anew,
    /// `--resume` goes on if nothing has changed, where this file is there.
    Resume(&'static str),
    /// The command finds out itself; what is to begin again is removed before.
    Itself,
}

impl Step {
    /// Whether `--shard` divides its work.
    pub(super) fn divides(&self) -> bool {
        match self.arguments.first().map(String::as_str) {
            Some("ingest" | "render") => true,
            // Sweeps in Gaussian space need each other.
            Some("bake") => self
                .arguments
                .windows(2)
                .any(|w| w == ["--method", "views"]),
            _ => false,
        }
    }

    /// Removes what an earlier process of a step that goes on by itself has left; the products of
    /// others are removed by `--force`.
    ///
    /// # Errors
    /// If something cannot be removed.
    pub(super) fn clear(&self) -> Result<()> {
        for product in &self.products {
            files::remove_if_there(product)?;
            files::remove_if_there(&output::record_path(product))?;
            files::remove_if_there(&product.with_extension("work"))?;
        }
        Ok(())
    }

    /// The command as one would type it.
    pub(super) fn shown(&self) -> String {
        command_line::shown(&self.arguments)
    }
}

/// The command of arguments, checked.
pub(super) fn parse(arguments: &[String]) -> Result<JobCommand> {
    JobCommand::parse(arguments.iter().map(String::as_str)).map_err(|error| {
        let text = error.to_string();
        let first = text.lines().next().unwrap_or_default();
        anyhow!("{}", first.trim_start_matches("error: ").to_owned())
    })
}
