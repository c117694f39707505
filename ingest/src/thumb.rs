//! Block means of a shot, by which shots of a stack are compared.

use crate::noise::Noise;
use crate::raw::RawFrame;
use eagpt_scene::median::median_of;
use rayon::prelude::*;

/// A shot in blocks of pixels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Thumb {
    /// Mean of each channel over each block, as fractions of the range.
    pub(crate) means: Vec<[f32; 3]>,
    /// Largest sample of each block.
    pub(crate) largest: Vec<f32>,
    /// Green samples of a block, about.
    pub(crate) num_green: f32,
}

/// Blocks along the longer side.
const BLOCKS: usize = 96;
/// Blocks with a larger relative noise of their mean are not used for ratios.
const MAX_RELATIVE_NOISE: f32 = 0.05;
/// Fewest blocks for a ratio.
const MIN_BLOCKS: usize = 12;
/// Change of a block between two shots, as a share, above which it counts as moved; it must exceed
/// the noise as well.
const MOVED_SHARE: f32 = 0.05;
const MOVED_SIGMAS: f32 = 6.0;

impl Thumb {
    /// Block means of a shot.
    pub(crate) fn new(frame: &RawFrame) -> Self {
        let header = &frame.header;
        let (width, height, row_len) = (
            header.width as usize,
            header.height as usize,
            header.row_len(),
        );
        let long = width.max(height);
        let blocks_of = |side: usize| (side * BLOCKS / long).clamp(1, side.div_ceil(6));
        let (columns, rows) = (blocks_of(width), blocks_of(height));
        let per_pixel = row_len / width;
        let blocks: Vec<Vec<([f32; 3], f32)>> = (0..rows)
            .into_par_iter()
            .map_init(
                || vec![0.0_f32; row_len],
                |line, block_row| {
                    let mut sums = vec![([0.0_f64; 3], [0_u32; 3], 0.0_f32); columns];
                    for row in block_row * height / rows..(block_row + 1) * height / rows {
                        frame.scaled_row(row, line);
                        let channels: Vec<usize> =
                            (0..36).map(|s| header.channel(row, s)).collect();
                        for (block, sum) in sums.iter_mut().enumerate() {
                            let from = block * width / columns * per_pixel;
                            let to = (block + 1) * width / columns * per_pixel;
                            for (offset, value) in line[from..to].iter().enumerate() {
                                // 36 is a multiple of every pattern.
                                let channel = channels[(from + offset) % 36];
                                sum.0[channel] += f64::from(*value);
                                sum.1[channel] += 1;
                                sum.2 = sum.2.max(*value);
                            }
                        }
                    }
                    let mean = |sum: f64, count: u32| (sum / f64::from(count.max(1))) as f32;
                    sums.into_iter()
                        .map(|(sums, counts, largest)| {
                            ([0, 1, 2].map(|c| mean(sums[c], counts[c])), largest)
                        })
                        .collect()
                },
            )
            .collect();
        let blocks = blocks.concat();
        let num_green =
            (width * height) as f32 / blocks.len() as f32 / if per_pixel == 3 { 1.0 } else { 2.0 };
        Self {
            means: blocks.iter().map(|block| block.0).collect(),
            largest: blocks.iter().map(|block| block.1).collect(),
            num_green,
        }
    }

    /// Share of blocks with a clipped sample.
    pub(crate) fn clipped_share(&self, clip: f32) -> f64 {
        let count = self.largest.iter().filter(|v| **v >= clip).count();
        count as f64 / self.largest.len().max(1) as f64
    }
}

/// Comparison of two shots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Comparison {
    /// Exposure of the longer over that of the shorter, measured; `None` if too little of the scene
    /// is well exposed in both.
    pub(crate) ratio: Option<f64>,
    /// Share of the comparable blocks that changed otherwise than by the ratio.
    pub(crate) moved: Option<f64>,
}

/// Compares a shot with a longer one by the green of their blocks.
pub(crate) fn compare(short: &Thumb, long: &Thumb, noise: &Noise, clip: f32) -> Comparison {
    let deviation = |x: f32| (noise.variance(x) / short.num_green).sqrt();
    let comparable = (0..short.means.len().min(long.means.len())).filter(|&block| {
        let x = short.means[block][1];
        long.largest[block] < clip && x > 0.0 && deviation(x) < MAX_RELATIVE_NOISE * x
    });
    let pairs: Vec<(f32, f32)> = comparable
        .map(|block| (short.means[block][1], long.means[block][1]))
        .collect();
    if pairs.len() < MIN_BLOCKS {
        return Comparison {
            ratio: None,
            moved: None,
        };
    }
    let ratio = median_of(pairs.iter().map(|(x, y)| y / x));
    let moved = pairs.iter().filter(|(x, y)| {
        let sigma = (noise.variance(*y) / short.num_green).sqrt() + ratio * deviation(*x);
        (y - ratio * x).abs() > MOVED_SIGMAS * sigma + MOVED_SHARE * y.abs()
    });
    Comparison {
        ratio: Some(f64::from(ratio)),
        moved: Some(moved.count() as f64 / pairs.len() as f64),
    }
}
