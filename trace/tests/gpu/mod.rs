//! The device that tests share.

use eagpt_trace::DeviceSelector;
use eagpt_trace::gpu::{Device, GpuError};
use std::sync::{Arc, OnceLock};

/// A GPU, a software adapter included; `None`, with a line that names `what`, where
/// there is none.
pub(crate) fn device(what: &str) -> Option<Arc<Device>> {
    static DEVICE: OnceLock<Result<Arc<Device>, GpuError>> = OnceLock::new();
    let opened = DEVICE.get_or_init(|| Device::open(&DeviceSelector::Gpu));
    eagpt_testkit::opened_device(what, opened.as_ref()).map(Arc::clone)
}
