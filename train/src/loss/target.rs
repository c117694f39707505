//! Target image of a view.

use eagpt_scene::Image;
use eagpt_scene::color::pq_from_linear;
use rayon::prelude::*;
use std::sync::Arc;

/// Range that the steps of [`Target`] divide: PQ values stay below it, however bright the light
/// (`(c₂/c₃)^m₂` is 1.99).
pub const PQ_RANGE: f32 = 2.0;

/// PQ values of two neighbours, in one channel, between which there is an edge: less than a
/// display of 8 bits shows as two steps, more than the noise of a clean render. Kitchen, nursery,
/// bistro, gallery, hotel-room and studio have 30 % of their pixels at edges, and 7 to 13 %.
const EDGE: u16 = (0.01 / PQ_RANGE * MOST) as u16;

/// The last step.
const MOST: f32 = u16::MAX as f32;

/// A picture as PQ values in 65,535 steps of [`PQ_RANGE`]: half of the memory of floats, the same
/// on every device. A step is 3e-5; the PQ values of half-float pictures are up to three times as
/// far from each other, those of displays thirty times.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    width: u32,
    height: u32,
    pixels: Vec<[u16; 3]>,
    edges: Arc<[bool]>,
}

impl Target {
    /// A linear picture; what is not a number counts as black.
    pub fn new(linear: &Image<3>) -> Self {
        let step = |value: f32| (pq_from_linear(value) / PQ_RANGE * MOST).round() as u16;
        let pixels = linear.pixels().par_iter().with_min_len(2048);
        let pixels: Vec<_> = pixels.map(|p| p.map(step)).collect();
        Self {
            width: linear.width(),
            height: linear.height(),
            edges: edges(&pixels, linear.width() as usize),
            pixels,
        }
    }

    /// Its PQ values.
    pub fn pq(&self) -> Image<3> {
        let value = |step: u16| f32::from(step) / MOST * PQ_RANGE;
        let pixels = self.pixels.par_iter().with_min_len(2048);
        let pixels = pixels.map(|p| p.map(value)).collect();
        Image::from_pixels(self.width, self.height, pixels).expect("as many pixels as before")
    }

    /// The steps, row by row.
    pub fn pixels(&self) -> &[[u16; 3]] {
        &self.pixels
    }

    /// Whether each pixel differs from one beside, above or below it, row by row: there the mean
    /// over the pixel is not its middle.
    pub fn edges(&self) -> &Arc<[bool]> {
        &self.edges
    }

    /// Bytes in memory.
    pub fn num_bytes(&self) -> usize {
        size_of_val(&*self.pixels) + size_of_val(&*self.edges)
    }
}

/// See [`Target::edges`].
fn edges(pixels: &[[u16; 3]], width: usize) -> Arc<[bool]> {
    let differ = |a: usize, b: usize| {
        let channels = pixels[a].iter().zip(&pixels[b]);
        channels.into_iter().any(|(a, b)| a.abs_diff(*b) > EDGE)
    };
    let is_edge = |i: usize| {
        let (x, y) = (i % width, i / width);
        (x > 0 && differ(i, i - 1))
            || (x + 1 < width && differ(i, i + 1))
            || (y > 0 && differ(i, i - width))
            || (y + 1 < pixels.len() / width && differ(i, i + width))
    };
    (0..pixels.len())
        .into_par_iter()
        .with_min_len(2048)
        .map(is_edge)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_kept_to_half_a_step_and_light_of_any_strength_has_one() {
        let values = [0.0, 1e-4, 0.02, 1.0, 16.03, 120.0, 6e4, f32::MAX];
        let image = Image::from_pixels(8, 1, values.map(|v| [v, v / 2.0, v / 3.0]).to_vec());
        let image = image.unwrap();
        let target = Target::new(&image);
        // Six bytes for the colours of a pixel, one for whether it is at an edge.
        assert_eq!(target.num_bytes(), 56);
        let kept = target.pq();
        for (linear, kept) in image.pixels().iter().zip(kept.pixels()) {
            for c in 0..3 {
                let off = (pq_from_linear(linear[c]) - kept[c]).abs();
                // Half of a step, and the rounding of values of up to 2.
                assert!(off <= PQ_RANGE / MOST / 2.0 + 2e-7, "{}: {off}", linear[c]);
            }
        }
        assert!(kept.pixels().is_sorted());
    }

    #[test]
    fn edges_are_where_neighbours_differ() {
        // Linear values whose PQ values differ by .02 and by .005.
        let (dark, light) = (0.2, 0.2 * 1.25);
        let near = 0.2 * 1.05;
        let apart = |a: f32, b: f32| (pq_from_linear(a) - pq_from_linear(b)).abs();
        assert!(apart(dark, light) > 0.015 && apart(dark, near) < 0.008);
        let rows = [
            [dark, dark, dark, light],
            [dark, near, dark, dark],
            [dark, dark, dark, dark],
        ];
        let pixels = rows.concat().into_iter().map(|v| [0.1, v, 0.1]).collect();
        let target = Target::new(&Image::from_pixels(4, 3, pixels).unwrap());
        let edges: Vec<usize> = (0..12).filter(|&i| target.edges()[i]).collect();
        assert_eq!(edges, [2, 3, 7]);
    }
}
