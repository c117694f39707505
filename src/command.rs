//! The commands that do one job each. `eagpt run` chains them.

use crate::args::GlobalArgs;
use crate::command_line;
use crate::{
    bake, colmap, dataset, edit, eval, export, import, ingest, lamps, masks, normals, render,
    report, synth, train, view,
};
use anyhow::Result;
use clap::Subcommand;
use serde::Serialize;
use std::process::ExitCode;

/// A command that does one job.
#[derive(Debug, Clone, Subcommand, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum JobCommand {
    Report(report::ReportArgs),
    Masks(masks::MasksArgs),
    Colmap(colmap::ColmapArgs),
    Ingest(ingest::IngestArgs),
    // No step of a project.
    #[serde(skip)]
    Dataset(dataset::DatasetArgs),
    Normals(normals::NormalsArgs),
    Train(train::TrainArgs),
    #[serde(skip)]
    Lamps(lamps::LampsArgs),
    Edit(edit::EditArgs),
    Render(render::RenderArgs),
    Bake(bake::BakeArgs),
    Eval(eval::EvalArgs),
    #[serde(skip)]
    Export(export::ExportArgs),
    #[serde(skip)]
    View(view::ViewArgs),
    #[serde(skip)]
    Import(import::ImportArgs),
    Synth(synth::SynthArgs),
}

impl JobCommand {
    /// All of them, as subcommands of the program.
    pub(crate) fn program() -> clap::Command {
        Self::augment_subcommands(clap::Command::new("eagpt"))
    }

    /// Its arguments as one would type them, its name first.
    ///
    /// # Errors
    /// If a path is not UTF-8.
    pub(crate) fn words(&self) -> Result<Vec<String>> {
        command_line::words(&Self::program(), self)
    }

    /// Runs the job.
    ///
    /// # Errors
    /// The job's.
    pub(crate) fn run(&self, global: &GlobalArgs) -> Result<ExitCode> {
        match self {
            Self::Report(args) => report::run(args, global),
            Self::Masks(args) => masks::run(args, global),
            Self::Colmap(args) => colmap::run(args, global),
            Self::Ingest(args) => ingest::run(args, global),
            Self::Dataset(args) => dataset::run(args, global),
            Self::Normals(args) => normals::run(args, global),
            Self::Train(args) => train::run(args, global),
            Self::Lamps(args) => lamps::run(args, global),
            Self::Edit(args) => edit::run(args, global),
            Self::Render(args) => render::run(args, global),
            Self::Bake(args) => bake::run(args, global),
            Self::Eval(args) => eval::run(args, global),
            Self::Export(args) => export::run(args, global),
            Self::View(args) => view::run(args, global),
            Self::Import(args) => import::run(args, global),
            Self::Synth(args) => synth::run(args, global),
        }
    }
}
