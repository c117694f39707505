//! Exclusive prefix sums on the device.

use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels;
use super::layout::{Layout, layout};

/// Invocations of a workgroup.
pub(super) const THREADS: u32 = 256;
/// Values of an invocation.
pub(super) const PER_THREAD: u32 = 8;
/// Values that a workgroup adds up at a time.
pub(super) const BLOCK: u32 = THREADS * PER_THREAD;
/// Blocks that one workgroup adds up one after the other, where there are no more: that takes less
/// than two further dispatches.
const BLOCKS_OF_ONE: u32 = 8;

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct ScanParameters {
    num_values: u32,
    /// Values of a workgroup, whole blocks.
    num_of_group: u32,
}

impl ScanParameters {
    pub(super) fn layout() -> Layout {
        layout!(ScanParameters {
            num_values: "u32",
            num_of_group: "u32",
        })
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
    let num_of_group = match num_values.div_ceil(BLOCK) {
        num_blocks @ 1..=BLOCKS_OF_ONE => num_blocks * BLOCK,
        _ => BLOCK,
    };
    let num_groups = num_values.div_ceil(num_of_group);
    let parameters = ScanParameters {
        num_values,
        num_of_group,
    };
    let parameters = device.uniform("scan", &parameters);
    let sums = device.buffer("sums of workgroups", 4 * u64::from(num_groups))?;
    let buffers = [&parameters, values, &sums];
    let mut passes = vec![device.pass(&kernels::SCAN_BLOCKS, &buffers, num_groups)];
    if num_groups > 1 {
        passes.extend(scan(device, &sums, num_groups)?);
        let num_blocks = num_values.div_ceil(BLOCK);
        passes.push(device.pass(&kernels::SCAN_ADD, &buffers, num_blocks));
    }
    Ok(passes)
}
