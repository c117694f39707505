//! Colours between the samples of a colour filter array.
//!
//! The methods are those of the crate `demosaic`. A lamp is a thousand times as bright as the wall beside it, and filters with
//! negative lobes draw dark or coloured rims around it; so they work on the fourth root of the signal, where the lamp is six times as
//! bright. That also turns differences of colours into something like quotients, which change less from pixel to pixel. Noise is not
//! biased by more than rounding: where it matters, near black, the scale is linear.

use crate::raw::{Header, Layout};
use ::demosaic::{Algorithm, CfaPattern, Channel, demosaic};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How colours are interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Demosaic {
    /// Means of neighbours: fast, soft.
    Bilinear,
    /// Malvar, He and Cutler, ICASSP 2004: linear filters across channels. Bayer only.
    Mhc,
    /// Patterned pixel grouping: along the weaker gradient. Bayer only.
    #[default]
    Ppg,
    /// Variable number of gradients. Bayer only.
    Vng,
    /// Adaptive homogeneity-directed. Bayer only.
    Ahd,
}

/// Rows that are interpolated at once, a multiple of every pattern.
const STRIP_ROWS: usize = 96;
/// Rows beside a strip that its pixels depend on at most, a multiple of every pattern.
const MARGIN_ROWS: usize = 24;

/// The pattern of the crate, and the method for it; `None` for linear RGB.
fn plan(header: &Header, method: Demosaic) -> Option<(CfaPattern, Algorithm)> {
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
        return Some((CfaPattern::xtrans(pattern), algorithm));
    }
    let pattern = match channels.as_slice() {
        [0, 1, 1, 2] => CfaPattern::bayer_rggb(),
        [2, 1, 1, 0] => CfaPattern::bayer_bggr(),
        [1, 0, 2, 1] => CfaPattern::bayer_grbg(),
        _ => CfaPattern::bayer_gbrg(),
    };
    let algorithm = match method {
        Demosaic::Bilinear => Algorithm::Bilinear,
        Demosaic::Mhc => Algorithm::Mhc,
        Demosaic::Ppg => Algorithm::Ppg,
        Demosaic::Vng => Algorithm::Vng,
        Demosaic::Ahd => Algorithm::Ahd,
    };
    Some((pattern, algorithm))
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

/// Colours at every pixel of a mosaic `[height, width]`, or of interleaved RGB as it is. Samples keep their values.
///
/// `floor` is the signal below which the compressed scale becomes linear: a few times the noise of the dark.
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
    let Some((pattern, algorithm)) = plan(header, method) else {
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
            let mut planes = vec![0.0_f32; 3 * part.len()];
            let done = demosaic(
                &compressed,
                width,
                last - first,
                &pattern,
                algorithm,
                &mut planes,
            );
            assert!(
                done.is_ok(),
                "{algorithm} fits {pattern} and {width} columns: {done:?}"
            );
            for (row, colors) in colors.chunks_mut(width).enumerate() {
                let from = (top + row - first) * width;
                for (channel, plane) in planes.chunks_exact(part.len()).enumerate() {
                    for (color, value) in colors.iter_mut().zip(&plane[from..from + width]) {
                        color[channel] = curve.expand(*value);
                    }
                }
                confine(header, samples, top + row, colors);
                let measured = &samples[(top + row) * width..][..width];
                for (column, (color, value)) in colors.iter_mut().zip(measured).enumerate() {
                    color[header.channel(top + row, column)] = *value;
                }
            }
        });
    colors
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

/// How many times as bright as a sample the brightest around it has to be for the place to count as beside a lamp.
const LAMP_CONTRAST: f32 = 12.0;
/// How far an interpolated value may leave the range of its neighbours there.
const LAMP_SLACK: f32 = 1.25;
/// Pixels to each side that count for the contrast: what the filters reach.
const LAMP_REACH: usize = 3;

/// Beside lamps, keeps interpolated values near the range of the measured ones of their channel beside them. Elsewhere filters
/// are right to leave that range, and better for it, also where a lamp fills part of a pixel.
fn confine(header: &Header, samples: &[f32], row: usize, colors: &mut [[f32; 3]]) {
    let (width, height) = (header.width as usize, header.height as usize);
    let line = |y: usize| &samples[y * width..][..width];
    let mut high = line(row).to_vec();
    for y in row.saturating_sub(LAMP_REACH)..(row + LAMP_REACH + 1).min(height) {
        for (high, value) in high.iter_mut().zip(line(y)) {
            *high = high.max(*value);
        }
    }
    for (column, color) in colors.iter_mut().enumerate() {
        let reach = column.saturating_sub(LAMP_REACH)..(column + LAMP_REACH + 1).min(width);
        let brightest = high[reach].iter().copied().fold(0.0, f32::max);
        if brightest < LAMP_CONTRAST * line(row)[column].max(f32::MIN_POSITIVE) {
            continue;
        }
        // The pixel's own sample counts for all channels: a dark wire before a window has no neighbour that is as dark.
        let own = line(row)[column];
        let mut range = [(own, own); 3];
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let (low, high) = &mut range[header.channel(y, x)];
                let value = samples[y * width + x];
                *low = low.min(value);
                *high = high.max(value);
            }
        }
        for (value, (low, high)) in color.iter_mut().zip(range) {
            if low > 0.0 && low <= high {
                *value = value.clamp(low / LAMP_SLACK, high * LAMP_SLACK);
            }
        }
    }
}
