//! The device that tests share.

use eagpt_trace::gpu::{Device, GpuError, Wanted};
use std::sync::{Arc, OnceLock};

/// Set to 1 where tests must not be skipped for want of a device.
const REQUIRE: &str = "EAGPT_REQUIRE_GPU";

/// Any device, a program on the processor included; `None`, with a line that names `what`, where there is none.
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
pub(crate) fn device(what: &str) -> Option<Arc<Device>> {
    static DEVICE: OnceLock<Result<Arc<Device>, GpuError>> = OnceLock::new();
    match DEVICE.get_or_init(|| Device::open(&Wanted::Any)) {
        Ok(device) => Some(Arc::clone(device)),
        Err(error) => {
            let is_required = std::env::var(REQUIRE).is_ok_and(|value| value == "1");
            assert!(!is_required, "{what}: {error}, and {REQUIRE} is set");
            eprintln!("skipped: {what}: no adapter (Debian: apt-get install mesa-vulkan-drivers)");
            None
        }
    }
}
