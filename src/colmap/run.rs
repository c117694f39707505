//! `eagpt colmap run`: drives an installed COLMAP.

use crate::cli::GlobalArgs;
use anyhow::{Result, bail};
use clap::Args;
use std::process::ExitCode;

/// Run COLMAP on a folder of images
#[derive(Debug, Args)]
pub(crate) struct RunArgs {}

pub(super) fn run(_args: &RunArgs, _global: &GlobalArgs) -> Result<ExitCode> {
    bail!("soon")
}
