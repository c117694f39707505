//! Lanes of a vector that a comparison has marked.

/// Lanes of a [`Lanes`].
const NUM: usize = 8;

/// Some of the lanes, in order. Bytes rather than bits: compilers turn eight comparisons into eight
/// bytes at once, but not into a mask.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes(u64);

impl Lanes {
    /// The lanes that hold 1 rather than 0.
    #[inline(always)]
    pub(super) fn new(marked: [u8; NUM]) -> Self {
        Self(u64::from_le_bytes(marked))
    }
}

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize / 8;
        self.0 &= self.0 - 1;
        Some(lane % NUM)
    }
}

/// Calls `each` with those of sixteen lanes whose byte is 1 rather than 0, in order.
#[inline(always)]
pub(super) fn for_each_lane(marked: u128, mut each: impl FnMut(usize)) {
    for (first, half) in [(0, marked as u64), (NUM, (marked >> 64) as u64)] {
        for lane in Lanes(half) {
            each(first + lane);
        }
    }
}
