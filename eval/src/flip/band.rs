//! FLIP of a band of rows, from two displayed images to errors.

use super::color::{hunt_lab_from_rgb, hyab, rgb_from_ycxcz, ycxcz_from_rgb};
use super::filters::{Filters, filter_columns, filter_row};
use std::ops::Range;
use std::sync::LazyLock;

/// Exponent of the colour distance.
const COLOR_EXPONENT: f32 = 0.7;
/// Share of the largest colour distance that is shown below [`KNEE_ERROR`].
const KNEE_SHARE: f32 = 0.4;
/// Error at the knee; larger distances are compressed above it.
const KNEE_ERROR: f32 = 0.95;
/// Planes filtered along x: luminance, red-green, twice yellow-blue, then edge, point and Gaussian of luminance.
const NUM_ALONG_X: usize = 7;
/// Planes filtered along both: the four colour planes, edge and point along x, edge and point along y.
const NUM_FILTERED: usize = 8;

/// The largest colour distance, between green and blue, to the power of [`COLOR_EXPONENT`].
static LARGEST_DISTANCE: LazyLock<f32> = LazyLock::new(|| {
    let green = hunt_lab_from_rgb([0.0, 1.0, 0.0]);
    let blue = hunt_lab_from_rgb([0.0, 0.0, 1.0]);
    hyab(green, blue).powf(COLOR_EXPONENT)
});

/// Rows to compute, and the rows around them that the filters reach.
pub(super) struct Band<'a> {
    filters: &'a Filters,
    width: usize,
    height: usize,
    rows: Range<usize>,
    /// Rows with pixels that are needed.
    reached: Range<usize>,
}

/// Buffers that a thread keeps between bands.
#[derive(Default)]
pub(super) struct BandScratch {
    /// Luminance, red-green, yellow-blue and normalised luminance of a row, each with its ends repeated.
    padded: [Vec<f32>; 4],
    /// Of the reference and the test: `[reached rows, NUM_ALONG_X, width]`.
    along_x: [Vec<f32>; 2],
    /// Of the reference and the test: `[NUM_FILTERED, width]`.
    filtered: [Vec<f32>; 2],
}

impl<'a> Band<'a> {
    pub(super) fn new(filters: &'a Filters, size: (usize, usize), rows: Range<usize>) -> Self {
        let (width, height) = size;
        let radius = filters.radius();
        let reached = rows.start.saturating_sub(radius)..(rows.end + radius).min(height);
        Self {
            filters,
            width,
            height,
            rows,
            reached,
        }
    }

    /// Raises `errors`, `[rows, width]`, to those between `images` (reference and test) shown by `shown`.
    pub(super) fn raise_errors(
        &self,
        images: [&[[f32; 3]]; 2],
        shown: impl Fn([f32; 3]) -> [f32; 3],
        scratch: &mut BandScratch,
        errors: &mut [[f32; 1]],
    ) {
        let BandScratch {
            padded,
            along_x,
            filtered,
        } = scratch;
        for (image, along_x) in images.into_iter().zip(along_x.iter_mut()) {
            along_x.resize(self.reached.len() * NUM_ALONG_X * self.width, 0.0);
            for (row, out) in self
                .reached
                .clone()
                .zip(along_x.chunks_exact_mut(NUM_ALONG_X * self.width))
            {
                let pixels = &image[row * self.width..(row + 1) * self.width];
                self.filter_along_x(pixels, &shown, padded, out);
            }
        }
        for (row, errors) in self.rows.clone().zip(errors.chunks_exact_mut(self.width)) {
            for (along_x, filtered) in along_x.iter().zip(filtered.iter_mut()) {
                filtered.resize(NUM_FILTERED * self.width, 0.0);
                self.filter_along_y(row, along_x, filtered);
            }
            raise_row(filtered, errors);
        }
    }

    fn filter_along_x(
        &self,
        pixels: &[[f32; 3]],
        shown: impl Fn([f32; 3]) -> [f32; 3],
        padded: &mut [Vec<f32>; 4],
        out: &mut [f32],
    ) {
        let radius = self.filters.radius();
        for plane in padded.iter_mut() {
            plane.resize(self.width + 2 * radius, 0.0);
        }
        for (x, pixel) in pixels.iter().enumerate() {
            let [y, cx, cz] = ycxcz_from_rgb(shown(*pixel));
            let luminance = (y + 16.0) / 116.0;
            for (plane, value) in padded.iter_mut().zip([y, cx, cz, luminance]) {
                plane[radius + x] = value;
            }
        }
        for plane in padded.iter_mut() {
            let (first, last) = (plane[radius], plane[radius + self.width - 1]);
            plane[..radius].fill(first);
            plane[radius + self.width..].fill(last);
        }
        let [y, cx, cz, luminance] = &*padded;
        let [s_y, s_cx, s_cz1, s_cz2] = &self.filters.sensitivity;
        let [smooth, edge, point] = &self.filters.feature;
        let passes = [
            (y, s_y),
            (cx, s_cx),
            (cz, s_cz1),
            (cz, s_cz2),
            (luminance, edge),
            (luminance, point),
            (luminance, smooth),
        ];
        for ((plane, weights), out) in passes.into_iter().zip(out.chunks_exact_mut(self.width)) {
            filter_row(plane, radius - weights.len() / 2, weights, out);
        }
    }

    fn filter_along_y(&self, row: usize, along_x: &[f32], filtered: &mut [f32]) {
        let [s_y, s_cx, s_cz1, s_cz2] = &self.filters.sensitivity;
        let [smooth, edge, point] = &self.filters.feature;
        let passes = [
            (0, s_y),
            (1, s_cx),
            (2, s_cz1),
            (3, s_cz2),
            (4, smooth),
            (5, smooth),
            (6, edge),
            (6, point),
        ];
        for ((plane, weights), out) in passes
            .into_iter()
            .zip(filtered.chunks_exact_mut(self.width))
        {
            let rows: Vec<&[f32]> = (0..weights.len())
                .map(|tap| {
                    let reached = (row + tap)
                        .saturating_sub(weights.len() / 2)
                        .min(self.height - 1);
                    let start = ((reached - self.reached.start) * NUM_ALONG_X + plane) * self.width;
                    &along_x[start..start + self.width]
                })
                .collect();
            filter_columns(&rows, weights, out);
        }
    }
}

fn raise_row(filtered: &[Vec<f32>; 2], errors: &mut [[f32; 1]]) {
    let width = errors.len();
    let planes = |image: &'_ [f32], x: usize| -> [f32; NUM_FILTERED] {
        std::array::from_fn(|plane| image[plane * width + x])
    };
    for (x, error) in errors.iter_mut().enumerate() {
        let reference = planes(&filtered[0], x);
        let test = planes(&filtered[1], x);
        let color = color_error(&reference, &test);
        let found = color.powf(1.0 - feature_difference(&reference, &test));
        error[0] = error[0].max(found);
    }
}

fn color_error(reference: &[f32; NUM_FILTERED], test: &[f32; NUM_FILTERED]) -> f32 {
    let [reference, test] = [reference, test].map(|p| {
        let rgb = rgb_from_ycxcz([p[0], p[1], p[2] + p[3]]);
        hunt_lab_from_rgb(rgb.map(|v| v.clamp(0.0, 1.0)))
    });
    let largest = *LARGEST_DISTANCE;
    let knee = KNEE_SHARE * largest;
    let distance = hyab(reference, test).powf(COLOR_EXPONENT);
    if distance < knee {
        distance * (KNEE_ERROR / knee)
    } else {
        KNEE_ERROR + (distance - knee) / (largest - knee) * (1.0 - KNEE_ERROR)
    }
}

/// Square root of the larger difference in edges or points, in [0, 1].
fn feature_difference(reference: &[f32; NUM_FILTERED], test: &[f32; NUM_FILTERED]) -> f32 {
    let length = |x: f32, y: f32| (x * x + y * y).sqrt();
    let edge = (length(reference[4], reference[6]) - length(test[4], test[6])).abs();
    let point = (length(reference[5], reference[7]) - length(test[5], test[7])).abs();
    (std::f32::consts::FRAC_1_SQRT_2 * edge.max(point)).sqrt()
}
