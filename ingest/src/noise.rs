//! The noise of a sensor: a Poisson–Gaussian model, from metadata or from the shots of a stack.
//!
//! Values are fractions of the range from black to white. A value with expectation x has the
//! variance gain · x + read: photon noise and what reading adds (Foi et al., "Practical
//! Poissonian-Gaussian noise modeling and fitting for single-image raw-data", IEEE TIP 2008). Two
//! shots of one scene tell both numbers without knowing the scene: where the longer has r times the
//! exposure of the shorter, x_long − r·x_short has mean 0 and variance gain · (r + r²) x_short +
//! read · (1 + r²).

use crate::stack::Shot;
use eagpt_scene::median::{SIGMA_OF_MAD, median_of};
use serde::{Deserialize, Serialize};

/// Noise variance gain · x + read of a value x, where saturation is 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Variance per signal: one over the electrons of a full well.
    pub gain: f32,
    /// Variance without light.
    pub read: f32,
    /// Source of the numbers.
    pub source: NoiseSource,
}

/// Source of a noise model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseSource {
    /// The file's NoiseProfile.
    Metadata,
    /// The shots of the stack.
    Stack,
    /// Assumed values of an ordinary sensor.
    Assumed,
}

impl Noise {
    /// An ordinary sensor at its base sensitivity: a full well of 20,000 electrons, read noise of
    /// 1/4000 of the range.
    pub(crate) const ASSUMED: Self = Self {
        gain: 1.0 / 20_000.0,
        read: 1.0 / (4000.0 * 4000.0),
        source: NoiseSource::Assumed,
    };

    /// The model that a file states, where it can be one.
    pub(crate) fn from_profile([gain, read]: [f64; 2]) -> Self {
        Self {
            gain: (gain as f32).clamp(MIN_GAIN, MAX_GAIN),
            read: (read as f32).clamp(MIN_READ, MAX_READ),
            source: NoiseSource::Metadata,
        }
    }

    /// Variance of a value with expectation `x`.
    pub fn variance(&self, x: f32) -> f32 {
        self.gain * x.max(0.0) + self.read
    }
}

/// Physical limits of a sensor: the quantisation of 16 bits, a full well of ten million electrons
/// or of twenty.
const MIN_READ: f32 = 1.0 / (65_535.0 * 65_535.0 * 12.0);
const MAX_READ: f32 = 1e-2;
const MIN_GAIN: f32 = 1e-7;
const MAX_GAIN: f32 = 0.05;
/// Samples taken from each pair of shots: enough for a variance to half a percent in each bin.
const SAMPLES_PER_PAIR: usize = 400_000;
/// Bins of the signal, spread evenly over its logarithm.
const NUM_BINS: usize = 24;
/// Fewest samples of a bin.
const MIN_IN_BIN: usize = 200;

/// One bin of one pair: the variance should be gain · signal + read.
#[derive(Debug, Clone, Copy)]
struct Point {
    signal: f64,
    variance: f64,
    weight: f64,
}

/// Estimates the noise from shots of one scene, sorted by exposure; `None` if they overlap too
/// little.
///
/// Variances are computed from medians, so that motion between shots and inexact exposures count
/// little.
pub(crate) fn estimate(shots: &[Shot<'_>], clip: f32) -> Option<Noise> {
    let mut points = Vec::new();
    for pair in shots.windows(2) {
        points.extend(pair_points(&pair[0], &pair[1], clip));
    }
    let (gain, read) = fit(&points)?;
    Some(Noise {
        gain: (gain as f32).clamp(MIN_GAIN, MAX_GAIN),
        read: (read as f32).clamp(MIN_READ, MAX_READ),
        source: NoiseSource::Stack,
    })
}

fn pair_points(short: &Shot<'_>, long: &Shot<'_>, clip: f32) -> Vec<Point> {
    let header = &short.frame.header;
    let (rows, row_len) = (header.height as usize, header.row_len());
    let ratio = long.exposure / short.exposure;
    let step = (rows * row_len / SAMPLES_PER_PAIR).max(1);
    let mut bins: Vec<Vec<(f32, f32)>> = vec![Vec::new(); NUM_BINS];
    let (mut a, mut b) = (vec![0.0; row_len], vec![0.0; row_len]);
    for row in (0..rows).step_by(step) {
        short.frame.scaled_row(row, &mut a);
        long.frame.scaled_row(row, &mut b);
        for (&x_short, &x_long) in a.iter().zip(&b) {
            if x_short < clip && x_long < clip {
                // By the longer shot, whose signal is more exact.
                let bin = bin_of(x_long);
                bins[bin].push((x_long, x_long - ratio as f32 * x_short));
            }
        }
    }
    let squares = 1.0 + ratio * ratio;
    bins.into_iter()
        .filter(|bin| bin.len() >= MIN_IN_BIN)
        .map(|bin| {
            let num = bin.len() as f64;
            let mean = bin.iter().map(|(x, _)| f64::from(*x)).sum::<f64>() / num;
            let residuals: Vec<f32> = bin.into_iter().map(|(_, d)| d).collect();
            let middle = median_of(residuals.iter().copied());
            let deviations = residuals.iter().map(|d| (d - middle).abs());
            let sigma = SIGMA_OF_MAD * f64::from(median_of(deviations));
            Point {
                signal: mean.max(0.0) / ratio * (ratio + ratio * ratio) / squares,
                variance: sigma * sigma / squares,
                weight: num,
            }
        })
        .collect()
}

/// Bin of a signal: evenly over log2 from 2^-12 to 1.
fn bin_of(x: f32) -> usize {
    let position = (x.max(1e-6).log2() + 12.0) / 12.0;
    ((position * NUM_BINS as f32).max(0.0) as usize).min(NUM_BINS - 1)
}

/// Line through points whose spread is proportional to their height; found by weighting with the
/// last line's heights.
fn fit(points: &[Point]) -> Option<(f64, f64)> {
    let usable: Vec<Point> = points
        .iter()
        .copied()
        .filter(|p| p.variance > 0.0)
        .collect();
    if usable.len() < 3 {
        return None;
    }
    let mut heights: Vec<f64> = usable.iter().map(|p| p.variance).collect();
    let mut line = None;
    for _ in 0..8 {
        let (mut s, mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (p, height) in usable.iter().zip(&heights) {
            let w = p.weight / (height * height);
            s += w;
            sx += w * p.signal;
            sxx += w * p.signal * p.signal;
            sy += w * p.variance;
            sxy += w * p.signal * p.variance;
        }
        let determinant = s * sxx - sx * sx;
        // A single level of signal does not determine two numbers.
        if determinant.is_nan() || determinant <= 1e-9 * s * sxx {
            return None;
        }
        let gain = ((s * sxy - sx * sy) / determinant).max(f64::from(MIN_GAIN));
        let read = ((sxx * sy - sx * sxy) / determinant).max(f64::from(MIN_READ));
        line = Some((gain, read));
        heights = usable.iter().map(|p| gain * p.signal + read).collect();
    }
    line
}
