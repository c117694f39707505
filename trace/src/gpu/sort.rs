//! A stable radix sort on the device.

use super::declarations::sort::{SORT_BLOCK, SORT_DIGIT_BITS, SORT_DIGITS, SortParameters};
use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels;
use super::scan::scan;

/// Keys with values, and buffers to sort them into.
#[derive(Debug)]
pub(super) struct Sorter {
    keys: [wgpu::Buffer; 2],
    values: [wgpu::Buffer; 2],
    passes: Vec<Pass>,
    sorted: usize,
}

impl Sorter {
    /// Sorts at most `capacity` pairs by the lower `num_bits` of their keys. Their number is read
    /// from `counts[count]` on the device.
    pub(super) fn new(
        device: &Device,
        capacity: u32,
        num_bits: u32,
        (counts, count): (&wgpu::Buffer, u32),
    ) -> Result<Self, GpuError> {
        let buffer = |what| device.buffer(what, 4 * u64::from(capacity));
        let keys = [buffer("sort keys")?, buffer("sort keys")?];
        let values = [buffer("sort values")?, buffer("sort values")?];
        let num_blocks = capacity.div_ceil(SORT_BLOCK);
        let num_places = SORT_DIGITS * num_blocks;
        let places = device.buffer("sort places", 4 * u64::from(num_places))?;
        let add_up = scan(device, &places, num_places)?;
        let mut passes = Vec::new();
        let num_passes = num_bits.div_ceil(SORT_DIGIT_BITS);
        for pass in 0..num_passes {
            let (from, to) = (pass as usize % 2, (pass as usize + 1) % 2);
            let parameters = device.uniform(
                "sort",
                &SortParameters {
                    shift: pass * SORT_DIGIT_BITS,
                    num_blocks,
                    capacity,
                    count,
                },
            );
            let count_digits = [&parameters, counts, &keys[from], &places];
            passes.push(device.pass(&kernels::SORT_COUNT, &count_digits, num_blocks));
            passes.extend(add_up.iter().cloned());
            let scatter = [
                &parameters,
                counts,
                &keys[from],
                &values[from],
                &places,
                &keys[to],
                &values[to],
            ];
            passes.push(device.pass(&kernels::SORT_SCATTER, &scatter, num_blocks));
        }
        Ok(Self {
            keys,
            values,
            passes,
            sorted: num_passes as usize % 2,
        })
    }

    /// Keys and values before sorting.
    pub(super) fn unsorted(&self) -> (&wgpu::Buffer, &wgpu::Buffer) {
        (&self.keys[0], &self.values[0])
    }

    /// Keys and values after [`Self::passes`].
    pub(super) fn sorted(&self) -> (&wgpu::Buffer, &wgpu::Buffer) {
        (&self.keys[self.sorted], &self.values[self.sorted])
    }

    /// The passes that sort.
    pub(super) fn passes(&self) -> &[Pass] {
        &self.passes
    }
}
