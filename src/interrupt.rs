//! Ctrl-C: the first asks a job to stop with its work on disk, the second ends the program.

use crate::terminal;
use anyhow::{Context, Result};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a run stopped by Ctrl-C: 128 and the number of the signal, as shells have it.
const EXIT_INTERRUPTED: u8 = 130;

/// The exit code of a job that was asked to stop.
pub(crate) fn exit_code() -> ExitCode {
    ExitCode::from(EXIT_INTERRUPTED)
}

/// A flag that the first Ctrl-C sets.
///
/// # Errors
/// If the system takes no handler.
pub(crate) fn stop_flag() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(EXIT_INTERRUPTED));
        }
        terminal::line("stopping after this step; Ctrl-C again stops at once");
    })
    .context("Ctrl-C handler")?;
    Ok(stop)
}
