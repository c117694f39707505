//! The blends of a camera's pixels as a sparse matrix.
//!
//! As long as geometry and opacity stay, a picture is linear in what Gaussians carry, `V = Σ wᵢ vᵢ`
//! with weights that never change: a product with this matrix in place of a trace, and with its
//! transpose in place of the adjoint.

use glam::Vec3;
use rayon::prelude::*;

/// Parts into which the transpose divides the pixels: fixed, so that features are the same for any
/// number of threads.
const NUM_PARTS: usize = 4;

/// Weights of Gaussians in pixels, in the order in which a camera's tiles have them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BlendWeights {
    /// Pixels, row by row, `[pixels]`.
    pixels: Vec<u32>,
    /// End of each pixel's entries, `[pixels]`.
    ends: Vec<u32>,
    /// Index in the scene and weight.
    entries: Vec<(u32, f32)>,
}

impl BlendWeights {
    /// Adds a pixel with its hits: index and weight in the blend. Those that weigh less than
    /// `least` are left out and their weight is given to the others in proportion.
    pub(crate) fn push(&mut self, pixel: u32, hits: impl Iterator<Item = (u32, f32)>, least: f32) {
        let start = self.entries.len();
        let (mut kept, mut all) = (0.0, 0.0);
        for (gaussian, weight) in hits {
            all += weight;
            if weight >= least {
                kept += weight;
                self.entries.push((gaussian, weight));
            }
        }
        for (_, weight) in &mut self.entries[start..] {
            *weight *= all / kept;
        }
        self.pixels.push(pixel);
        self.ends.push(self.entries.len() as u32);
    }

    /// The pixels of all `parts`, in as much memory as they need: a training run keeps one of these
    /// for each view.
    pub(crate) fn joined(parts: &[Self]) -> Self {
        let num_pixels = parts.iter().map(|part| part.pixels.len()).sum();
        let num_entries = parts.iter().map(|part| part.entries.len()).sum();
        let mut all = Self {
            pixels: Vec::with_capacity(num_pixels),
            ends: Vec::with_capacity(num_pixels),
            entries: Vec::with_capacity(num_entries),
        };
        for part in parts {
            let start = all.entries.len() as u32;
            all.pixels.extend(&part.pixels);
            all.ends.extend(part.ends.iter().map(|end| start + end));
            all.entries.extend(&part.entries);
        }
        all
    }

    /// Bytes in memory.
    pub fn num_bytes(&self) -> usize {
        size_of_val(&*self.pixels) + size_of_val(&*self.ends) + size_of_val(&*self.entries)
    }

    fn entries_of(&self, place: usize) -> &[(u32, f32)] {
        let start = match place {
            0 => 0,
            _ => self.ends[place - 1] as usize,
        };
        &self.entries[start..self.ends[place] as usize]
    }

    /// `Σ wᵢ vᵢ` in every pixel, row by row. `value` is that of a Gaussian.
    pub fn blend<V>(&self, value: impl Fn(u32) -> V + Sync) -> Vec<V>
    where
        V: std::ops::Mul<f32, Output = V> + std::iter::Sum + Default + Copy + Send,
    {
        let blended: Vec<V> = (0..self.pixels.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|place| {
                let entries = self.entries_of(place).iter();
                entries.map(|&(i, weight)| value(i) * weight).sum()
            })
            .collect();
        let mut rows = vec![V::default(); blended.len()];
        for (pixel, value) in self.pixels.iter().zip(blended) {
            rows[*pixel as usize] = value;
        }
        rows
    }

    /// The transpose of [`Self::blend`]: what `d_pixels`, the gradient in every pixel, row by row,
    /// makes of that of each of `num` Gaussians.
    pub fn adjoint(&self, d_pixels: &[Vec3], num: usize) -> Vec<Vec3> {
        let part = self.pixels.len().div_ceil(NUM_PARTS);
        let parts: Vec<Vec<Vec3>> = (0..NUM_PARTS)
            .into_par_iter()
            .map(|k| {
                let mut d_values = vec![Vec3::ZERO; num];
                for place in k * part..((k + 1) * part).min(self.pixels.len()) {
                    let d_pixel = d_pixels[self.pixels[place] as usize];
                    for &(i, weight) in self.entries_of(place) {
                        d_values[i as usize] += d_pixel * weight;
                    }
                }
                d_values
            })
            .collect();
        (0..num)
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| parts.iter().map(|part| part[i]).sum())
            .collect()
    }
}
