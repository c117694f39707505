//! Rows of the light-transport matrix, traced by all threads.

use super::CpuScene;
use super::realizations::NUM_REALIZATIONS;
use crate::transport::EMISSION_THRESHOLD;
use crate::transport::matrix::{
    Aim, BrightEntries, Directions, EMITTER, NOTHING, Receiver, Sample, Sampler, TransportMatrix,
};
use eagpt_scene::color::luminance;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;

/// Receivers that are traced together: their rays take turns in the realizations of the scene, so
/// that a realization's tree stays in a near cache.
const TOGETHER: usize = 256;

impl TransportMatrix {
    /// Traces `directions` for some `receivers`, each with random numbers of its own among those of
    /// `key`.
    pub fn trace(
        scene: &CpuScene,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Self {
        let sampler = Sampler {
            lights: scene.light_list(),
            directions,
            key,
        };
        let groups: Vec<Self> = receivers
            .par_chunks(TOGETHER)
            .map(|receivers| Self::trace_group(scene, &sampler, receivers))
            .collect();
        let mut matrix = Self::default();
        groups.into_iter().for_each(|group| matrix.append(group));
        matrix
    }

    fn trace_group(scene: &CpuScene, sampler: &Sampler<'_>, receivers: &[Receiver]) -> Self {
        let Directions { bsdf, to_lights } = sampler.directions;
        let mut matrix = Self {
            direct: vec![Vec3::ZERO; receivers.len()],
            direct_squares: vec![0.0; receivers.len()],
            targets: vec![NOTHING; bsdf as usize * receivers.len()],
            light_targets: vec![NOTHING; to_lights as usize * receivers.len()],
            bright: BrightEntries::default(),
            num_rays: 0,
        };
        let aims: Vec<Aim<'_>> = receivers.iter().map(|one| sampler.aim(one)).collect();
        for realization in 0..NUM_REALIZATIONS {
            for (at, aim) in aims.iter().enumerate() {
                for sample in aim.samples(realization) {
                    let Some(direction) = aim.direction(sample, realization) else {
                        continue;
                    };
                    matrix.num_rays += 1;
                    let ray = aim.surface.ray(direction);
                    let Some(hit) = scene.realization_hit(&ray, realization) else {
                        continue;
                    };
                    let attributes = scene.attributes(hit.index);
                    let emits = attributes.emission() > EMISSION_THRESHOLD;
                    *matrix.entry(at, sample, sampler.directions) = if emits {
                        let light = attributes.radiance() * aim.weight(direction, realization);
                        matrix.direct[at] += light;
                        matrix.direct_squares[at] += luminance(light.to_array()).powi(2);
                        hit.index | EMITTER
                    } else {
                        hit.index
                    };
                }
            }
        }
        matrix
    }

    fn entry(&mut self, row: usize, sample: Sample, directions: Directions) -> &mut u32 {
        match sample {
            Sample::Bsdf(i) => &mut self.targets[row * directions.bsdf as usize + i as usize],
            Sample::Light(i) => {
                &mut self.light_targets[row * directions.to_lights as usize + i as usize]
            }
        }
    }
}
