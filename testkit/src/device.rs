//! Devices of tests.

use std::fmt::Display;
use std::io::Write;

/// Set to 1 where tests must not be skipped for want of a device.
const REQUIRE: &str = "EAGPT_REQUIRE_GPU";

/// The device that was opened, or `None` after saying on standard error that `test` is skipped.
///
/// # Panics
/// If there is none and `EAGPT_REQUIRE_GPU` is 1.
pub fn opened_device<D, E: Display>(test: &str, opened: Result<D, E>) -> Option<D> {
    let error = match opened {
        Ok(device) => return Some(device),
        Err(error) => error,
    };
    let is_required = std::env::var(REQUIRE).is_ok_and(|value| value == "1");
    assert!(!is_required, "{test}: {error}, and {REQUIRE} is set");
    // Straight to the stream: what `eprintln!` writes is hidden unless the test fails.
    let notice =
        format!("skipped: {test}: no adapter (Debian: apt-get install mesa-vulkan-drivers)\n");
    std::io::stderr()
        .write_all(notice.as_bytes())
        .expect("the error stream takes a line");
    None
}
