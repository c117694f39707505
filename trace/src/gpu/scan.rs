//! Exclusive prefix sums on the device.

use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels;
use super::layout::{Layout, layout};

/// Invocations of a workgroup.
pub(super) const THREADS: u32 = 256;
/// Values of an invocation.
pub(super) const PER_THREAD: u32 = 8;
/// Values of a workgroup.
pub(super) const BLOCK: u32 = THREADS * PER_THREAD;

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct ScanParameters {
    num_values: u32,
}

impl ScanParameters {
    pub(super) fn layout() -> Layout {
        layout!(ScanParameters { num_values: "u32" })
    }
}

/// Replaces the first `num_values` of `values` (32-bit counts) by the sums of those before them.
/// Where these exceed 32 bits, the sum before a last value of 0 is the largest number there is, and
/// others are worth nothing.
pub(super) fn scan(
    device: &Device,
    values: &wgpu::Buffer,
    num_values: u32,
) -> Result<Vec<Pass>, GpuError> {
    let num_blocks = num_values.div_ceil(BLOCK);
    let parameters = device.uniform("scan", &ScanParameters { num_values });
    let sums = device.buffer("sums of blocks", 4 * u64::from(num_blocks))?;
    let buffers = [&parameters, values, &sums];
    let mut passes = vec![device.pass(&kernels::SCAN_BLOCKS, &buffers, num_blocks)];
    if num_blocks > 1 {
        passes.extend(scan(device, &sums, num_blocks)?);
        passes.push(device.pass(&kernels::SCAN_ADD, &buffers, num_blocks));
    }
    Ok(passes)
}
