//! Prefix sums and sorts: structures and constants that their kernels share with Rust.

use crate::gpu::layout::{Layout, layout};

/// Invocations of a workgroup of a prefix sum.
pub(in crate::gpu) const SCAN_THREADS: u32 = 256;
/// Values of an invocation.
pub(in crate::gpu) const SCAN_PER_THREAD: u32 = 8;
/// Values that a workgroup adds up at a time.
pub(in crate::gpu) const SCAN_BLOCK: u32 = SCAN_THREADS * SCAN_PER_THREAD;

/// Parameters of the kernels of prefix sums.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct ScanParameters {
    pub(in crate::gpu) num_values: u32,
    /// Values of a workgroup, whole blocks.
    pub(in crate::gpu) num_of_group: u32,
}

impl ScanParameters {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(ScanParameters {
            num_values: "u32",
            num_of_group: "u32",
        })
    }
}

/// Invocations of a workgroup of a sort.
pub(in crate::gpu) const SORT_THREADS: u32 = 64;
/// Elements of an invocation.
pub(in crate::gpu) const SORT_PER_THREAD: u32 = 16;
/// Elements of a workgroup.
pub(in crate::gpu) const SORT_BLOCK: u32 = SORT_THREADS * SORT_PER_THREAD;
/// Bits of a key that one pass sorts by: a dispatch takes as long as sorting some 100,000 elements
/// by more of them.
pub(in crate::gpu) const SORT_DIGIT_BITS: u32 = 6;
/// Values of those.
pub(in crate::gpu) const SORT_DIGITS: u32 = 1 << SORT_DIGIT_BITS;
/// Words of the counters of two digits, 16 bits each: one for each invocation, and one more, so
/// that rows begin in different banks of memory.
pub(in crate::gpu) const SORT_ROW: u32 = SORT_THREADS + 1;
/// Words of all counters.
pub(in crate::gpu) const SORT_COUNTERS: u32 = SORT_DIGITS / 2 * SORT_ROW;

// No counter overflows, and they fit into what a workgroup is guaranteed.
const _: () =
    assert!(SORT_BLOCK < 1 << 16 && 4 * SORT_COUNTERS <= 16 << 10 && SORT_DIGITS <= SORT_THREADS);

/// Parameters of the kernels of sorts.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(in crate::gpu) struct SortParameters {
    pub(in crate::gpu) shift: u32,
    pub(in crate::gpu) num_blocks: u32,
    pub(in crate::gpu) capacity: u32,
    pub(in crate::gpu) count: u32,
}

impl SortParameters {
    pub(in crate::gpu) fn layout() -> Layout {
        layout!(SortParameters {
            shift: "u32",
            num_blocks: "u32",
            capacity: "u32",
            count: "u32",
        })
    }
}
