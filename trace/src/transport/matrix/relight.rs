//! Other light of the emitters that the directions of a matrix have met. No ray is traced: entries
//! name the emitters, and random numbers the directions.

use super::{Directions, EMITTER, Receiver, Sample, Sampler, TransportMatrix};
use crate::cpu::realizations::NUM_REALIZATIONS;
use crate::transport::light_list::LightList;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;

/// How a matrix has been traced.
#[derive(Debug, Clone, Copy)]
pub struct Tracing<'a> {
    /// Whose rows they are.
    pub receivers: &'a [Receiver],
    /// Directions of each.
    pub directions: Directions,
    /// Key of the random numbers.
    pub key: RandomKey,
    /// Emitters that light samples were chosen from.
    pub lights: Option<&'a LightList>,
}

impl<'a> Tracing<'a> {
    /// Chooses the directions again.
    pub(super) fn sampler(&self) -> Sampler<'a> {
        Sampler {
            lights: self.lights,
            directions: self.directions,
            key: self.key,
        }
    }
}

impl TransportMatrix {
    /// Replaces [`Self::direct`] by that of emitters with other light, `radiances`, `[n]`. The
    /// lights of `tracing` still decide the weights: the mean is right, and the noise that of
    /// sampling those lights. As [`Self::trace`] has it to the bit, if all lights have changed
    /// alike.
    pub fn relight(&mut self, tracing: &Tracing<'_>, radiances: &[Vec3]) {
        let all = (0..tracing.receivers.len())
            .into_par_iter()
            .with_min_len(64);
        (self.direct, self.direct_squares) = all
            .map(|at| {
                let (mut direct, mut squares) = (Vec3::ZERO, 0.0);
                self.each_emitter(tracing, at, |emitter, weight| {
                    let light = radiances[emitter] * weight;
                    direct += light;
                    squares += luminance(light.to_array()).powi(2);
                });
                (direct, squares)
            })
            .unzip();
    }

    /// Calls `found` with the index of every emitter that a direction of row `at` has met and the
    /// weight of its radiance, in the order in which they were traced.
    pub(super) fn each_emitter(
        &self,
        tracing: &Tracing<'_>,
        at: usize,
        mut found: impl FnMut(usize, f32),
    ) {
        let Directions { bsdf, to_lights } = tracing.directions;
        let (bsdf, to_lights) = (bsdf as usize, to_lights as usize);
        let targets = &self.targets[at * bsdf..][..bsdf];
        let light_targets = &self.light_targets[at * to_lights..][..to_lights];
        let aim = tracing.sampler().aim(&tracing.receivers[at]);
        for realization in 0..NUM_REALIZATIONS {
            for sample in aim.samples(realization) {
                let target = match sample {
                    Sample::Bsdf(i) => targets[i as usize],
                    Sample::Light(i) => light_targets[i as usize],
                };
                if target & EMITTER != 0
                    && let Some(direction) = aim.direction(sample, realization)
                {
                    found(
                        (target & !EMITTER) as usize,
                        aim.weight(direction, realization),
                    );
                }
            }
        }
    }
}
