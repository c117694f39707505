//! Failpoints: a test stops the program where it says, as a power cut would.
//!
//! `EAGPT_FAILPOINT=NAME=N` ends the process, with nothing cleaned up, when the task NAME of the
//! progress bar advances for the N-th time. Only builds with debug assertions read it.

/// Passes the failpoint of the task `name`.
#[cfg(debug_assertions)]
pub(crate) fn pass(name: &str) {
    use crate::terminal;
    use std::sync::LazyLock;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Exit code by which tests know that the failpoint was reached.
    const EXIT_CODE: i32 = 86;
    static CHOSEN: LazyLock<Option<(String, u64)>> = LazyLock::new(|| {
        let text = std::env::var("EAGPT_FAILPOINT").ok()?;
        let (name, num) = text.rsplit_once('=')?;
        Some((name.to_owned(), num.parse().ok()?))
    });
    static PASSED: AtomicU64 = AtomicU64::new(0);

    let Some((chosen, num)) = &*CHOSEN else {
        return;
    };
    if chosen == name && PASSED.fetch_add(1, Ordering::Relaxed) + 1 == *num {
        terminal::line(&format!("failpoint {name}={num}"));
        std::process::exit(EXIT_CODE);
    }
}

#[cfg(not(debug_assertions))]
pub(crate) fn pass(_: &str) {}
