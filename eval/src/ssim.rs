//! Structural similarity (Wang et al. 2004) and its gradient.
//!
//! An 11x11 Gaussian window with sigma 1.5, zeros outside the image, each channel on its own, then
//! the mean over all pixels and channels; C1 = 0.01², C2 = 0.03² for a peak of 1. This is the form
//! of the 3DGS family, whose training loss it is; scikit-image crops the border and so differs
//! there. Where images are not known everywhere, the mean is that over the windows that touch no
//! unknown pixel.
//!
//! With x the reference, y the test image and B the window (its own adjoint, because it is
//! symmetric and zero padded): m_x = B x, m_y = B y, q = B(x² + y²), p = B(x y), and at every pixel
//! S = (2 m_x m_y + C1)(2 (p − m_x m_y) + C2) / ((m_x² + m_y² + C1)(q − m_x² − m_y² + C2)). The
//! gradient is B ∂S/∂m_y + 2 y B ∂S/∂q + x B ∂S/∂p: seven blurs in all.

use crate::encode::{assert_comparable, srgb_clipped};
use crate::known::Windows;
use crate::window::{RADIUS, blur_columns, blur_row};
use eagpt_scene::Image;
use rayon::prelude::*;

/// Keeps the quotient of the means finite.
pub const C1: f32 = 0.01 * 0.01;
/// Keeps the quotient of the structures finite.
pub const C2: f32 = 0.03 * 0.03;
/// Blurred quantities that the value needs: m_x, m_y, q, p.
const NUM_MOMENTS: usize = 4;
/// Derivatives that are blurred for the gradient: by m_y, q, p.
const NUM_PARTIALS: usize = 3;
/// Output rows of one task. Each task blurs `2 RADIUS` rows more than that along x; fewer rows
/// would waste more, more rows would leave threads idle on the small images that training uses.
const BAND_ROWS: usize = 48;

/// Value and gradient of the structural similarity.
#[derive(Debug, Clone)]
pub struct SsimGradient {
    /// Mean similarity, 1 for equal images.
    pub value: f64,
    /// Derivative of `value` by each value of the test image, `[height, width, 3]`.
    pub d_test: Image<3>,
}

/// Structural similarity of two encoded images with peak 1; 1 for equal ones.
///
/// # Panics
/// If the sizes differ or the images have no pixels.
pub fn ssim(reference: &Image<3>, test: &Image<3>) -> f64 {
    ssim_in(reference, test, None)
}

/// [`ssim`] over the windows that count (`None`: all); 1 if none does.
///
/// # Panics
/// As [`ssim`], and if `windows` are those of images of another size.
pub(crate) fn ssim_in(reference: &Image<3>, test: &Image<3>, windows: Option<&Windows>) -> f64 {
    let pair = Pair::new(reference, test, windows);
    let bands: Vec<(usize, usize)> = (0..3)
        .flat_map(|channel| {
            (0..pair.height())
                .step_by(BAND_ROWS)
                .map(move |y| (channel, y))
        })
        .collect();
    let sums: Vec<f64> = bands
        .into_par_iter()
        .map_init(BandScratch::default, |scratch, (channel, first_row)| {
            let num_rows = BAND_ROWS.min(pair.height() - first_row);
            similarity_of_band(
                &pair,
                channel,
                first_row..first_row + num_rows,
                scratch,
                None,
            )
        })
        .collect();
    pair.mean(&sums)
}

/// Structural similarity in sRGB clipped to [0, 1], from linear images.
///
/// # Panics
/// As [`ssim`].
pub fn ssim_srgb(reference: &Image<3>, test: &Image<3>) -> f64 {
    ssim(&srgb_clipped(reference), &srgb_clipped(test))
}

/// `ssim_in` and its derivative by the test image.
///
/// # Panics
/// As `ssim_in`.
pub fn ssim_with_gradient(
    reference: &Image<3>,
    test: &Image<3>,
    windows: Option<&Windows>,
) -> SsimGradient {
    let pair = Pair::new(reference, test, windows);
    let (width, height) = (pair.width(), pair.height());
    // Per channel: `height` rows of the three partials, blurred along x, between RADIUS rows of
    // zeros.
    let stride = NUM_PARTIALS * width;
    let mut partials = vec![0.0_f32; 3 * (height + 2 * RADIUS) * stride];
    let tasks: Vec<(usize, usize, &mut [f32])> = partials
        .chunks_mut((height + 2 * RADIUS) * stride)
        .enumerate()
        .flat_map(|(channel, plane)| {
            plane[RADIUS * stride..][..height * stride]
                .chunks_mut(BAND_ROWS * stride)
                .enumerate()
                .map(move |(band, rows)| (channel, band * BAND_ROWS, rows))
        })
        .collect();
    let sums: Vec<f64> = tasks
        .into_par_iter()
        .map_init(
            BandScratch::default,
            |scratch, (channel, first_row, out)| {
                let rows = first_row..first_row + out.len() / stride;
                similarity_of_band(&pair, channel, rows, scratch, Some(out))
            },
        )
        .collect();
    SsimGradient {
        value: pair.mean(&sums),
        d_test: gradient(&pair, &partials),
    }
}

struct Pair<'a> {
    reference: &'a Image<3>,
    test: &'a Image<3>,
    windows: Option<&'a Windows>,
}

impl<'a> Pair<'a> {
    fn new(reference: &'a Image<3>, test: &'a Image<3>, windows: Option<&'a Windows>) -> Self {
        assert_comparable(reference, test);
        if let Some(windows) = windows {
            assert_eq!(
                windows.counts.len(),
                test.pixels().len(),
                "there is one window for each pixel"
            );
        }
        Self {
            reference,
            test,
            windows,
        }
    }

    fn width(&self) -> usize {
        self.reference.width() as usize
    }

    fn height(&self) -> usize {
        self.reference.height() as usize
    }

    /// Whether each window of a row counts; `None` if all do.
    fn counts(&self, row: usize) -> Option<&[bool]> {
        let width = self.width();
        Some(&self.windows?.counts[row * width..][..width])
    }

    /// Windows that count, of all channels.
    fn num_windows(&self) -> f64 {
        let num = self
            .windows
            .map_or(self.test.pixels().len(), |windows| windows.num);
        3.0 * num as f64
    }

    fn mean(&self, sums: &[f64]) -> f64 {
        let num = self.num_windows();
        if num == 0.0 {
            return 1.0;
        }
        sums.iter().sum::<f64>() / num
    }
}

/// Buffers that a thread keeps between bands.
#[derive(Default)]
struct BandScratch {
    /// The moments of a row before blurring, each between RADIUS zeros.
    padded: Vec<f32>,
    /// `[band rows + 2 RADIUS, NUM_MOMENTS, width]`, blurred along x.
    blurred: Vec<f32>,
    /// `[NUM_MOMENTS, width]`, blurred along both.
    moments: Vec<f32>,
}

/// Sum of the similarity over rows `rows` of one channel. Where `partials_out` is given, its rows
/// `[rows, NUM_PARTIALS, width]` receive the partial derivatives, already blurred along x.
fn similarity_of_band(
    pair: &Pair<'_>,
    channel: usize,
    rows: std::ops::Range<usize>,
    scratch: &mut BandScratch,
    mut partials_out: Option<&mut [f32]>,
) -> f64 {
    let (width, height) = (pair.width(), pair.height());
    let padded_width = width + 2 * RADIUS;
    let stride = NUM_MOMENTS * width;
    let BandScratch {
        padded,
        blurred,
        moments,
    } = scratch;
    padded.clear();
    padded.resize(NUM_MOMENTS * padded_width, 0.0);
    blurred.resize((rows.len() + 2 * RADIUS) * stride, 0.0);
    moments.resize(stride, 0.0);

    for (i, blurred_row) in blurred.chunks_exact_mut(stride).enumerate() {
        let Some(y) = (rows.start + i).checked_sub(RADIUS).filter(|y| *y < height) else {
            blurred_row.fill(0.0);
            continue;
        };
        let line = y * width..(y + 1) * width;
        fill_moments(
            &pair.reference.pixels()[line.clone()],
            &pair.test.pixels()[line],
            channel,
            padded,
        );
        for (out, padded) in blurred_row
            .chunks_exact_mut(width)
            .zip(padded.chunks_exact(padded_width))
        {
            blur_row(padded, out);
        }
    }

    let mut sum = 0.0;
    for i in 0..rows.len() {
        blur_columns(&blurred[i * stride..], stride, moments);
        let counts = pair.counts(rows.start + i);
        match partials_out.as_deref_mut() {
            None => sum += row_similarity(moments, counts),
            Some(partials_out) => {
                // The padding stays zero: only the inside of each padded row is written.
                sum += row_similarity_and_partials(moments, counts, padded);
                for (out, padded) in partials_out[i * NUM_PARTIALS * width..]
                    .chunks_exact_mut(width)
                    .zip(padded.chunks_exact(padded_width).take(NUM_PARTIALS))
                {
                    blur_row(padded, out);
                }
            }
        }
    }
    sum
}

/// Writes x, y, x² + y² and x y of a row between their paddings.
fn fill_moments(reference: &[[f32; 3]], test: &[[f32; 3]], channel: usize, padded: &mut [f32]) {
    let width = reference.len();
    let [m_x, m_y, q, p] = insides::<NUM_MOMENTS>(padded, width);
    for x in 0..width {
        let (a, b) = (reference[x][channel], test[x][channel]);
        m_x[x] = a;
        m_y[x] = b;
        q[x] = a * a + b * b;
        p[x] = a * b;
    }
}

/// The first `N` padded rows of `padded` without their padding.
fn insides<const N: usize>(padded: &mut [f32], width: usize) -> [&mut [f32]; N] {
    let mut rows = padded.chunks_exact_mut(width + 2 * RADIUS);
    std::array::from_fn(|_| match rows.next() {
        Some(row) => &mut row[RADIUS..RADIUS + width],
        None => &mut [],
    })
}

/// S at one pixel, with its two denominators' inverses and its two numerators.
struct Similarity {
    value: f32,
    numerator_mean: f32,
    numerator_structure: f32,
    inverse_mean: f32,
    inverse_structure: f32,
}

#[inline(always)]
fn similarity([m_x, m_y, q, p]: [f32; NUM_MOMENTS]) -> Similarity {
    let product = m_x * m_y;
    let squares = m_x * m_x + m_y * m_y;
    let numerator_mean = 2.0 * product + C1;
    let numerator_structure = 2.0 * (p - product) + C2;
    let inverse_mean = 1.0 / (squares + C1);
    let inverse_structure = 1.0 / (q - squares + C2);
    Similarity {
        value: numerator_mean * numerator_structure * (inverse_mean * inverse_structure),
        numerator_mean,
        numerator_structure,
        inverse_mean,
        inverse_structure,
    }
}

fn row_similarity(moments: &[f32], counts: Option<&[bool]>) -> f64 {
    let width = moments.len() / NUM_MOMENTS;
    let (m_x, rest) = moments.split_at(width);
    let (m_y, rest) = rest.split_at(width);
    let (q, p) = rest.split_at(width);
    let mut sum = 0.0;
    for x in 0..width {
        if counts.is_none_or(|counts| counts[x]) {
            sum += f64::from(similarity([m_x[x], m_y[x], q[x], p[x]]).value);
        }
    }
    sum
}

/// Sum of S over the row; ∂S/∂m_y, ∂S/∂q and ∂S/∂p go inside the first padded rows.
fn row_similarity_and_partials(
    moments: &[f32],
    counts: Option<&[bool]>,
    padded: &mut [f32],
) -> f64 {
    let width = moments.len() / NUM_MOMENTS;
    let (m_x, rest) = moments.split_at(width);
    let (m_y, rest) = rest.split_at(width);
    let (q, p) = rest.split_at(width);
    let p = &p[..width];
    let [d_mean, d_q, d_p, values] = insides::<NUM_MOMENTS>(padded, width);
    for x in 0..width {
        let s = similarity([m_x[x], m_y[x], q[x], p[x]]);
        let inverse = s.inverse_mean * s.inverse_structure;
        let by_product = 2.0 * m_x[x] * (s.numerator_structure - s.numerator_mean) * inverse;
        let by_squares = 2.0 * m_y[x] * s.value * (s.inverse_structure - s.inverse_mean);
        d_mean[x] = by_product + by_squares;
        d_q[x] = -s.value * s.inverse_structure;
        d_p[x] = 2.0 * s.numerator_mean * inverse;
        values[x] = s.value;
    }
    for (x, counts) in counts.into_iter().flatten().enumerate() {
        if !counts {
            [d_mean[x], d_q[x], d_p[x], values[x]] = [0.0; NUM_MOMENTS];
        }
    }
    // A loop of its own, so that the compiler vectorises the one above in spite of the ordered sum.
    values.iter().map(|value| f64::from(*value)).sum()
}

/// Blurs the partials along y and assembles the gradient.
fn gradient(pair: &Pair<'_>, partials: &[f32]) -> Image<3> {
    let (width, height) = (pair.width(), pair.height());
    let stride = NUM_PARTIALS * width;
    let plane = (height + 2 * RADIUS) * stride;
    let scale = (1.0 / pair.num_windows().max(1.0)) as f32;
    let mut d_test = Image::filled(pair.test.width(), pair.test.height(), [0.0; 3]);
    d_test
        .pixels_mut()
        .par_chunks_mut(width)
        .zip(pair.reference.pixels().par_chunks(width))
        .zip(pair.test.pixels().par_chunks(width))
        .enumerate()
        .with_min_len(8)
        .for_each_init(
            || vec![0.0_f32; stride],
            |blurred, (y, ((out, reference), test))| {
                for channel in 0..3 {
                    blur_columns(&partials[channel * plane + y * stride..], stride, blurred);
                    let (d_mean, rest) = blurred.split_at(width);
                    let (d_q, d_p) = rest.split_at(width);
                    for x in 0..width {
                        out[x][channel] = scale
                            * (d_mean[x]
                                + 2.0 * test[x][channel] * d_q[x]
                                + reference[x][channel] * d_p[x]);
                    }
                }
            },
        );
    d_test
}

#[cfg(test)]
mod tests;
