//! An allocator with a limit, for processes that decode files which may be damaged.

#![allow(
    unsafe_code,
    reason = "an allocator is an unsafe trait; each call is passed on to the system's"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering};

/// Most bytes that may be allocated at a time; 0: as many as there are.
static LIMIT: AtomicIsize = AtomicIsize::new(0);
/// Bytes allocated since there is a limit. What was allocated before and is freed since makes it
/// smaller, by little.
static USED: AtomicIsize = AtomicIsize::new(0);

/// Limits what this process allocates through [`LimitedAllocator`], from now on.
pub(crate) fn limit(num_bytes: usize) {
    LIMIT.store(num_bytes.cast_signed().max(1), Ordering::Relaxed);
}

/// The system's allocator, with a limit of memory once [`crate::serve_decoding`] sets one: an
/// allocation beyond it fails, which ends a process unless its code expects that.
///
/// For a program that calls [`crate::serve_decoding`], as its `#[global_allocator]`. Before that,
/// it costs the reading of one number.
#[derive(Debug, Clone, Copy, Default)]
pub struct LimitedAllocator;

/// Counts `num_bytes` more; whether they are within the limit.
fn take(num_bytes: usize) -> bool {
    let limit = LIMIT.load(Ordering::Relaxed);
    if limit == 0 {
        return true;
    }
    // A layout has at most `isize::MAX` bytes.
    let num_bytes = num_bytes.cast_signed();
    let used = USED.fetch_add(num_bytes, Ordering::Relaxed);
    let fits = used.saturating_add(num_bytes) <= limit;
    if !fits {
        USED.fetch_sub(num_bytes, Ordering::Relaxed);
    }
    fits
}

fn give_back(num_bytes: usize) {
    if LIMIT.load(Ordering::Relaxed) != 0 {
        USED.fetch_sub(num_bytes.cast_signed(), Ordering::Relaxed);
    }
}

// SAFETY: every block comes from `System` and goes back to it with the layout it was made with. A
// null pointer is what the trait has a failed allocation return.
unsafe impl GlobalAlloc for LimitedAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !take(layout.size()) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        give_back(layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        if !take(new_size) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promise.
        let moved = unsafe { System.realloc(block, layout, new_size) };
        // A block that cannot grow stays as it is.
        give_back(if moved.is_null() {
            new_size
        } else {
            layout.size()
        });
        moved
    }
}
