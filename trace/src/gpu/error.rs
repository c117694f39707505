//! Failures of devices.

use crate::error::TraceError;

/// Why a device could not do its work. Each message is one line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No device is the one that was asked for.
    #[error("device {wanted}: not found; there is {found}")]
    NotFound {
        /// The device that was asked for.
        wanted: String,
        /// Names of the devices there are.
        found: String,
    },
    /// The driver refuses to open the device.
    #[error("device {device}: cannot be opened: {problem}")]
    Open {
        /// Name of the device.
        device: String,
        /// Message of the driver.
        problem: String,
    },
    /// The device has no more memory.
    #[error("device {device}: out of memory: {problem}")]
    OutOfMemory {
        /// Name of the device.
        device: String,
        /// The work that failed.
        problem: String,
    },
    /// The device is gone: unplugged, reset by its driver, or stopped because a kernel took too
    /// long.
    #[error("device {device}: lost: {problem}")]
    Lost {
        /// Name of the device.
        device: String,
        /// Message of the driver.
        problem: String,
    },
    /// The work is larger than what the device can address.
    #[error("device {device}: {what}: {needed} bytes, and one buffer holds at most {limit}")]
    Limit {
        /// Name of the device.
        device: String,
        /// The thing that does not fit.
        what: String,
        /// Bytes that are needed.
        needed: u64,
        /// Bytes there may be.
        limit: u64,
    },
    /// The image has more pixels than kernels count.
    #[error(
        "device {device}: image of {width}×{height} pixels: no side may have more than {limit}"
    )]
    Image {
        /// Name of the device.
        device: String,
        /// Pixels of a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels that a side may have.
        limit: u32,
    },
    /// Single rays of a scene whose Gaussians were moved by kernels of the caller.
    #[error("device {device}: the Gaussians were moved on the device and not updated since")]
    Moved {
        /// Name of the device.
        device: String,
    },
    /// The driver or wgpu rejects a kernel or how it is called: a defect of this program or of the
    /// driver.
    #[error("device {device}: kernel rejected: {problem}")]
    Rejected {
        /// Name of the device.
        device: String,
        /// The message.
        problem: String,
    },
}

impl GpuError {
    fn device(&self) -> &str {
        match self {
            Self::NotFound { wanted, .. } => wanted,
            Self::Open { device, .. }
            | Self::OutOfMemory { device, .. }
            | Self::Lost { device, .. }
            | Self::Limit { device, .. }
            | Self::Image { device, .. }
            | Self::Moved { device }
            | Self::Rejected { device, .. } => device,
        }
    }
}

impl From<GpuError> for TraceError {
    fn from(error: GpuError) -> Self {
        let device = error.device().to_owned();
        let message = error.to_string();
        let problem = message
            .strip_prefix(&format!("device {device}: "))
            .unwrap_or(&message)
            .to_owned();
        Self::Device { device, problem }
    }
}

/// Messages of drivers have many lines.
pub(super) fn one_line(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_engines_say_the_same() {
        let error = GpuError::Limit {
            device: "Card".to_owned(),
            what: "attributes".to_owned(),
            needed: 200,
            limit: 128,
        };
        let said = error.to_string();
        assert_eq!(TraceError::from(error).to_string(), said);
        assert_eq!(one_line("a\n  b\tc\n"), "a b c");
    }
}
