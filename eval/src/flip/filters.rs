//! The filters of FLIP, separated into one-dimensional passes.
//!
//! The contrast sensitivity of luminance and of red-green is one Gaussian, that of yellow-blue the sum of two; edges
//! and points are found by the first and second derivative of a Gaussian as wide as a feature.

use std::f64::consts::PI;

/// Width of a feature in degrees.
const FEATURE_WIDTH_DEGREES: f64 = 0.082;
/// a and b of the sensitivity a √(π/b) exp(−π² x²/b), x in degrees: luminance, red-green, and the two of yellow-blue.
const SENSITIVITY: [(f64, f64); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];
/// Outputs kept in registers while the taps are added up.
const LANES: usize = 16;

/// One-dimensional weights, odd in number.
#[derive(Debug, Clone)]
pub(super) struct Filters {
    /// Sensitivities to luminance, red-green and yellow-blue (two, to be added), all of one length.
    pub(super) sensitivity: [Vec<f32>; 4],
    /// Gaussian, edge and point filter, all of one length.
    pub(super) feature: [Vec<f32>; 3],
}

impl Filters {
    /// The filters for so many pixels per degree of vision.
    pub(super) fn new(pixels_per_degree: f32) -> Self {
        let ppd = f64::from(pixels_per_degree);
        Self {
            sensitivity: sensitivity(ppd),
            feature: feature(ppd),
        }
    }

    /// Pixels that the larger filter reaches to each side.
    pub(super) fn radius(&self) -> usize {
        self.sensitivity[0].len().max(self.feature[0].len()) / 2
    }
}

fn taps(radius: usize, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    let radius = radius as i64;
    (-radius..=radius).map(|x| weight(x as f64)).collect()
}

fn scaled(weights: &[f64], factor: f64) -> Vec<f32> {
    weights.iter().map(|w| (w * factor) as f32).collect()
}

fn sensitivity(ppd: f64) -> [Vec<f32>; 4] {
    let widest = SENSITIVITY.iter().fold(0.0, |widest, (_, b)| b.max(widest));
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
    // Of a two-dimensional Gaussian with factor a √(π/b), each pass has the square root.
    let raw = SENSITIVITY.map(|(a, b)| {
        taps(radius, |x| {
            (a * (PI / b).sqrt()).sqrt() * (-PI * PI * (x / ppd).powi(2) / b).exp()
        })
    });
    let sums = raw.each_ref().map(|weights| weights.iter().sum::<f64>());
    // The two of yellow-blue have volume 1 together.
    let both = (sums[2] * sums[2] + sums[3] * sums[3]).sqrt();
    let totals = [sums[0], sums[1], both, both];
    std::array::from_fn(|i| scaled(&raw[i], 1.0 / totals[i]))
}

fn feature(ppd: f64) -> [Vec<f32>; 3] {
    let deviation = 0.5 * FEATURE_WIDTH_DEGREES * ppd;
    let radius = (3.0 * deviation).ceil() as usize;
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let smooth = taps(radius, gaussian);
    let edge = taps(radius, |x| -x * gaussian(x));
    let point = taps(radius, |x| {
        (x * x / (deviation * deviation) - 1.0) * gaussian(x)
    });
    [
        scaled(&smooth, 1.0 / smooth.iter().sum::<f64>()),
        balanced(&edge),
        balanced(&point),
    ]
}

/// Positive weights scaled to add up to 1 and negative ones to −1.
fn balanced(weights: &[f64]) -> Vec<f32> {
    let sum = |sign: f64| weights.iter().map(|w| (w * sign).max(0.0)).sum::<f64>();
    let (positive, negative) = (sum(1.0), sum(-1.0));
    let scale = |w: &f64| w / if *w > 0.0 { positive } else { negative };
    weights.iter().map(|w| scale(w) as f32).collect()
}

/// Filters along x: `out[x]` is the sum of `weights[i] · padded[offset + x + i]`.
pub(super) fn filter_row(padded: &[f32], offset: usize, weights: &[f32], out: &mut [f32]) {
    let row = &padded[offset..][..out.len() + weights.len() - 1];
    weighted_sum(weights, out, |tap| &row[tap..]);
}

/// Filters along y: `out[x]` is the sum of `weights[i] · rows[i][x]`.
pub(super) fn filter_columns(rows: &[&[f32]], weights: &[f32], out: &mut [f32]) {
    weighted_sum(weights, out, |tap| rows[tap]);
}

#[inline(always)]
fn weighted_sum<'a>(weights: &[f32], out: &mut [f32], row: impl Fn(usize) -> &'a [f32]) {
    let mut chunks = out.chunks_exact_mut(LANES);
    let mut start = 0;
    for chunk in &mut chunks {
        let mut sums = [0.0_f32; LANES];
        for (tap, weight) in weights.iter().enumerate() {
            for (sum, value) in sums.iter_mut().zip(&row(tap)[start..start + LANES]) {
                *sum += weight * value;
            }
        }
        chunk.copy_from_slice(&sums);
        start += LANES;
    }
    for (i, out) in chunks.into_remainder().iter_mut().enumerate() {
        let products = weights.iter().enumerate();
        *out = products.fold(0.0, |sum, (tap, weight)| sum + weight * row(tap)[start + i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_and_radii_at_the_default_viewing_distance() {
        let filters = Filters::new(67.020_645);
        // ⌈3 √(0.04 / 2π²) · 67.02⌉ = ⌈9.05⌉ and ⌈3 · 0.041 · 67.02⌉ = ⌈8.24⌉.
        assert_eq!(filters.sensitivity[0].len(), 21);
        assert_eq!(filters.feature[0].len(), 19);
        assert_eq!(filters.radius(), 10);
        let sum = |weights: &[f32]| weights.iter().map(|w| f64::from(*w)).sum::<f64>();
        let [y, cx, cz1, cz2] = filters.sensitivity.each_ref().map(|w| sum(w));
        assert!((y - 1.0).abs() < 1e-6 && (cx - 1.0).abs() < 1e-6);
        assert!((cz1 * cz1 + cz2 * cz2 - 1.0).abs() < 1e-6);
        let [smooth, edge, point] = filters.feature.each_ref().map(|w| sum(w));
        assert!((smooth - 1.0).abs() < 1e-6 && edge.abs() < 1e-6 && point.abs() < 1e-6);
    }

    #[test]
    fn an_edge_filter_answers_one_half_step_with_its_height() {
        let [_, edge, _] = Filters::new(67.020_645).feature;
        // A step of height 1 under the whole positive or negative half.
        let positive: f32 = edge.iter().filter(|w| **w > 0.0).sum();
        assert!((positive - 1.0).abs() < 1e-6);
    }

    #[test]
    fn passes_are_plain_correlations_for_every_length() {
        let weights = [0.5, -1.0, 2.0];
        for length in [1, 15, 16, 17, 40] {
            let padded: Vec<f32> = (0..length + 3).map(|i| ((i * i) % 11) as f32).collect();
            let expected: Vec<f32> = (0..length)
                .map(|x| 0.5 * padded[x + 1] - padded[x + 2] + 2.0 * padded[x + 3])
                .collect();
            let mut out = vec![0.0; length];
            filter_row(&padded, 1, &weights, &mut out);
            assert_eq!(out, expected);
            let rows: Vec<&[f32]> = (1..4).map(|i| &padded[i..i + length]).collect();
            filter_columns(&rows, &weights, &mut out);
            assert_eq!(out, expected);
        }
    }
}
