//! Processes that decode photographs for others of this program: a damaged file may end them.

use anyhow::{Context, Result};
use eagpt_ingest::{Decoding, serve_decoding};
use std::process::ExitCode;

/// The command, which people need not know.
pub(crate) const NAME: &str = "decode-photographs";

/// Decoding in processes of this program.
///
/// # Errors
/// If the system does not say where the program is.
pub(crate) fn in_processes() -> Result<Decoding> {
    let program = std::env::current_exe().context("path of this program")?;
    Ok(Decoding::by_program(program, vec![NAME.into()]))
}

/// Decodes until standard input ends.
///
/// # Errors
/// If standard input or output fail.
pub(crate) fn run() -> Result<ExitCode> {
    serve_decoding().context("pipes of a process that decodes")?;
    Ok(ExitCode::SUCCESS)
}
