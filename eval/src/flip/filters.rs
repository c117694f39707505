//! The filters of FLIP, separated into one-dimensional passes.
//!
//! The contrast sensitivity of luminance and of red-green is one Gaussian, that of yellow-blue the
//! sum of two; edges and points are found by the first and second derivative of a Gaussian as wide
//! as a feature. All are even but the edge filter, which is odd: a pass adds or subtracts the two
//! values at a distance before it weighs them.

use std::f64::consts::PI;

/// Width of a feature in degrees.
const FEATURE_WIDTH_DEGREES: f64 = 0.082;
/// a and b of the sensitivity a √(π/b) exp(−π² x²/b), x in degrees: luminance, red-green, and the
/// two of yellow-blue.
const SENSITIVITY: [(f64, f64); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];
/// Weights below this share of the middle one are left out: together less than the rounding of a
/// sum in f32.
const NEGLIGIBLE: f64 = 1e-9;
/// Distances that a pass weighs together.
pub(super) const GROUP: usize = 3;

/// One-dimensional weights, that of the middle first and then those by distance from it, up to
/// whole groups of [`GROUP`] distances, of which the last have weights of 0.
#[derive(Debug, Clone)]
pub(super) struct Filters {
    radius: usize,
    /// Sensitivities to luminance, red-green and yellow-blue (two of one length, to be added).
    pub(super) sensitivity: [Vec<f32>; 4],
    /// Gaussian, edge (the weights after the middle) and point filter, all of one length.
    pub(super) feature: [Vec<f32>; 3],
}

impl Filters {
    /// The filters for so many pixels per degree of vision.
    pub(super) fn new(pixels_per_degree: f32) -> Self {
        let ppd = f64::from(pixels_per_degree);
        let (mut sensitivity, mut feature) = (sensitivity(ppd), feature(ppd));
        let all = sensitivity.iter().chain(&feature);
        let radius = all.map(Vec::len).fold(1, usize::max) - 1;
        for half in sensitivity.iter_mut().chain(&mut feature) {
            half.resize(1 + (half.len() - 1).next_multiple_of(GROUP), 0.0);
        }
        Self {
            radius,
            sensitivity,
            feature,
        }
    }

    /// Pixels that the largest filter reaches to each side.
    pub(super) fn radius(&self) -> usize {
        self.radius
    }

    /// The same up to whole groups.
    pub(super) fn margin(&self) -> usize {
        self.radius.next_multiple_of(GROUP)
    }
}

fn half(radius: usize, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=radius).map(|x| weight(x as f64)).collect()
}

/// Sum of all weights of an even filter.
fn total(half: &[f64]) -> f64 {
    2.0 * half.iter().sum::<f64>() - half[0]
}

fn scaled(half: &[f64], factor: f64) -> Vec<f32> {
    half.iter().map(|w| (w * factor) as f32).collect()
}

fn sensitivity(ppd: f64) -> [Vec<f32>; 4] {
    let widest = SENSITIVITY.iter().fold(0.0, |widest, (_, b)| b.max(widest));
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
    // Of a two-dimensional Gaussian with factor a √(π/b), each pass has the square root.
    let raw = SENSITIVITY.map(|(a, b)| {
        half(radius, |x| {
            (a * (PI / b).sqrt()).sqrt() * (-PI * PI * (x / ppd).powi(2) / b).exp()
        })
    });
    let sums = raw.each_ref().map(|half| total(half));
    // The two of yellow-blue have volume 1 together.
    let both = (sums[2] * sums[2] + sums[3] * sums[3]).sqrt();
    let totals = [sums[0], sums[1], both, both];
    std::array::from_fn(|i| {
        let needed = raw[i].iter().take_while(|w| **w > NEGLIGIBLE * raw[i][0]);
        // The two of yellow-blue go through one pass.
        let length = if i < 2 { needed.count() } else { raw[i].len() };
        scaled(&raw[i][..length], 1.0 / totals[i])
    })
}

fn feature(ppd: f64) -> [Vec<f32>; 3] {
    let deviation = 0.5 * FEATURE_WIDTH_DEGREES * ppd;
    let radius = (3.0 * deviation).ceil() as usize;
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let smooth = half(radius, gaussian);
    // Weights on one side of the middle have one sign and add up to it.
    let edge = half(radius, |x| -x * gaussian(x));
    let one_side: f64 = edge.iter().sum();
    let point = half(radius, |x| {
        (x * x / (deviation * deviation) - 1.0) * gaussian(x)
    });
    [
        scaled(&smooth, 1.0 / total(&smooth)),
        scaled(&edge, -1.0 / one_side),
        balanced(&point),
    ]
}

/// Positive weights of an even filter scaled to add up to 1 and negative ones to −1.
fn balanced(half: &[f64]) -> Vec<f32> {
    let sum = |sign: f64| {
        let part: Vec<f64> = half.iter().map(|w| (w * sign).max(0.0)).collect();
        total(&part)
    };
    let (positive, negative) = (sum(1.0), sum(-1.0));
    let scale = |w: &f64| w / if *w > 0.0 { positive } else { negative };
    half.iter().map(|w| scale(w) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total_of(half: &[f32]) -> f64 {
        let half: Vec<f64> = half.iter().map(|w| f64::from(*w)).collect();
        total(&half)
    }

    #[test]
    fn volumes_and_radii_at_the_default_viewing_distance() {
        let filters = Filters::new(67.020_645);
        // ⌈3 √(0.04 / 2π²) · 67.02⌉ = ⌈9.05⌉ and ⌈3 · 0.041 · 67.02⌉ = ⌈8.24⌉.
        assert_eq!((filters.radius(), filters.margin()), (10, 12));
        let reach = |half: &[f32]| half.iter().rposition(|w| *w != 0.0).unwrap();
        let [y, cx, cz1, cz2] = filters.sensitivity.each_ref().map(|half| reach(half));
        assert_eq!((cz1, cz2), (10, 10));
        // exp(−π² x²/b) falls to 1e-9 at x = √(b ln 1e9) / π: 6.66 and 7.07 pixels.
        assert_eq!((y, cx), (6, 7));
        assert_eq!(filters.feature.each_ref().map(|half| reach(half)), [9; 3]);
        let [y, cx, cz1, cz2] = filters.sensitivity.each_ref().map(|w| total_of(w));
        assert!((y - 1.0).abs() < 1e-6 && (cx - 1.0).abs() < 1e-6);
        assert!((cz1 * cz1 + cz2 * cz2 - 1.0).abs() < 1e-6);
        let [smooth, _, point] = filters.feature.each_ref().map(|w| total_of(w));
        assert!((smooth - 1.0).abs() < 1e-6 && point.abs() < 1e-6);
    }

    #[test]
    fn an_edge_filter_answers_one_half_step_with_its_height() {
        let [_, edge, _] = Filters::new(67.020_645).feature;
        // A step of height 1 under the negative half, which comes after the middle.
        assert!((edge.iter().sum::<f32>() + 1.0).abs() < 1e-6);
        assert!(edge[0] == 0.0 && edge[1..].iter().all(|w| *w <= 0.0));
    }
}
