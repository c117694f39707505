//! A command of the chain, with what it reads and makes.

use crate::bake::MethodArg;
use crate::colmap::{ColmapArgs, ColmapCommand};
use crate::command::JobCommand;
use crate::command_line;
use crate::eval::{EvalArgs, EvalCommand};
use crate::output;
use anyhow::Result;
use eagpt_scene::{Shard, files};
use std::path::PathBuf;

/// One command of the chain.
#[derive(Debug)]
pub(crate) struct PlanStep {
    /// Its name, as `render/original/path`.
    pub(crate) name: String,
    /// The command with its options.
    pub(super) command: JobCommand,
    /// Files and folders outside of the run that it reads.
    pub(super) reads: Vec<PathBuf>,
    /// Indices of the steps whose products it takes.
    pub(super) after: Vec<usize>,
    /// Files and folders that others take from it.
    pub(super) products: Vec<PathBuf>,
}

/// Treatment of an unfinished or outdated result of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Restart {
    /// The step starts over.
    Anew,
    /// `--resume` continues an unfinished result if this file is there.
    Resume(&'static str),
    /// The command resumes by itself; what is outdated is removed before.
    Itself,
}

impl PlanStep {
    /// Whether it is of the kind that its name begins with.
    pub(super) fn is_of(&self, kind: &str) -> bool {
        self.name.split('/').next() == Some(kind)
    }

    /// How the command treats an unfinished result.
    pub(super) fn restart(&self) -> Restart {
        match &self.command {
            JobCommand::Ingest(_) | JobCommand::Render(_) | JobCommand::Bake(_) => Restart::Itself,
            JobCommand::Train(_) => Restart::Resume("checkpoints"),
            _ => Restart::Anew,
        }
    }

    /// Whether `--shard` divides its work.
    pub(super) fn divides(&self) -> bool {
        match &self.command {
            JobCommand::Ingest(_) | JobCommand::Render(_) => true,
            // Sweeps in Gaussian space need each other.
            JobCommand::Bake(args) => args.method == MethodArg::Views,
            _ => false,
        }
    }

    /// Removes what an earlier process of a step that resumes by itself has left; the products of
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

    /// The arguments of its command.
    ///
    /// # Errors
    /// If a path is not UTF-8.
    pub(super) fn words(&self) -> Result<Vec<String>> {
        self.command.words()
    }

    /// The command as one would type it.
    ///
    /// # Errors
    /// If a path is not UTF-8.
    pub(crate) fn shown(&self) -> Result<String> {
        Ok(command_line::shown(&self.words()?))
    }
}

/// Lets a command replace an earlier result.
pub(super) fn set_force(command: &mut JobCommand) {
    let force = match command {
        JobCommand::Masks(args) => &mut args.force,
        JobCommand::Ingest(args) => &mut args.force,
        JobCommand::Normals(args) => &mut args.force,
        JobCommand::Train(args) => &mut args.force,
        JobCommand::Edit(args) => &mut args.force,
        JobCommand::Render(args) => &mut args.force,
        JobCommand::Bake(args) => &mut args.force,
        JobCommand::Synth(args) => &mut args.force,
        JobCommand::Report(args) => &mut args.force,
        JobCommand::Colmap(ColmapArgs { command }) => match command {
            ColmapCommand::Run(args) => &mut args.force,
            ColmapCommand::Import(args) => &mut args.force,
        },
        JobCommand::Eval(EvalArgs {
            command: Some(EvalCommand::Table(args)),
            ..
        }) => &mut args.force,
        JobCommand::Eval(args) => &mut args.force,
        JobCommand::Dataset(_)
        | JobCommand::Export(_)
        | JobCommand::View(_)
        | JobCommand::Import(_)
        | JobCommand::Lamps(_) => return,
    };
    *force = true;
}

/// Lets a command do a part of its work.
pub(super) fn set_shard(command: &mut JobCommand, shard: Option<Shard>) {
    match command {
        JobCommand::Ingest(args) => args.shard = shard,
        JobCommand::Render(args) => args.shard = shard,
        JobCommand::Bake(args) => args.shard = shard,
        _ => {}
    }
}
