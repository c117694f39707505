//! Colours between the samples of a colour filter array.
//!
//! The methods are those of the crate `demosaic`. A lamp is a thousand times as bright as the wall
//! beside it, and filters with negative lobes cause dark or coloured rims around it; so they are
//! applied to the fourth root of the signal, where the lamp is six times as bright. That also turns
//! differences of colours into approximate quotients, which vary less from pixel to pixel. Noise is
//! not biased by more than rounding: where it matters, near black, the scale is linear. `steep`
//! handles the remaining artefacts at steep edges.

mod steep;

#[cfg(test)]
mod tests;

use crate::raw::{Header, Layout};
use ::demosaic::{Algorithm, CfaPattern, Channel, demosaic};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use steep::Strip;

/// Demosaicing method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Demosaic {
    /// Means of neighbours
    Bilinear,
    /// Malvar, He and Cutler's linear filters
    ///
    /// ICASSP 2004; across channels. Bayer only.
    Mhc,
    /// Patterned pixel grouping
    ///
    /// Along the weaker gradient. Bayer only.
    #[default]
    Ppg,
    /// Variable number of gradients
    ///
    /// Bayer only.
    Vng,
    /// Adaptive homogeneity-directed
    ///
    /// Bayer only.
    Ahd,
}

/// Rows that are interpolated at once, a multiple of every pattern.
const STRIP_ROWS: usize = 96;
/// Rows beside a strip that its pixels depend on at most, a multiple of every pattern.
const MARGIN_ROWS: usize = 24;

/// Algorithms of the crate for a method.
struct Plan {
    pattern: CfaPattern,
    algorithm: Algorithm,
    /// The method for steep edges: one that adapts to their direction, unlike linear filters.
    at_edges: Algorithm,
}

impl Plan {
    /// Red, green and blue, one after the other, at each of `samples`.
    fn planes(&self, algorithm: Algorithm, samples: &[f32], width: usize) -> Vec<f32> {
        let mut planes = vec![0.0_f32; 3 * samples.len()];
        let rows = samples.len() / width;
        let done = demosaic(samples, width, rows, &self.pattern, algorithm, &mut planes);
        assert!(
            done.is_ok(),
            "{algorithm} fits {} and {width} columns: {done:?}",
            self.pattern
        );
        planes
    }
}

/// The plan for a method; `None` for linear RGB.
fn plan(header: &Header, method: Demosaic) -> Option<Plan> {
    let Layout::Mosaic {
        columns, channels, ..
    } = &header.layout
    else {
        return None;
    };
    if *columns == 6 {
        let mut pattern = [Channel::Green; 36];
        for (entry, channel) in pattern.iter_mut().zip(channels) {
            *entry = match channel {
                0 => Channel::Red,
                2 => Channel::Blue,
                _ => Channel::Green,
            };
        }
        let algorithm = match method {
            Demosaic::Bilinear => Algorithm::Bilinear,
            _ => Algorithm::Markesteijn1,
        };
        return Some(Plan {
            pattern: CfaPattern::xtrans(pattern),
            algorithm,
            at_edges: Algorithm::Markesteijn1,
        });
    }
    let pattern = match channels.as_slice() {
        [0, 1, 1, 2] => CfaPattern::bayer_rggb(),
        [2, 1, 1, 0] => CfaPattern::bayer_bggr(),
        [1, 0, 2, 1] => CfaPattern::bayer_grbg(),
        _ => CfaPattern::bayer_gbrg(),
    };
    let (algorithm, at_edges) = match method {
        Demosaic::Bilinear => (Algorithm::Bilinear, Algorithm::Ppg),
        Demosaic::Mhc => (Algorithm::Mhc, Algorithm::Ppg),
        Demosaic::Ppg => (Algorithm::Ppg, Algorithm::Ppg),
        Demosaic::Vng => (Algorithm::Vng, Algorithm::Vng),
        Demosaic::Ahd => (Algorithm::Ahd, Algorithm::Ahd),
    };
    Some(Plan {
        pattern,
        algorithm,
        at_edges,
    })
}

/// Whether the pattern of a file is one that can be interpolated.
pub(crate) fn is_known(layout: &Layout) -> bool {
    match layout {
        Layout::Rgb => true,
        Layout::Mosaic {
            columns: 2,
            rows: 2,
            channels,
        } => matches!(
            channels.as_slice(),
            [0, 1, 1, 2] | [2, 1, 1, 0] | [1, 0, 2, 1] | [1, 2, 0, 1]
        ),
        Layout::Mosaic { columns, rows, .. } => (*columns, *rows) == (6, 6),
    }
}

/// Colours at every pixel of a mosaic `[height, width]`, or of interleaved RGB as it is. Samples
/// keep their values.
///
/// `floor` is the signal below which the compressed scale becomes linear: a few times the noise of
/// the dark.
///
/// # Panics
/// If there are not as many samples as the header says, or the pattern is none of [`is_known`].
pub(crate) fn interpolate(
    header: &Header,
    samples: &[f32],
    method: Demosaic,
    floor: f32,
) -> Vec<[f32; 3]> {
    let (width, height) = (header.width as usize, header.height as usize);
    assert_eq!(samples.len(), header.row_len() * height, "samples");
    let mut colors = vec![[0.0_f32; 3]; width * height];
    let Some(plan) = plan(header, method) else {
        let pixels = samples
            .par_chunks(3 * 4096)
            .zip(colors.par_chunks_mut(4096));
        pixels.for_each(|(samples, colors)| colors.as_flattened_mut().copy_from_slice(samples));
        return colors;
    };
    let curve = Curve::new(floor);
    colors
        .par_chunks_mut(STRIP_ROWS * width)
        .enumerate()
        .for_each(|(strip, colors)| {
            let top = strip * STRIP_ROWS;
            let rows = colors.len() / width;
            let first = top.saturating_sub(MARGIN_ROWS);
            let last = (top + rows + MARGIN_ROWS).min(height);
            let part = &samples[first * width..last * width];
            let compressed: Vec<f32> = part.iter().map(|v| curve.compress(*v)).collect();
            let planes = plan.planes(plan.algorithm, &compressed, width);
            let others = (plan.at_edges != plan.algorithm)
                .then(|| plan.planes(plan.at_edges, &compressed, width));
            let strip = Strip {
                header,
                first,
                samples: &compressed,
                planes: by_channel(&planes),
                at_edges: by_channel(others.as_deref().unwrap_or(&planes)),
                root: curve.root,
            };
            for (row, colors) in colors.chunks_mut(width).enumerate() {
                strip.row(top + row, colors);
                for value in colors.as_flattened_mut() {
                    *value = curve.expand(*value);
                }
                let measured = &samples[(top + row) * width..][..width];
                for (column, (color, value)) in colors.iter_mut().zip(measured).enumerate() {
                    color[header.channel(top + row, column)] = *value;
                }
            }
        });
    colors
}

/// Three planes that lie one after the other.
fn by_channel(planes: &[f32]) -> [&[f32]; 3] {
    let num = planes.len() / 3;
    [0, 1, 2].map(|channel| &planes[channel * num..][..num])
}

/// The scale that methods work on: the fourth root well above `floor`, linear below.
#[derive(Debug, Clone, Copy)]
struct Curve {
    floor: f32,
    root: f32,
}

impl Curve {
    fn new(floor: f32) -> Self {
        let root = floor.sqrt().sqrt();
        Self { floor, root }
    }

    #[inline]
    fn compress(self, v: f32) -> f32 {
        let magnitude = (v.abs() + self.floor).sqrt().sqrt() - self.root;
        magnitude.copysign(v)
    }

    #[inline]
    fn expand(self, v: f32) -> f32 {
        let square = (v.abs() + self.root) * (v.abs() + self.root);
        (square * square - self.floor).copysign(v)
    }
}
