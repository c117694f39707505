//! Failures.

/// Failure of a device. The CPU never fails.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// A device is lost, out of memory or lacks a feature.
    #[error("device {device}: {problem}")]
    Device {
        /// Name of the device.
        device: String,
        /// Description of the failure.
        problem: String,
    },
}
