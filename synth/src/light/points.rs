//! Points of the unit hypercube at which light is sampled: Owen-scrambled Sobol sequences (Burley
//! 2020, "Practical Hash-based Owen Scrambling"), four dimensions at a time, scrambled anew for
//! every element and every four.

use eagpt_scene::rng::RandomKey;

/// Samples of one sequence, at most.
pub(crate) const MAX_SAMPLES: u32 = 1 << 16;

/// The sample points of one element: a pixel, a cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Points {
    key: RandomKey,
    element: u32,
}

impl Points {
    /// The points of `element` among those of `key`.
    pub(crate) fn new(key: RandomKey, element: u32) -> Self {
        Self { key, element }
    }

    /// Four numbers in [0, 1) of `sample`, below [`MAX_SAMPLES`]; `block` counts fours.
    #[inline]
    pub(crate) fn block(&self, sample: u32, block: u32) -> [f32; 4] {
        let [scramble, ..] = self.key.stream(self.element, block).next_words();
        sobol_burley::sample_4d(sample, 0, scramble)
    }
}
