//! Colours where light changes steeply from pixel to pixel.
//!
//! A detail as thin as a pixel before a window or beside a lamp is sampled by one channel of the
//! mosaic and missed by its neighbours, so that any interpolation makes it magenta, blue or green.
//! The pixel's own sample gives the brightness; the colour is the most common one around it (the
//! median of the differences of channels: Freeman, "Median filter for reconstructing missing color
//! samples", US patent 4,724,395, 1988). On the compressed scale of the interpolation differences
//! correspond to quotients of channels, so that a lamp and the wall beside it have equal weight. A
//! thin coloured line of high contrast takes the colour of its surroundings.

use crate::raw::Header;

/// Ratio of the brightest to the darkest sample around a pixel from which on colours are median
/// filtered. Measured on rendered kitchens: 2 to 12 are alike beside lamps; noise and even textures
/// are unchanged from 3 on, and 6 filters half as many pixels as 3 does.
const STEEP: f32 = 6.0;
/// Half the window of that ratio and of the median, pixels.
const REACH: usize = 2;
/// Of these, every other one: as good as all 25, at half the work.
const NUM_ASKED: usize = 13;

/// Rows of a mosaic and what was interpolated from them, all on the compressed scale.
pub(super) struct Strip<'a> {
    /// Layout and width.
    pub(super) header: &'a Header,
    /// Row of the mosaic that the strip starts with.
    pub(super) first: usize,
    /// Measured, `[rows, width]`.
    pub(super) samples: &'a [f32],
    /// Red, green, blue, each `[rows, width]`.
    pub(super) planes: [&'a [f32]; 3],
    /// The same by the method for steep edges.
    pub(super) at_edges: [&'a [f32]; 3],
    /// Offset of zero on the compressed scale: the root of the floor, as the scale is a root of
    /// signal plus floor.
    pub(super) root: f32,
}

impl Strip<'_> {
    /// The colours of a row of the mosaic, on the compressed scale.
    pub(super) fn row(&self, row: usize, colors: &mut [[f32; 3]]) {
        let width = colors.len();
        let from = (row - self.first) * width;
        for (channel, plane) in self.planes.iter().enumerate() {
            for (color, value) in colors.iter_mut().zip(&plane[from..from + width]) {
                color[channel] = *value;
            }
        }
        let [low, high] = self.range(row - self.first, width);
        let factor = STEEP.sqrt().sqrt();
        for (column, color) in colors.iter_mut().enumerate() {
            if high[column] > factor * low[column] {
                *color = self.steadied(row, column, width);
            }
        }
    }

    /// Fourth roots of the least and the largest sample, floor added, around each pixel of a row of
    /// the strip.
    fn range(&self, row: usize, width: usize) -> [Vec<f32>; 2] {
        let rows = self.samples.len() / width;
        let (mut low, mut high) = (vec![f32::INFINITY; width], vec![0.0_f32; width]);
        for line in self
            .samples
            .chunks_exact(width)
            .take((row + REACH + 1).min(rows))
            .skip(row.saturating_sub(REACH))
        {
            for ((low, high), value) in low.iter_mut().zip(&mut high).zip(line) {
                let value = value.max(0.0) + self.root;
                *low = low.min(value);
                *high = high.max(value);
            }
        }
        [widened(&low, f32::min), widened(&high, f32::max)]
    }

    /// The pixel's own sample with the median colour of its surroundings.
    fn steadied(&self, row: usize, column: usize, width: usize) -> [f32; 3] {
        let rows = self.samples.len() / width;
        let mut differences = [[0.0_f32; 2]; NUM_ASKED];
        let mut num = 0;
        // Beyond the border the pixels at the border are repeated.
        let inside = |at: usize, offset: usize, size: usize| {
            (at + offset).saturating_sub(REACH).min(size - 1)
        };
        for dy in 0..=2 * REACH {
            let line = inside(row - self.first, dy, rows) * width;
            for dx in (dy % 2..=2 * REACH).step_by(2) {
                let index = line + inside(column, dx, width);
                let [r, g, b] = self.at_edges.map(|plane| plane[index]);
                differences[num] = [r - g, b - g];
                num += 1;
            }
        }
        let [red, blue] = medians(differences);
        let from_green = [red, 0.0, blue];
        let own = self.samples[(row - self.first) * width + column];
        let green = own - from_green[self.header.channel(row, column)];
        from_green.map(|difference| green + difference)
    }
}

/// The extreme of each value and those within reach in the same row.
fn widened(values: &[f32], extreme: impl Fn(f32, f32) -> f32) -> Vec<f32> {
    let mut out = values.to_vec();
    for offset in 1..=REACH.min(values.len() - 1) {
        let num = values.len() - offset;
        for i in 0..num {
            out[i] = extreme(out[i], values[i + offset]);
        }
        for i in 0..num {
            out[i + offset] = extreme(out[i + offset], values[i]);
        }
    }
    out
}

/// Medians of the first and of the second numbers. The minimum and the maximum of just over half of
/// the numbers cannot be the median; they are dropped and the next number is taken in, until the
/// median is left. Branch-free, as branches would be unpredictable.
fn medians(mut values: [[f32; 2]; NUM_ASKED]) -> [f32; 2] {
    const LAST: usize = NUM_ASKED / 2 + 1;
    let order = |values: &mut [[f32; 2]; NUM_ASKED], low: usize, high: usize| {
        let (a, b) = (values[low], values[high]);
        let is_less = [a[0] < b[0], a[1] < b[1]];
        values[low] = [0, 1].map(|i: usize| if is_less[i] { a[i] } else { b[i] });
        values[high] = [0, 1].map(|i: usize| if is_less[i] { b[i] } else { a[i] });
    };
    for first in 0..LAST - 1 {
        for i in first + 1..=LAST {
            order(&mut values, first, i);
        }
        for i in first + 1..LAST {
            order(&mut values, i, LAST);
        }
        if LAST + 1 + first < NUM_ASKED {
            values[LAST] = values[LAST + 1 + first];
        }
    }
    values[LAST - 1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    #[test]
    fn medians_are_those_of_sorted_values() {
        let key = RandomKey::new(4, Purpose::Render, 0);
        for element in 0..200 {
            let mut stream = key.stream(element, 0);
            let values = [(); NUM_ASKED].map(|()| {
                let [a, b, ..] = stream.next_uniforms();
                // Many of the second are equal.
                [a - 0.5, (4.0 * b).floor()]
            });
            let sorted = [0, 1].map(|part: usize| {
                let mut part = values.map(|value| value[part]);
                part.sort_by(f32::total_cmp);
                part[NUM_ASKED / 2]
            });
            assert_eq!(medians(values), sorted);
        }
    }
}
