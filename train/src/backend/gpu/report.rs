//! The few numbers that the host reads after a step.

use eagpt_trace::gpu::Counters;
use std::mem::offset_of;

/// The results of a step that the host reads; words to kernels.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Report {
    /// The first Gaussian whose gradient is not finite, or [`NOTHING_BAD`].
    first_bad: u32,
    /// Needs of the rays.
    pub(super) needed: Counters,
    terms: [f32; NUM_TERMS],
}

/// In place of a Gaussian: all gradients are finite.
const NOTHING_BAD: u32 = u32::MAX;

/// Sums over pixels: |difference| of PQ values, SSIM, |E − M|, |A − A_gt|; 1 − Ñ·N and its pixels;
/// 1 − Ñ_d·N and its pixels; |D̃ − d| / d.
const NUM_TERMS: usize = 9;

/// Places of the words of a report, and constants.
pub(super) const PLACES: [(&str, u32); 6] = {
    const fn word(offset: usize) -> u32 {
        (offset / size_of::<u32>()) as u32
    }
    let terms = word(offset_of!(Report, terms));
    [
        ("REPORT_BAD", word(offset_of!(Report, first_bad))),
        ("REPORT_NEEDED", word(offset_of!(Report, needed))),
        ("REPORT_TERMS", terms),
        // Of the pixels that the two terms of normals are means over.
        ("REPORT_NUM_MAP", terms + 5),
        ("REPORT_NUM_SPANNED", terms + 7),
        ("NOTHING_BAD", NOTHING_BAD),
    ]
};

impl Report {
    /// Before a step.
    pub(super) const EMPTY: Self = Self {
        first_bad: NOTHING_BAD,
        needed: Counters {
            num_gaussians: 0,
            entries: 0,
            chunks: 0,
            failed: 0,
        },
        terms: [0.0; NUM_TERMS],
    };

    /// The first Gaussian whose gradient is not finite.
    pub(super) fn first_bad(&self) -> Option<usize> {
        (self.first_bad != NOTHING_BAD).then_some(self.first_bad as usize)
    }

    /// Sums over pixels, in the order of [`NUM_TERMS`].
    pub(super) fn terms(&self) -> [f64; NUM_TERMS] {
        self.terms.map(f64::from)
    }
}
