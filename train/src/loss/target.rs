//! Target image of a view.

use eagpt_scene::Image;
use eagpt_scene::color::pq_from_linear;
use rayon::prelude::*;

/// Range that the steps of [`Target`] divide: PQ values stay below it, however bright the light
/// (`(c₂/c₃)^m₂` is 1.99).
pub const PQ_RANGE: f32 = 2.0;

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
}

impl Target {
    /// A linear picture; what is not a number counts as black.
    pub fn new(linear: &Image<3>) -> Self {
        let step = |value: f32| (pq_from_linear(value) / PQ_RANGE * MOST).round() as u16;
        let pixels = linear.pixels().par_iter().with_min_len(2048);
        Self {
            width: linear.width(),
            height: linear.height(),
            pixels: pixels.map(|p| p.map(step)).collect(),
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

    /// Bytes in memory.
    pub fn num_bytes(&self) -> usize {
        size_of_val(&*self.pixels)
    }
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
        assert_eq!(target.num_bytes(), 48);
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
}
