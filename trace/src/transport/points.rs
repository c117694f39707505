//! Points of the unit hypercube at which light is sampled.
//!
//! Four numbers at a time ("a block"), for each bounce its own blocks. Within a block the samples
//! of a pixel are an Owen-scrambled Sobol sequence (Burley 2020, "Practical Hash-based Owen
//! Scrambling"): spread evenly, with less noise than independent numbers. Different blocks and
//! different pixels have independent scrambles and orders, so every sample alone is uniform and
//! every mean stays what it was.

use eagpt_scene::rng::RandomKey;

/// Length of a scrambled sequence; longer runs begin another one.
const SEQUENCE_BITS: u32 = 16;

/// The sample points of one element (pixel, Gaussian, …).
#[derive(Debug, Clone, Copy)]
pub struct Points {
    key: RandomKey,
    element: u32,
}

impl Points {
    /// The points of `element` among those of `key`.
    pub fn new(key: RandomKey, element: u32) -> Self {
        Self { key, element }
    }

    /// Four numbers in [0, 1) of `sample`; `block` counts fours.
    #[inline]
    pub fn block(&self, sample: u32, block: u32) -> [f32; 4] {
        let sequence = sample >> SEQUENCE_BITS;
        // The stream is keyed by blocks and sequences: no two share a scramble.
        let [seed, ..] = self
            .key
            .stream(self.element, block ^ (sequence << SEQUENCE_BITS))
            .next_words();
        sobol_burley::sample_4d(sample & ((1 << SEQUENCE_BITS) - 1), 0, seed)
    }

    /// A word for choices that need no stratification, one for each `sample`.
    pub fn word(&self, sample: u32) -> u32 {
        // Block numbers are small: the complement is none of theirs.
        let [word, ..] = self.key.stream(self.element, !sample).next_words();
        word
    }
}

/// Points of elements in a row, each with as many samples: neighbours take the next points of one
/// sequence (Ahmed and Wonka 2020, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error
/// via Hierarchical Ordering of Pixels"). What one has too many of its neighbours have too few of,
/// so that the mean over neighbours has less noise than that of independent points. Elements that
/// are neighbours in space should be neighbours in number, as on a Z-order curve.
#[derive(Debug, Clone, Copy)]
pub struct RowPoints {
    points: Points,
    /// Number of its first sample in the sequence.
    first: u32,
}

impl RowPoints {
    /// The points of `element` among those of `key`, of elements that take `num` samples.
    pub fn new(key: RandomKey, element: u32, num: u32) -> Self {
        let sharing = ((1 << SEQUENCE_BITS) / num.max(1)).max(1);
        Self {
            points: Points::new(key, element / sharing),
            first: element % sharing * num,
        }
    }

    /// As [`Points::block`].
    #[inline]
    pub fn block(&self, sample: u32, block: u32) -> [f32; 4] {
        self.points.block(self.first + sample, block)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::Purpose;

    fn points(element: u32) -> Points {
        Points::new(RandomKey::new(1, Purpose::Render, 0), element)
    }

    /// 256 points of a Sobol sequence put exactly one into each of 256 equal slices of every axis,
    /// and one into each cell of a 16×16 grid of the first two axes.
    #[test]
    fn a_block_is_stratified() {
        let all: Vec<[f32; 4]> = (0..256).map(|s| points(3).block(s, 5)).collect();
        for axis in 0..4 {
            let mut slices: Vec<u32> = all.iter().map(|p| (p[axis] * 256.0) as u32).collect();
            slices.sort_unstable();
            assert!(slices.iter().copied().eq(0..256), "axis {axis}");
        }
        let mut cells: Vec<u32> = all
            .iter()
            .map(|p| (p[0] * 16.0) as u32 * 16 + (p[1] * 16.0) as u32)
            .collect();
        cells.sort_unstable();
        assert!(cells.iter().copied().eq(0..256));
    }

    /// 16 samples of one element, and all of 64 in a row, are as evenly spread as so many points of
    /// one sequence.
    #[test]
    fn neighbours_in_a_row_share_a_sequence() {
        let key = RandomKey::new(1, Purpose::Bake, 0);
        let of = |element: u32| (0..16).map(move |s| RowPoints::new(key, element, 16).block(s, 1));
        let is_spread = |points: Vec<[f32; 4]>| {
            (0..4).all(|axis| {
                let num = points.len() as u32;
                let mut slices: Vec<u32> = points
                    .iter()
                    .map(|p| (p[axis] * num as f32) as u32)
                    .collect();
                slices.sort_unstable();
                slices.into_iter().eq(0..num)
            })
        };
        assert!((0..200).all(|element| is_spread(of(element).collect())));
        assert!(is_spread((64..128).flat_map(of).collect()));
        // The next sequence begins where the first has no room for a whole element.
        let last = RowPoints::new(key, (1 << SEQUENCE_BITS) / 24 - 1, 24);
        let next = RowPoints::new(key, (1 << SEQUENCE_BITS) / 24, 24);
        assert!(last.first + 24 <= 1 << SEQUENCE_BITS);
        assert_eq!((next.first, next.points.element), (0, 1));
    }

    /// Pearson correlation between blocks, pixels and sequences.
    #[test]
    fn blocks_pixels_and_sequences_are_independent() {
        let far = 1 << SEQUENCE_BITS;
        let series = |element: u32, first: u32, block: u32| -> Vec<f64> {
            (0..1024)
                .map(|s| f64::from(points(element).block(first + s, block)[0]))
                .collect()
        };
        let base = series(0, 0, 0);
        for other in [series(0, 0, 1), series(1, 0, 0), series(0, far, 0)] {
            let covariance = base
                .iter()
                .zip(&other)
                .map(|(a, b)| (a - 0.5) * (b - 0.5))
                .sum::<f64>()
                / 1024.0;
            // Standard error of the correlation of 1,024 independent pairs: 0.03.
            let correlation = 12.0 * covariance;
            assert!(correlation.abs() < 0.12, "{correlation}");
        }
    }

    /// Each sample alone is uniform over pixels, the first one, too.
    #[test]
    fn single_samples_are_uniform() {
        for sample in [0, 1, 7] {
            let mut counts = [0_u32; 16];
            for element in 0..16_000 {
                counts[(points(element).block(sample, 0)[1] * 16.0) as usize] += 1;
            }
            let chi2: f64 = counts
                .iter()
                .map(|&c| (f64::from(c) - 1000.0).powi(2) / 1000.0)
                .sum();
            // 15 degrees of freedom: the bound has a probability of 1e-4.
            assert!(chi2 < 44.3, "{chi2} for sample {sample}");
        }
    }
}
