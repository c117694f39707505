//! Light that lobes mirror of a scene.

use super::fit::{Lobe, NUM};
use eagpt_scene::color::luminance;
use eagpt_scene::lamps::emits;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::bsdf::Bsdf;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use glam::Vec3;

/// Directions of each half of the samples: for each lobe, and towards emitters.
const NUM_OF_LOBE: u32 = 3;
const NUM_OF_LIGHTS: u32 = 8;

/// Light of all lobes from the same directions, each weighted by the density with which lobes and
/// emitters together choose it (balance heuristic of several samples, Veach 1997, section 9.2).
pub(super) struct Sampler<'a> {
    pub(super) scene: &'a CpuScene,
    /// Unit normal of each Gaussian to where it is seen from; zero where it is not, `[n]`.
    pub(super) fronts: &'a [Vec3],
    pub(super) surface: &'a Surface,
    pub(super) lobes: &'a [Bsdf; NUM],
    pub(super) direction: Vec3,
}

impl Sampler<'_> {
    /// Adds the light of one `half` of the samples, chosen by `points`, to that `found` of each
    /// channel, and of luminance.
    pub(super) fn add(&self, points: &Points, half: usize, found: &mut [[Lobe; NUM]; 4]) {
        let mut number = 0;
        for (block, lobe) in (0..).zip(self.lobes) {
            for sample in 0..NUM_OF_LOBE {
                let [_, a, b, _] = points.block(sample, block);
                number += 1;
                if let Some(chosen) = lobe.sample([0.0, a, b]) {
                    self.add_direction(chosen.direction, number, half, found);
                }
            }
        }
        if let Some(lights) = self.scene.lights() {
            for sample in 0..NUM_OF_LIGHTS {
                let [pick, a, b, _] = points.block(sample, NUM as u32);
                number += 1;
                if let Some(direction) = lights.sample(self.surface.position, pick, a, b) {
                    self.add_direction(direction, number, half, found);
                }
            }
        }
    }

    fn add_direction(
        &self,
        direction: Vec3,
        number: u32,
        half: usize,
        found: &mut [[Lobe; NUM]; 4],
    ) {
        let of_lobes = self.lobes.map(|lobe| lobe.evaluate(direction));
        let mut density: f32 = of_lobes.iter().map(|(_, density)| density).sum();
        density *= NUM_OF_LOBE as f32;
        if of_lobes.iter().all(|(value, _)| value.x <= 0.0) {
            return;
        }
        if let Some(lights) = self.scene.lights() {
            density += NUM_OF_LIGHTS as f32 * lights.density(self.surface.position, direction);
        }
        if density <= 0.0 {
            return;
        }
        let ray = self.surface.ray(direction);
        let Some(hit) = self.scene.realization_hit(&ray, number) else {
            return;
        };
        let met = self.scene.attributes(hit.index);
        // The back of what cameras see is mostly dark, as the underside of a table is.
        let is_back = direction.dot(self.fronts[hit.index as usize]) > 0.0;
        if is_back && !emits(met.emission()) {
            return;
        }
        let [x, y, z] = met.radiance().to_array();
        let luminance = luminance([x, y, z]);
        let facing = (direction - self.direction).normalize().dot(direction);
        let edge = (1.0 - facing).clamp(0.0, 1.0).powi(5);
        for (of, light) in found.iter_mut().zip([x, y, z, luminance]) {
            for (lobe, (value, _)) in of.iter_mut().zip(&of_lobes) {
                let light = light * value.x / density;
                lobe.facing[half] += f64::from(light * (1.0 - edge));
                lobe.edge[half] += f64::from(light * edge);
            }
        }
    }
}
