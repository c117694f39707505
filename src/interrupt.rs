//! Ctrl-C: the first asks a job to stop with its work on disk, the second ends the program.

use crate::terminal;
use anyhow::{Context, Result};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// Exit code of a run stopped by Ctrl-C: 128 and the number of the signal, as shells have it.
const EXIT_INTERRUPTED: u8 = 130;

/// The exit code of a job that was asked to stop.
pub(crate) fn exit_code() -> ExitCode {
    ExitCode::from(EXIT_INTERRUPTED)
}

/// The flag that the first Ctrl-C sets, one for the whole program: from the first call on, Ctrl-C
/// no longer ends it at once.
///
/// # Errors
/// If the system takes no handler.
pub(crate) fn stop_flag() -> Result<Arc<AtomicBool>> {
    stop_flag_with("stopping after this step; Ctrl-C again stops at once")
}

/// As [`stop_flag`], where what stops is no step: the first Ctrl-C prints `line`. Of several calls
/// the first decides.
///
/// # Errors
/// If the system takes no handler.
pub(crate) fn stop_flag_with(line: &'static str) -> Result<Arc<AtomicBool>> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(Arc::clone(flag));
    }
    let stop = Arc::clone(FLAG.get_or_init(Arc::default));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(EXIT_INTERRUPTED));
        }
        terminal::line(line);
    })
    .context("Ctrl-C handler")?;
    Ok(stop)
}
