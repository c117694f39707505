//! Linear functions fitted to light around every pixel.

use super::Settings;
use super::guides::{Guide, Guides, difference, dot};
use eagpt_scene::color::luminance;
use glam::Vec3;
use rayon::prelude::*;

/// Terms of a function: a constant, the place on the image (2), the normal (3).
const NUM_TERMS: usize = 6;
/// Terms and light, padded to whole SIMD registers.
const WIDTH: usize = 12;
/// Added to the ridge, in pixels: a window with little weight does not determine slopes.
const MIN_SUPPORT: f32 = 0.3;

/// One pixel of the regression.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
struct Sample {
    guide: Guide,
    light: [f32; 3],
    estimate: [f32; 3],
    /// Squared difference of estimates that counts as noise.
    tolerance: f32,
}

/// All pixels.
pub(super) struct Samples<'a> {
    guides: &'a Guides,
    pixels: Vec<Sample>,
}

/// A function fitted around a pixel.
type Fit = [Vec3; NUM_TERMS];

impl<'a> Samples<'a> {
    /// Values to fit with weights by the guides alone.
    pub(super) fn new(guides: &'a Guides, light: &[Vec3]) -> Self {
        let pixels = guides
            .pixels
            .iter()
            .zip(light)
            .map(|(guide, light)| Sample {
                guide: *guide,
                light: light.to_array(),
                estimate: [0.0; 3],
                tolerance: 1.0,
            });
        Self {
            guides,
            pixels: pixels.collect(),
        }
    }

    /// The same with weights by an estimate, too, whose noise is known from that of the values.
    pub(super) fn steered(
        mut self,
        estimate: &[Vec3],
        deviation: &[f32],
        settings: &Settings,
    ) -> Self {
        for (i, sample) in self.pixels.iter_mut().enumerate() {
            sample.estimate = estimate[i].to_array();
            let relative = settings.relative * luminance(sample.estimate);
            sample.tolerance = settings.left * deviation[i].powi(2) + relative.powi(2);
        }
        self
    }

    /// The values of the fitted functions at every pixel.
    pub(super) fn regressed(&self, settings: &Settings) -> Vec<Vec3> {
        let grid = self.guides.grid;
        let stride = settings.stride.max(1);
        let (columns, rows) = (
            (grid.width + stride - 1) / stride,
            (grid.height + stride - 1) / stride,
        );
        let fits: Vec<Option<Fit>> = (0..columns * rows)
            .into_par_iter()
            .with_min_len(16)
            .map(|i| self.fit(i % columns * stride, i / columns * stride, settings))
            .collect();
        // As far as the nearest functions in every direction, and half as far again.
        let reach = if stride == 1 { 1 } else { stride + stride / 2 };
        grid.map(|x, y| {
            let here = &self.pixels[grid.index(x, y)];
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for row in near(y, reach, stride, rows) {
                for column in near(x, reach, stride, columns) {
                    let Some(fit) = &fits[(row * columns + column) as usize] else {
                        continue;
                    };
                    let (dx, dy) = (x - column * stride, y - row * stride);
                    let center = &self.pixels[grid.index(column * stride, row * stride)];
                    let weight = self.weight(center, here, (dx, dy), settings);
                    // The lower bound keeps pixels defined that are similar to none of the fitted.
                    let weight = weight.max(1e-6);
                    sum += value(fit, &terms(center, here, (dx, dy), settings)) * weight;
                    weights += weight;
                }
            }
            if weights > 0.0 {
                sum / weights
            } else {
                here.light.into()
            }
        })
    }

    /// Weighted least squares about (x, y); `None` where nothing reflects.
    fn fit(&self, x: i32, y: i32, settings: &Settings) -> Option<Fit> {
        let grid = self.guides.grid;
        let center = &self.pixels[grid.index(x, y)];
        if center.guide.coverage <= 0.0 {
            return None;
        }
        // Products of the terms with each other and, behind them, with the light; rows of a width
        // that suits SIMD registers.
        let mut products = [[0.0_f32; WIDTH]; NUM_TERMS];
        for (u, v) in grid.window(x, y, settings.radius) {
            let sample = &self.pixels[grid.index(u, v)];
            let weight = self.weight(center, sample, (u - x, v - y), settings);
            if weight == 0.0 {
                continue;
            }
            let mut factors = [0.0; WIDTH];
            let (first, last) = factors.split_at_mut(NUM_TERMS);
            first.copy_from_slice(&terms(center, sample, (u - x, v - y), settings));
            last[..3].copy_from_slice(&sample.light);
            for row in 0..NUM_TERMS {
                let term = weight * factors[row];
                for column in 0..WIDTH {
                    products[row][column] += term * factors[column];
                }
            }
        }
        let support = products[0][0];
        for term in 1..NUM_TERMS {
            products[term][term] += settings.ridge * (support + MIN_SUPPORT);
        }
        Some(solved(&products))
    }

    #[inline(always)]
    fn weight(&self, center: &Sample, other: &Sample, offset: (i32, i32), s: &Settings) -> f32 {
        let (dx, dy) = (offset.0 as f32, offset.1 as f32);
        let deviation = s.spatial * s.radius as f32;
        let change = difference(other.estimate, center.estimate);
        let away = (dx * dx + dy * dy) / (2.0 * deviation * deviation)
            + dot(change, change) / (center.tolerance + other.tolerance + f32::MIN_POSITIVE);
        self.guides.weight(&center.guide, &other.guide, away)
    }
}

#[inline(always)]
fn terms(center: &Sample, other: &Sample, offset: (i32, i32), s: &Settings) -> [f32; NUM_TERMS] {
    let inverse = 1.0 / s.radius as f32;
    let turn = difference(other.guide.normal, center.guide.normal);
    let (dx, dy) = (offset.0 as f32 * inverse, offset.1 as f32 * inverse);
    [1.0, dx, dy, turn[0], turn[1], turn[2]]
}

/// Clamped at 0, as slopes may become negative.
fn value(fit: &Fit, terms: &[f32; NUM_TERMS]) -> Vec3 {
    let sum: Vec3 = fit.iter().zip(terms).map(|(f, term)| *f * *term).sum();
    sum.max(Vec3::ZERO)
}

/// Indices of the functions at most `reach` pixels from position `at` along an axis that has `num`
/// of them.
fn near(at: i32, reach: i32, stride: i32, num: i32) -> std::ops::Range<i32> {
    let first = (at - reach + stride - 1).div_euclid(stride).max(0);
    let last = ((at + reach) / stride).min(num - 1);
    first..last + 1
}

/// Solves symmetric positive definite equations for three right-hand sides by Cholesky's
/// decomposition.
fn solved(products: &[[f32; WIDTH]; NUM_TERMS]) -> Fit {
    let mut lower = [[0.0_f32; NUM_TERMS]; NUM_TERMS];
    for i in 0..NUM_TERMS {
        for j in 0..=i {
            let mut rest = products[i][j];
            for k in 0..j {
                rest -= lower[i][k] * lower[j][k];
            }
            lower[i][j] = if i == j {
                // Rounding may leave nothing of a linearly dependent term; the ridge makes it
                // harmless.
                rest.max(f32::EPSILON * products[i][i] + f32::MIN_POSITIVE)
                    .sqrt()
            } else {
                rest / lower[j][j]
            };
        }
    }
    let mut fit: Fit = products.map(|row| Vec3::from_slice(&row[NUM_TERMS..]));
    for i in 0..NUM_TERMS {
        for k in 0..i {
            let known = fit[k] * lower[i][k];
            fit[i] -= known;
        }
        fit[i] /= lower[i][i];
    }
    for i in (0..NUM_TERMS).rev() {
        for k in i + 1..NUM_TERMS {
            let known = fit[k] * lower[k][i];
            fit[i] -= known;
        }
        fit[i] /= lower[i][i];
    }
    fit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved() {
        // A matrix with 2 on its diagonal and 1 beside it, times (1, −1, 2, 0, 1, 3).
        let expected = [1.0, -1.0, 2.0, 0.0, 1.0, 3.0];
        let sums = [1.0, 1.0, 3.0, 3.0, 5.0, 7.0];
        let mut products = [[0.0; WIDTH]; NUM_TERMS];
        for i in 0..NUM_TERMS {
            products[i][i] = 2.0;
            if i > 0 {
                products[i][i - 1] = 1.0;
                products[i - 1][i] = 1.0;
            }
            let light = [sums[i], 2.0 * sums[i], -sums[i]];
            products[i][NUM_TERMS..NUM_TERMS + 3].copy_from_slice(&light);
        }
        for (found, x) in solved(&products).iter().zip(expected) {
            assert!(
                found.abs_diff_eq(Vec3::new(x, 2.0 * x, -x), 1e-5),
                "{found}"
            );
        }
    }

    #[test]
    fn every_pixel_is_near_a_function() {
        for stride in 1..5 {
            let (size, reach) = (11, if stride == 1 { 1 } else { stride + stride / 2 });
            let num = (size + stride - 1) / stride;
            for at in 0..size {
                let indices = near(at, reach, stride, num);
                assert!(!indices.is_empty());
                for i in indices {
                    assert!(i < num && (i * stride - at).abs() <= reach);
                }
            }
        }
    }
}
