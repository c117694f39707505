//! `eagpt colmap`: camera poses by COLMAP.

mod import;
mod run;

use crate::args::GlobalArgs;
use anyhow::Result;
use clap::{Args, Subcommand};
pub(crate) use import::ImportArgs;
pub(crate) use run::RunArgs;
use serde::Serialize;
use std::process::ExitCode;

/// Camera poses: run COLMAP, or turn a model of it into a dataset
#[derive(Debug, Clone, Args, Serialize)]
pub(crate) struct ColmapArgs {
    #[command(subcommand)]
    pub(crate) command: ColmapCommand,
}

#[derive(Debug, Clone, Subcommand, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ColmapCommand {
    Run(RunArgs),
    Import(ImportArgs),
}

pub(crate) fn run(args: &ColmapArgs, global: &GlobalArgs) -> Result<ExitCode> {
    match &args.command {
        ColmapCommand::Run(args) => run::run(args, global),
        ColmapCommand::Import(args) => import::run(args, global),
    }
}
