//! Exclusive prefix sums on the device.

use super::declarations::sort::{SCAN_BLOCK, ScanParameters};
use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels;

/// Blocks that one workgroup adds up one after the other, where there are no more: that takes less
/// than two further dispatches.
const BLOCKS_OF_ONE: u32 = 8;

/// Replaces the first `num_values` of `values` (32-bit counts) by the sums of those before them.
/// Where these exceed 32 bits, the sum before a last value of 0 is the largest number there is, and
/// others are worth nothing.
pub(super) fn scan(
    device: &Device,
    values: &wgpu::Buffer,
    num_values: u32,
) -> Result<Vec<Pass>, GpuError> {
    let num_of_group = match num_values.div_ceil(SCAN_BLOCK) {
        num_blocks @ 1..=BLOCKS_OF_ONE => num_blocks * SCAN_BLOCK,
        _ => SCAN_BLOCK,
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
        let num_blocks = num_values.div_ceil(SCAN_BLOCK);
        passes.push(device.pass(&kernels::SCAN_ADD, &buffers, num_blocks));
    }
    Ok(passes)
}
