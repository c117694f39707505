//! Paths from a surface to the emitters.

use super::CpuScene;
use crate::blend::features_of_one;
use crate::features::Features;
use crate::ray::Ray;
use crate::transport::Hits;
use crate::transport::light_list::{Importances, LightList};
use crate::transport::points::Points;
use crate::transport::sampling::cosine_direction;
use crate::transport::start::Surface;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// Blocks of random numbers of a bounce: one for the bounce, one for the light.
const BLOCKS: u32 = 2;

/// Paths through a scene, and when they end.
pub(super) struct Paths<'a> {
    pub(super) scene: &'a CpuScene,
    /// Emitters sampled at every bounce besides, for next-event estimation; `None`: BSDF sampling
    /// only.
    pub(super) lights: Option<&'a LightList>,
    pub(super) max_bounces: u32,
    pub(super) roulette_from: Option<u32>,
    /// τ_E.
    pub(super) threshold: f32,
    pub(super) hits: Hits,
}

/// Light of a path, and the rays traced for it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PathLight {
    pub(super) light: Vec3,
    pub(super) num_rays: u32,
}

impl Paths<'_> {
    /// Light that emitters may give `start`, for [`Self::sample`].
    pub(super) fn importances(&self, start: &Surface) -> Importances {
        let of = |lights: &LightList| lights.importances(start);
        self.lights.map_or([0.0; _], of)
    }

    /// Incident light of one path at `start`, not yet multiplied by the albedo there.
    ///
    /// A direction contributes R where E > τ_E, nothing elsewhere. With next-event estimation every
    /// bounce samples a direction towards an emitter (density p) and one from the BSDF (density q =
    /// cos θ/π), and both are weighted by q/(p + q): the balance heuristic of multiple importance
    /// sampling (Veach 1997, section 9.2). No weight exceeds 1, and the mean is that of q alone.
    pub(super) fn sample(
        &self,
        (start, importances): (&Surface, &Importances),
        points: &Points,
        sample: u32,
    ) -> PathLight {
        let mut surface = *start;
        let mut throughput = Vec3::ONE;
        let mut path = PathLight::default();
        for number in 0..self.max_bounces {
            let block = |k: u32| points.block(sample, BLOCKS * number + k);
            let of_bounce;
            let lights = match self.lights {
                Some(lights) if number == 0 => Some((lights, importances)),
                Some(lights) => {
                    of_bounce = lights.importances(&surface);
                    Some((lights, &of_bounce))
                }
                None => None,
            };
            if let Some(lights) = lights
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
                let weight = lights.map_or(1.0, |(lights, importances)| {
                    let bsdf = direction.dot(surface.normal) * FRAC_1_PI;
                    bsdf / (bsdf
                        + lights.footprint_density(importances, surface.position, direction))
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

    /// Features of the surface a ray meets; `choice` is the random number of a sampled hit.
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

    /// Light from a direction towards a random emitter, weighted; `None` if that is below the
    /// surface and no ray was traced.
    fn towards_light(
        &self,
        (lights, importances): (&LightList, &Importances),
        surface: &Surface,
        [pick, a, b, choice]: [f32; 4],
    ) -> Option<Vec3> {
        let position = surface.position;
        let direction = lights.sample_footprint(importances, position, [pick, a, b])?;
        let bsdf = direction.dot(surface.normal) * FRAC_1_PI;
        if bsdf <= 0.0 {
            return None;
        }
        let met = self.meet(&surface.ray(direction), choice);
        if met.emission() <= self.threshold {
            return Some(Vec3::ZERO);
        }
        let density = lights.footprint_density(importances, position, direction);
        let weight = bsdf / (bsdf + density);
        Some(met.radiance() * weight)
    }
}
