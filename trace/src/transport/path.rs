//! Paths from a surface to the emitters.

use super::lights::Lights;
use super::points::Points;
use super::sampling::cosine_direction;
use super::start::Surface;
use super::{Hits, RayTracer};
use crate::blend::features_of_one;
use crate::features::Features;
use crate::ray::Ray;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// Blocks of numbers that a bounce draws: one for the bounce, one for the light.
const BLOCKS: u32 = 2;

/// Paths through a scene, and when they end.
pub(super) struct Paths<'a, T> {
    pub(super) scene: &'a T,
    /// Emitters that every bounce looks at besides, for next-event estimation; `None`: light is
    /// found by luck.
    pub(super) lights: Option<&'a Lights>,
    pub(super) max_bounces: u32,
    pub(super) roulette_from: Option<u32>,
    /// τ_E.
    pub(super) threshold: f32,
    pub(super) hits: Hits,
}

/// What a path brought, and what it cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PathLight {
    pub(super) light: Vec3,
    pub(super) num_rays: u32,
}

impl<T: RayTracer> Paths<'_, T> {
    /// Light that one path brings to `start`, not yet multiplied by the albedo there.
    ///
    /// What a direction brings is R where E > τ_E, nothing elsewhere. With next-event estimation
    /// every bounce takes a direction towards an emitter (density p) and one about the normal
    /// (density q = cos θ/π), and both count with q/(p + q): the balance heuristic of multiple
    /// importance sampling (Veach 1997, section 9.2). No weight exceeds 1, and the mean is that of
    /// q alone.
    pub(super) fn sample(&self, start: &Surface, points: &Points, sample: u32) -> PathLight {
        let mut surface = *start;
        let mut throughput = Vec3::ONE;
        let mut path = PathLight::default();
        for number in 0..self.max_bounces {
            let block = |k: u32| points.block(sample, BLOCKS * number + k);
            if let Some(lights) = self.lights
                && let Some(light) = self.towards_light(lights, &surface, block(1))
            {
                path.light += throughput * light;
                path.num_rays += 1;
            }
            let [a, b, survive, choice] = block(0);
            let ray = surface.ray(cosine_direction(surface.normal, a, b));
            let direction = Vec3::from(ray.direction);
            let met = self.meet(&ray, choice);
            path.num_rays += 1;
            if met.emission() > self.threshold {
                let weight = self.lights.map_or(1.0, |lights| {
                    let plain = direction.dot(surface.normal) * FRAC_1_PI;
                    plain / (plain + lights.density(surface.position, direction))
                });
                path.light += throughput * met.radiance() * weight;
                return path;
            }
            throughput *= met.albedo();
            if number + 1 >= self.roulette_from.unwrap_or(u32::MAX) {
                let chance = throughput.max_element().min(1.0);
                if survive >= chance {
                    return path;
                }
                throughput /= chance;
            }
            let Some(next) = Surface::at(ray.origin.into(), direction, &met) else {
                return path;
            };
            surface = next;
        }
        path
    }

    /// What a ray meets; `choice` is the random number of the hit that stands for all.
    fn meet(&self, ray: &Ray, choice: f32) -> Features {
        match self.hits {
            Hits::Blended => self.scene.trace(ray),
            Hits::Sampled => {
                let hit = self.scene.sample_hit(ray, choice.to_bits());
                hit.map_or(Features::default(), |hit| {
                    features_of_one(hit.t, self.scene.attributes(hit.index), ray.direction)
                })
            }
        }
    }

    /// What a direction towards a random emitter brings, weighted; `None` if that is below the
    /// surface and no ray was traced.
    fn towards_light(
        &self,
        lights: &Lights,
        surface: &Surface,
        [pick, a, b, choice]: [f32; 4],
    ) -> Option<Vec3> {
        let direction = lights.sample(surface.position, pick, a, b)?;
        let plain = direction.dot(surface.normal) * FRAC_1_PI;
        if plain <= 0.0 {
            return None;
        }
        let met = self.meet(&surface.ray(direction), choice);
        if met.emission() <= self.threshold {
            return Some(Vec3::ZERO);
        }
        let weight = plain / (plain + lights.density(surface.position, direction));
        Some(met.radiance() * weight)
    }
}
