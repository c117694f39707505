//! The few numbers that the host reads after a step.

use eagpt_trace::gpu::FrameRoom;

/// Words of a report.
pub(super) const NUM_WORDS: usize = 16;
/// Place of the first Gaussian whose gradient is not finite.
pub(super) const BAD: u32 = 0;
/// Place of the number of entries in the lists of tiles.
pub(super) const ENTRIES: u32 = 1;
/// Place of the number of chunks in the record of hits.
pub(super) const CHUNKS: u32 = 2;
/// Place of the first of eight features over pixels, see [`Report::terms`].
pub(super) const TERMS: u32 = 4;
/// Place of what is not 0 once a step has moved nothing; unlike all else, it stays for the steps
/// behind that one.
pub(super) const STUCK: u32 = NUM_WORDS as u32 - 1;
/// In the place of [`BAD`]: all gradients are finite.
pub(super) const NOTHING_BAD: u32 = u32::MAX;

/// What the first step begins with; others leave the last word as it is.
pub(super) const EMPTY: [u32; NUM_WORDS] = {
    let mut words = [0; NUM_WORDS];
    words[BAD as usize] = NOTHING_BAD;
    words
};

/// What a step has found out.
#[derive(Debug)]
pub(super) struct Report(pub(super) [u32; NUM_WORDS]);

impl Report {
    /// The first Gaussian whose gradient is not finite.
    pub(super) fn first_bad(&self) -> Option<usize> {
        let index = self.0[BAD as usize];
        (index != NOTHING_BAD).then_some(index as usize)
    }

    /// Room that the rays needed.
    pub(super) fn needed(&self) -> FrameRoom {
        FrameRoom {
            entries: self.0[ENTRIES as usize],
            chunks: self.0[CHUNKS as usize],
        }
    }

    /// Features over pixels: |difference| of PQ values, SSIM, |E − M|, |A − A_gt|; 1 − Ñ·N and its
    /// pixels; 1 − Ñ_d·N and its pixels.
    pub(super) fn terms(&self) -> [f64; 8] {
        std::array::from_fn(|k| f64::from(f32::from_bits(self.0[TERMS as usize + k])))
    }
}
