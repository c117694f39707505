//! `eagpt colmap`: camera poses by COLMAP.

mod import;
mod run;

use crate::args::GlobalArgs;
use anyhow::Result;
use clap::{Args, Subcommand};
use std::process::ExitCode;

/// Camera poses: run COLMAP, or turn a model of it into a dataset
#[derive(Debug, Args)]
pub(crate) struct ColmapArgs {
    #[command(subcommand)]
    command: ColmapCommand,
}

#[derive(Debug, Subcommand)]
enum ColmapCommand {
    Run(run::RunArgs),
    Import(import::ImportArgs),
}

pub(crate) fn run(args: &ColmapArgs, global: &GlobalArgs) -> Result<ExitCode> {
    match &args.command {
        ColmapCommand::Run(args) => run::run(args, global),
        ColmapCommand::Import(args) => import::run(args, global),
    }
}
