//! Light samples to bright surfaces that reflect.
//!
//! A lamp close to a wall sends half of its light to a spot of it. The spot lights the room as a
//! lamp does, but BSDF samples alone would meet it: rarely, and where one does, a receiver is lit
//! many times too much. Light samples go there, too, and the balance heuristic combines both, as it
//! does for emitters ([`super`]). Entries of bright surfaces have weights of their own.

use super::{Directions, EMITTER, Front, NOTHING, Sample, Sampler, Tracing, TransportMatrix};
use crate::cpu::realizations::NUM_REALIZATIONS;
use crate::transport::light_list::LightList;
use eagpt_scene::Gaussians;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;

/// Light samples to bright surfaces.
#[derive(Debug, Clone, Copy)]
pub struct BrightSamples<'a> {
    /// The surfaces, as emitters.
    pub lights: &'a LightList,
    /// Whether each Gaussian is of them, `[n]`.
    pub is_bright: &'a [bool],
    /// Number of samples at each receiver.
    pub num: u32,
    /// Key of the random numbers.
    pub key: RandomKey,
    /// Entries of the samples, `[receivers, num]`, traced where these surfaces emit and nothing
    /// else does.
    pub targets: &'a [u32],
}

/// Entries of bright surfaces with their weights, in rows of the receivers; empty without such
/// surfaces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BrightEntries {
    /// Directions of a receiver, among which they were found.
    num_directions: u32,
    /// End of each row, `[receivers]`.
    ends: Vec<usize>,
    /// Gaussians, and weights of their radiance.
    entries: Vec<(u32, f32)>,
}

impl BrightEntries {
    /// Those of a receiver.
    pub(super) fn row(&self, at: usize) -> &[(u32, f32)] {
        let Some(&end) = self.ends.get(at) else {
            return &[];
        };
        let start = at.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.entries[start..end]
    }

    /// Irradiance over π that a receiver has of `radiances`, `[n]`.
    pub(super) fn light(&self, at: usize, radiances: &[Vec3]) -> Vec3 {
        let row = self.row(at).iter();
        row.map(|(met, weight)| radiances[*met as usize] * *weight)
            .sum()
    }

    /// Variance of its luminance, as far as the entries tell it.
    pub(super) fn variance(&self, at: usize, radiances: &[Vec3]) -> f32 {
        let row = self.row(at).iter();
        let parts = row.map(|(met, w)| luminance((radiances[*met as usize] * *w).to_array()));
        let (sum, squares) = parts.fold((0.0, 0.0), |(sum, squares), part| {
            (sum + part, squares + part * part)
        });
        (squares - sum * sum / self.num_directions.max(1) as f32).max(0.0)
    }
}

impl TransportMatrix {
    /// Adds light samples to bright surfaces, of whose `fronts`, `[n]`, alone receivers have light.
    /// All rows are those of `tracing`, whose lights do not count.
    pub fn add_bright(
        &mut self,
        tracing: &Tracing<'_>,
        samples: &BrightSamples<'_>,
        (gaussians, fronts): (&Gaussians, &[Front]),
    ) {
        let directions = Directions {
            to_lights: samples.num,
            ..tracing.directions
        };
        let [bsdf, num] = [directions.bsdf as usize, samples.num as usize];
        let cosine = tracing.sampler();
        let to_bright = Sampler {
            lights: Some(samples.lights),
            directions,
            key: samples.key,
        };
        let rows = (self.targets)
            .par_chunks_exact_mut(bsdf)
            .zip(tracing.receivers)
            .enumerate();
        let rows: Vec<Vec<(u32, f32)>> = rows
            .with_min_len(64)
            .map(|(at, (targets, receiver))| {
                let [cosine, to_bright] = [&cosine, &to_bright].map(|of| of.aim(receiver));
                let mut row = Vec::new();
                for realization in 0..NUM_REALIZATIONS {
                    for sample in cosine.samples(realization) {
                        let Sample::Bsdf(i) = sample else { continue };
                        let target = &mut targets[i as usize];
                        // Neither `NOTHING` nor what has `EMITTER` is an index.
                        if samples.is_bright.get(*target as usize) == Some(&true)
                            && let Some(direction) = cosine.direction(sample, realization)
                        {
                            row.push((*target, to_bright.weight(direction, realization)));
                            *target = NOTHING;
                        }
                    }
                    for sample in to_bright.samples(realization) {
                        let Sample::Light(i) = sample else { continue };
                        let target = samples.targets[at * num + i as usize];
                        let met = target & !EMITTER;
                        if target & EMITTER != 0
                            && let Some(direction) = to_bright.direction(sample, realization)
                            && !fronts[met as usize].is_behind(
                                &to_bright,
                                direction,
                                (gaussians, met as usize),
                            )
                        {
                            row.push((met, to_bright.weight(direction, realization)));
                        }
                    }
                }
                row
            })
            .collect();
        let mut end = 0;
        let ends = rows.iter().map(|row| {
            end += row.len();
            end
        });
        self.bright = BrightEntries {
            num_directions: directions.bsdf + directions.to_lights,
            ends: ends.collect(),
            entries: rows.concat(),
        };
    }
}
