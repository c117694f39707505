//! FLIP of a band of rows, from two linear images to errors.
//!
//! A band is divided into strips, so that the working set of a strip stays in the cache of a core:
//! a ring buffer of the rows within reach of the filters, filtered along x. Values are planar, and
//! loops run over blocks of `LANES` values, which the compiler vectorises. Results do not depend
//! on the division of the image or on the instruction set.

use super::color::{hunt_lab_from_rgb, hyab, rgb_from_ycxcz, ycxcz_from_rgb};
use super::filters::Filters;
use super::math::pow;
use super::pass::{Block, LANES, block, even, odd_and_even, two_even};
use super::shown::{self, Shown};
use eagpt_scene::tonemap::ToneMapper;
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
/// Planes filtered along x: luminance, red-green, twice yellow-blue, then Gaussian, edge and point
/// of luminance.
const NUM_ALONG_X: usize = 7;
/// Planes filtered along both: the three colour planes, edge and point along x, edge and point
/// along y.
const NUM_FILTERED: usize = 7;
/// Columns of a strip, unless the filters reach further: the rings of both images, 21 rows at the
/// default distance, take 300 kB.
const STRIP_COLUMNS: usize = 256;

/// The largest colour distance, between green and blue, to the power of [`COLOR_EXPONENT`].
static LARGEST_DISTANCE: LazyLock<f32> = LazyLock::new(|| {
    let green = hunt_lab_from_rgb([0.0, 1.0, 0.0]);
    let blue = hunt_lab_from_rgb([0.0, 0.0, 1.0]);
    pow(hyab(green, blue), COLOR_EXPONENT)
});

/// Two images of one size, and the filters for their viewing distance.
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
    /// A row from [`Filters::margin`] columns left of the strip to as many or more right of it.
    pixels: Vec<[f32; 3]>,
    /// The same after the display mapping, `[NUM_SHOWN, pixels]`.
    planes: Vec<f32>,
    /// Of the reference and the test: the rows that the filters reach, `[ring rows, NUM_ALONG_X,
    /// stride]`.
    rings: [Vec<f32>; 2],
    /// Offsets in a ring of the rows at each distance, above and below.
    reached: Vec<[usize; 2]>,
}

impl Pair<'_> {
    /// Raises `errors`, `[rows, width]`, to the maximum over the display mappings `shown`.
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

/// The pixels of a strip whose errors are computed.
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
    let BandScratch {
        pixels,
        planes,
        rings,
        reached,
    } = scratch;
    let length = (stride + 2 * filters.margin()).next_multiple_of(LANES);
    pixels.resize(length, [0.0; 3]);
    planes.resize(NUM_SHOWN * length, 0.0);
    for ring in rings.iter_mut() {
        ring.resize(num_ring_rows * NUM_ALONG_X * stride, 0.0);
    }
    let slot = |row: usize| row % num_ring_rows * NUM_ALONG_X * stride;
    let mut filtered = [[[0.0; LANES]; NUM_FILTERED]; 2];
    let mut next = strip.rows.start.saturating_sub(radius);
    for row in strip.rows.clone() {
        while next < (row + radius + 1).min(pair.height) {
            for (image, ring) in rings.iter_mut().enumerate() {
                copy_row(strip, image, next, pixels);
                show_row(pixels, shown, planes);
                let out = &mut ring[slot(next)..][..NUM_ALONG_X * stride];
                filter_along_x(filters, planes, out);
            }
            next += 1;
        }
        reached.clear();
        for distance in 0..=filters.margin() {
            // Weights beyond the radius are 0: any valid row serves.
            let distance = distance.min(radius);
            let below = (row + distance).min(pair.height - 1);
            reached.push([slot(row.saturating_sub(distance)), slot(below)]);
        }
        let first = (row - strip.rows.start) * pair.width + strip.columns.start;
        let errors = &mut errors[first..][..strip.columns.len()];
        for (block, errors) in errors.chunks_mut(LANES).enumerate() {
            for (ring, filtered) in rings.iter().zip(&mut filtered) {
                filter_along_y(filters, &ring[block * LANES..], stride, reached, filtered);
            }
            let found = errors_of_block(&filtered, strip.largest_distance);
            for (error, found) in errors.iter_mut().zip(found) {
                error[0] = error[0].max(found);
            }
        }
    }
}

/// Copies a row of the image, as far as the filters reach from the strip; columns outside of the
/// image are those at its edge.
fn copy_row(strip: &Strip<'_>, image: usize, row: usize, out: &mut [[f32; 3]]) {
    let (width, margin) = (strip.pair.width, strip.pair.filters.margin());
    // Of the buffer, which begins `margin` columns left of the strip: what lies in the image.
    let first = margin.saturating_sub(strip.columns.start);
    let end = out.len().min(width + margin - strip.columns.start);
    let column = strip.columns.start + first - margin;
    let pixels = &strip.pair.images[image][row * width + column..][..end - first];
    out[first..end].copy_from_slice(pixels);
    let (left, right) = (out[first], out[end - 1]);
    out[..first].fill(left);
    out[end..].fill(right);
}

/// Writes the planes `[NUM_SHOWN, pixels]` of the displayed `pixels`.
#[inline(always)]
fn show_row(pixels: &[[f32; 3]], shown: Shown, out: &mut [f32]) {
    // Each curve has its own loop, free of branches.
    match shown {
        Shown::Srgb => show_row_by(pixels, out, shown::of_srgb),
        Shown::Exposed { tonemapper, factor } => match tonemapper {
            ToneMapper::Aces => show_row_by(pixels, out, |pixel| {
                shown::exposed(ToneMapper::Aces, factor, pixel)
            }),
            ToneMapper::Hable => show_row_by(pixels, out, |pixel| {
                shown::exposed(ToneMapper::Hable, factor, pixel)
            }),
            ToneMapper::Reinhard => show_row_by(pixels, out, |pixel| {
                shown::exposed(ToneMapper::Reinhard, factor, pixel)
            }),
        },
    }
}

#[inline(always)]
fn show_row_by(pixels: &[[f32; 3]], out: &mut [f32], shown: impl Fn([f32; 3]) -> [f32; 3]) {
    let length = out.len() / NUM_SHOWN;
    for (block, pixels) in pixels.as_chunks::<LANES>().0.iter().enumerate() {
        let mut channels = [[0.0; LANES]; 3];
        for i in 0..LANES {
            for c in 0..3 {
                channels[c][i] = pixels[i][c];
            }
        }
        let mut planes = [[0.0; LANES]; NUM_SHOWN];
        for i in 0..LANES {
            let [y, cx, cz] =
                ycxcz_from_rgb(shown([channels[0][i], channels[1][i], channels[2][i]]));
            planes[0][i] = y;
            planes[1][i] = cx;
            planes[2][i] = cz;
            planes[3][i] = (y + 16.0) * (1.0 / 116.0);
        }
        for (plane, values) in planes.iter().enumerate() {
            out[plane * length + block * LANES..][..LANES].copy_from_slice(values);
        }
    }
}

#[inline(always)]
fn filter_along_x(filters: &Filters, shown: &[f32], out: &mut [f32]) {
    let (length, margin) = (shown.len() / NUM_SHOWN, filters.margin());
    let stride = out.len() / NUM_ALONG_X;
    let [s_y, s_cx, s_cz1, s_cz2] = &filters.sensitivity;
    let [smooth, edge, point] = &filters.feature;
    for first in (0..stride).step_by(LANES) {
        let at = |plane: usize| {
            let middle = plane * length + margin + first;
            move |distance: usize| {
                let before = block(shown, middle - distance);
                [before, block(shown, middle + distance)]
            }
        };
        let mut filtered = [[0.0; LANES]; NUM_ALONG_X];
        let [
            out_y,
            out_cx,
            out_cz1,
            out_cz2,
            out_smooth,
            out_edge,
            out_point,
        ] = &mut filtered;
        even(s_y, at(0), out_y);
        even(s_cx, at(1), out_cx);
        two_even([s_cz1, s_cz2], at(2), [out_cz1, out_cz2]);
        even(smooth, at(3), out_smooth);
        odd_and_even(edge, point, at(3), [out_edge, out_point]);
        for (plane, values) in filtered.iter().enumerate() {
            out[plane * stride + first..][..LANES].copy_from_slice(values);
        }
    }
}

/// Filters a block of a ring around the row whose neighbours are `reached`.
#[inline(always)]
fn filter_along_y(
    filters: &Filters,
    ring: &[f32],
    stride: usize,
    reached: &[[usize; 2]],
    out: &mut [Block; NUM_FILTERED],
) {
    let [s_y, s_cx, s_cz1, s_cz2] = &filters.sensitivity;
    let [smooth, edge, point] = &filters.feature;
    let at = |plane: usize| {
        move |distance: usize| {
            let [above, below] = reached[distance];
            let above = block(ring, above + plane * stride);
            [above, block(ring, below + plane * stride)]
        }
    };
    let mut other_cz = [0.0; LANES];
    let [
        out_y,
        out_cx,
        out_cz,
        out_edge_x,
        out_point_x,
        out_edge_y,
        out_point_y,
    ] = out;
    even(s_y, at(0), out_y);
    even(s_cx, at(1), out_cx);
    even(s_cz1, at(2), out_cz);
    even(s_cz2, at(3), &mut other_cz);
    for i in 0..LANES {
        out_cz[i] += other_cz[i];
    }
    odd_and_even(edge, point, at(4), [out_edge_y, out_point_y]);
    even(smooth, at(5), out_edge_x);
    even(smooth, at(6), out_point_x);
}

#[inline(always)]
fn errors_of_block([reference, test]: &[[Block; NUM_FILTERED]; 2], largest_distance: f32) -> Block {
    let mut errors = [0.0; LANES];
    for i in 0..LANES {
        let (mut r, mut t) = ([0.0; NUM_FILTERED], [0.0; NUM_FILTERED]);
        for plane in 0..NUM_FILTERED {
            r[plane] = reference[plane][i];
            t[plane] = test[plane][i];
        }
        let color = color_error(&r, &t, largest_distance);
        errors[i] = pow(color, 1.0 - feature_difference(&r, &t));
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
