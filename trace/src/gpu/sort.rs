//! A stable radix sort on the device.

use super::device::{Device, Pass};
use super::error::GpuError;
use super::kernels;
use super::layout::{Layout, layout};
use super::scan::scan;

/// Invocations of a workgroup.
pub(super) const THREADS: u32 = 64;
/// Elements of an invocation.
pub(super) const PER_THREAD: u32 = 16;
/// Elements of a workgroup.
pub(super) const BLOCK: u32 = THREADS * PER_THREAD;
/// Bits of a key that one pass sorts by: a dispatch takes as long as sorting some 100,000 elements
/// by more of them.
const DIGIT_BITS: u32 = 6;
/// Values of those.
pub(super) const DIGITS: u32 = 1 << DIGIT_BITS;
/// Words of the counters of two digits, 16 bits each: one for each invocation, and one more, so
/// that rows begin in different banks of memory.
pub(super) const ROW: u32 = THREADS + 1;
/// Words of all counters.
pub(super) const COUNTERS: u32 = DIGITS / 2 * ROW;

// No counter overflows, and they fit into what a workgroup is guaranteed.
const _: () = assert!(BLOCK < 1 << 16 && 4 * COUNTERS <= 16 << 10 && DIGITS <= THREADS);

/// Parameters of the kernels.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct SortParameters {
    shift: u32,
    num_blocks: u32,
    capacity: u32,
    count: u32,
}

impl SortParameters {
    pub(super) fn layout() -> Layout {
        layout!(SortParameters {
            shift: "u32",
            num_blocks: "u32",
            capacity: "u32",
            count: "u32",
        })
    }
}

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
        let num_blocks = capacity.div_ceil(BLOCK);
        let num_places = DIGITS * num_blocks;
        let places = device.buffer("sort places", 4 * u64::from(num_places))?;
        let add_up = scan(device, &places, num_places)?;
        let mut passes = Vec::new();
        let num_passes = num_bits.div_ceil(DIGIT_BITS);
        for pass in 0..num_passes {
            let (from, to) = (pass as usize % 2, (pass as usize + 1) % 2);
            let parameters = device.uniform(
                "sort",
                &SortParameters {
                    shift: pass * DIGIT_BITS,
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
