//! FLIP of a band of rows, from two linear images to errors.
//!
//! A band is cut into strips, so that what a strip needs stays in the cache of a core: the rows that the filters reach, filtered
//! along x, as a ring that goes down the strip. Values lie in planes, and loops run over blocks of [`LANES`] of them, of which
//! the compiler makes vector instructions. No sum depends on how an image is cut, and no bit on which instructions there are.

use super::color::{hunt_lab_from_rgb, hyab, rgb_from_ycxcz, ycxcz_from_rgb};
use super::filters::Filters;
use super::math::pow;
use super::shown::Shown;
use multiversion::multiversion;
use std::ops::Range;
use std::sync::LazyLock;

/// Exponent of the colour distance.
const COLOR_EXPONENT: f32 = 0.7;
/// Share of the largest colour distance that is shown below [`KNEE_ERROR`].
const KNEE_SHARE: f32 = 0.4;
/// Error at the knee; larger distances are compressed above it.
const KNEE_ERROR: f32 = 0.95;
/// Planes of a pixel that is shown: luminance, red-green, yellow-blue, luminance from 0 to 1.
const NUM_SHOWN: usize = 4;
/// Planes filtered along x: luminance, red-green, twice yellow-blue, then Gaussian, edge and point of luminance.
const NUM_ALONG_X: usize = 7;
/// Planes filtered along both: the three colour planes, edge and point along x, edge and point along y.
const NUM_FILTERED: usize = 7;
/// Values of a block; strips are a whole number of blocks wide in memory.
const LANES: usize = 32;
/// Columns of a strip, unless the filters reach further: the rings of both images, 21 rows at the default distance, take 300 kB.
const STRIP_COLUMNS: usize = 256;

type Block = [f32; LANES];

/// The largest colour distance, between green and blue, to the power of [`COLOR_EXPONENT`].
static LARGEST_DISTANCE: LazyLock<f32> = LazyLock::new(|| {
    let green = hunt_lab_from_rgb([0.0, 1.0, 0.0]);
    let blue = hunt_lab_from_rgb([0.0, 0.0, 1.0]);
    pow(hyab(green, blue), COLOR_EXPONENT)
});

/// Two images of one size, and the filters of the distance that they are seen from.
pub(super) struct Pair<'a> {
    pub(super) filters: &'a Filters,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Reference and test.
    pub(super) images: [&'a [[f32; 3]]; 2],
}

/// Buffers that a thread keeps between bands.
#[derive(Default)]
pub(super) struct BandScratch {
    /// A row as it is shown, `[NUM_SHOWN, radius + stride + radius]`: pixels outside of the image are those at its edge.
    shown: Vec<f32>,
    /// Of the reference and the test: the rows that the filters reach, `[ring rows, NUM_ALONG_X, stride]`.
    rings: [Vec<f32>; 2],
    /// Where in a ring the rows at each distance begin, above and below.
    reached: Vec<[usize; 2]>,
}

impl Pair<'_> {
    /// Raises `errors`, `[rows, width]`, to the largest of those between the images as each of `shown` shows them.
    pub(super) fn raise_errors(
        &self,
        rows: &Range<usize>,
        shown: &[Shown],
        scratch: &mut BandScratch,
        errors: &mut [[f32; 1]],
    ) {
        let columns = STRIP_COLUMNS.max(self.filters.radius());
        for first in (0..self.width).step_by(columns) {
            let strip = Strip {
                pair: self,
                rows: rows.clone(),
                columns: first..(first + columns).min(self.width),
                largest_distance: *LARGEST_DISTANCE,
            };
            for shown in shown {
                raise_errors_of_strip(&strip, *shown, scratch, errors);
            }
        }
    }
}

/// Pixels whose errors are wanted.
struct Strip<'a> {
    pair: &'a Pair<'a>,
    rows: Range<usize>,
    columns: Range<usize>,
    largest_distance: f32,
}

#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
    "x86_64+avx2",
    "aarch64+neon"
))]
fn raise_errors_of_strip(
    strip: &Strip<'_>,
    shown: Shown,
    scratch: &mut BandScratch,
    errors: &mut [[f32; 1]],
) {
    let (pair, filters) = (strip.pair, strip.pair.filters);
    let radius = filters.radius();
    let stride = strip.columns.len().next_multiple_of(LANES);
    let num_ring_rows = (2 * radius + 1).min(pair.height);
    scratch.shown.resize(NUM_SHOWN * (stride + 2 * radius), 0.0);
    for ring in &mut scratch.rings {
        ring.resize(num_ring_rows * NUM_ALONG_X * stride, 0.0);
    }
    let slot = |row: usize| row % num_ring_rows * NUM_ALONG_X * stride;
    let mut next = strip.rows.start.saturating_sub(radius);
    for row in strip.rows.clone() {
        while next < (row + radius + 1).min(pair.height) {
            for (image, ring) in pair.images.iter().zip(&mut scratch.rings) {
                show_row(
                    strip,
                    &image[next * pair.width..][..pair.width],
                    shown,
                    &mut scratch.shown,
                );
                let out = &mut ring[slot(next)..][..NUM_ALONG_X * stride];
                filter_along_x(filters, &scratch.shown, out);
            }
            next += 1;
        }
        scratch.reached.clear();
        scratch.reached.extend((0..=radius).map(|distance| {
            let below = (row + distance).min(pair.height - 1);
            [row.saturating_sub(distance), below].map(slot)
        }));
        let first = (row - strip.rows.start) * pair.width + strip.columns.start;
        let errors = &mut errors[first..][..strip.columns.len()];
        for (block, errors) in errors.chunks_mut(LANES).enumerate() {
            let [reference, test] = scratch.rings.each_ref().map(|ring| {
                filter_along_y(filters, &ring[block * LANES..], stride, &scratch.reached)
            });
            let found = errors_of_block(&reference, &test, strip.largest_distance);
            for (error, found) in errors.iter_mut().zip(found) {
                error[0] = error[0].max(found);
            }
        }
    }
}

/// Writes what is shown of a row of the image, as far as the filters reach from the strip.
#[inline(always)]
fn show_row(strip: &Strip<'_>, pixels: &[[f32; 3]], shown: Shown, out: &mut [f32]) {
    let radius = strip.pair.filters.radius();
    let length = out.len() / NUM_SHOWN;
    // Of the buffer, which begins `radius` columns left of the strip: what lies in the image.
    let first = radius.saturating_sub(strip.columns.start);
    let end = length.min(strip.pair.width + radius - strip.columns.start);
    let pixels = &pixels[strip.columns.start + first - radius..][..end - first];
    let (y, rest) = out.split_at_mut(length);
    let (cx, rest) = rest.split_at_mut(length);
    let (cz, luminance) = rest.split_at_mut(length);
    let mut planes = [y, cx, cz, luminance];
    {
        let [y, cx, cz, luminance] = planes.each_mut().map(|plane| &mut plane[first..end]);
        let pixels = &pixels[..y.len()];
        let (cx, cz, luminance) = (
            &mut cx[..pixels.len()],
            &mut cz[..pixels.len()],
            &mut luminance[..pixels.len()],
        );
        for (i, pixel) in pixels.iter().enumerate() {
            let color = ycxcz_from_rgb(shown.of(*pixel));
            [y[i], cx[i], cz[i]] = color;
            luminance[i] = (color[0] + 16.0) * (1.0 / 116.0);
        }
    }
    for plane in &mut planes {
        let (left, right) = (plane[first], plane[end - 1]);
        plane[..first].fill(left);
        plane[end..].fill(right);
    }
}

#[inline(always)]
fn filter_along_x(filters: &Filters, shown: &[f32], out: &mut [f32]) {
    let (length, radius) = (shown.len() / NUM_SHOWN, filters.radius());
    let stride = out.len() / NUM_ALONG_X;
    let [s_y, s_cx, s_cz1, s_cz2] = &filters.sensitivity;
    let [smooth, edge, point] = &filters.feature;
    for first in (0..stride).step_by(LANES) {
        let at = |plane: usize| {
            move |distance: usize| {
                let middle = plane * length + radius + first;
                (
                    block(shown, middle - distance),
                    block(shown, middle + distance),
                )
            }
        };
        let [cz1, cz2] = two_even(s_cz1, s_cz2, at(2));
        let [smooth, edge, point] = feature(smooth, edge, point, at(3));
        let filtered = [
            even(s_y, at(0)),
            even(s_cx, at(1)),
            cz1,
            cz2,
            smooth,
            edge,
            point,
        ];
        for (plane, values) in filtered.iter().enumerate() {
            out[plane * stride + first..][..LANES].copy_from_slice(values);
        }
    }
}

#[inline(always)]
fn filter_along_y(
    filters: &Filters,
    ring: &[f32],
    stride: usize,
    reached: &[[usize; 2]],
) -> [Block; NUM_FILTERED] {
    let [s_y, s_cx, s_cz1, s_cz2] = &filters.sensitivity;
    let [smooth, edge, point] = &filters.feature;
    let at = |plane: usize| {
        move |distance: usize| {
            let [above, below] = reached[distance];
            (
                block(ring, above + plane * stride),
                block(ring, below + plane * stride),
            )
        }
    };
    let [cz1, cz2] = [even(s_cz1, at(2)), even(s_cz2, at(3))];
    let [_, edge_y, point_y] = feature(smooth, edge, point, at(4));
    [
        even(s_y, at(0)),
        even(s_cx, at(1)),
        std::array::from_fn(|i| cz1[i] + cz2[i]),
        even(smooth, at(5)),
        even(smooth, at(6)),
        edge_y,
        point_y,
    ]
}

#[inline(always)]
fn block(values: &[f32], first: usize) -> &Block {
    match values[first..].first_chunk() {
        Some(block) => block,
        None => &[0.0; LANES],
    }
}

/// An even filter of the values that `at` gives at a distance to both sides.
#[inline(always)]
fn even<'a>(weights: &[f32], at: impl Fn(usize) -> (&'a Block, &'a Block)) -> Block {
    let middle = at(0).0;
    let mut sums: Block = std::array::from_fn(|i| weights[0] * middle[i]);
    for (distance, weight) in weights.iter().enumerate().skip(1) {
        let (a, b) = at(distance);
        for i in 0..LANES {
            sums[i] += weight * (a[i] + b[i]);
        }
    }
    sums
}

/// Two even filters of one length.
#[inline(always)]
fn two_even<'a>(
    first: &[f32],
    second: &[f32],
    at: impl Fn(usize) -> (&'a Block, &'a Block),
) -> [Block; 2] {
    let middle = at(0).0;
    let mut sums = [first[0], second[0]].map(|weight| middle.map(|v| weight * v));
    for (distance, (first, second)) in first.iter().zip(second).enumerate().skip(1) {
        let (a, b) = at(distance);
        for i in 0..LANES {
            let both = a[i] + b[i];
            sums[0][i] += first * both;
            sums[1][i] += second * both;
        }
    }
    sums
}

/// The Gaussian, edge and point filters.
#[inline(always)]
fn feature<'a>(
    smooth: &[f32],
    edge: &[f32],
    point: &[f32],
    at: impl Fn(usize) -> (&'a Block, &'a Block),
) -> [Block; 3] {
    let middle = at(0).0;
    let mut sums = [smooth[0], 0.0, point[0]].map(|weight| middle.map(|v| weight * v));
    for distance in 1..smooth.len() {
        let (smooth, edge, point) = (smooth[distance], edge[distance], point[distance]);
        let (a, b) = at(distance);
        for i in 0..LANES {
            let both = a[i] + b[i];
            sums[0][i] += smooth * both;
            sums[1][i] += edge * (b[i] - a[i]);
            sums[2][i] += point * both;
        }
    }
    sums
}

#[inline(always)]
fn errors_of_block(
    reference: &[Block; NUM_FILTERED],
    test: &[Block; NUM_FILTERED],
    largest_distance: f32,
) -> Block {
    let mut errors = [0.0; LANES];
    for i in 0..LANES {
        let [reference, test] = [reference, test].map(|planes| planes.each_ref().map(|p| p[i]));
        let color = color_error(&reference, &test, largest_distance);
        errors[i] = pow(color, 1.0 - feature_difference(&reference, &test));
    }
    errors
}

#[inline(always)]
fn color_error(
    reference: &[f32; NUM_FILTERED],
    test: &[f32; NUM_FILTERED],
    largest_distance: f32,
) -> f32 {
    let lab = |p: &[f32; NUM_FILTERED]| {
        let rgb = rgb_from_ycxcz([p[0], p[1], p[2]]);
        hunt_lab_from_rgb(rgb.map(|v| v.clamp(0.0, 1.0)))
    };
    let knee = KNEE_SHARE * largest_distance;
    let distance = pow(hyab(lab(reference), lab(test)), COLOR_EXPONENT);
    let below = distance * (KNEE_ERROR / knee);
    let above = KNEE_ERROR + (distance - knee) * ((1.0 - KNEE_ERROR) / (largest_distance - knee));
    if distance < knee { below } else { above }
}

/// Square root of the larger difference in edges or points, in [0, 1].
#[inline(always)]
fn feature_difference(reference: &[f32; NUM_FILTERED], test: &[f32; NUM_FILTERED]) -> f32 {
    let length = |x: f32, y: f32| (x * x + y * y).sqrt();
    let edge = (length(reference[3], reference[5]) - length(test[3], test[5])).abs();
    let point = (length(reference[4], reference[6]) - length(test[4], test[6])).abs();
    (std::f32::consts::FRAC_1_SQRT_2 * edge.max(point)).sqrt()
}
