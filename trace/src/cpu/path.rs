//! Paths from surfaces to the emitters.
//!
//! Many paths are followed at once, bounce by bounce: before each, they are put in an order in
//! which neighbours meet the same parts of the scene ([`order`]), which the processor's caches then
//! hold. The light of a path does not depend on the order.

mod order;
mod seen;

use super::CpuScene;
use super::integrate::Samples;
use crate::transport::Hits;
use crate::transport::light_list::{Importances, LightList};
use crate::transport::points::Points;
use crate::transport::sampling::cosine_direction;
use crate::transport::start::Surface;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;
use seen::Seen;
use std::f32::consts::FRAC_1_PI;

/// Blocks of random numbers of a bounce: one for the bounce, one for the light.
const BLOCKS: u32 = 2;

/// Paths that are followed at once, unless one pixel has more samples.
const PATHS_AT_ONCE: u32 = 1 << 18;

/// Paths that a thread follows before it looks for others.
const PATHS_OF_A_TURN: usize = 1024;

/// Paths through a scene, and when they end.
pub(super) struct Paths<'a> {
    pub(super) scene: &'a CpuScene,
    /// Emitters sampled at every bounce besides, for next-event estimation; `None`: BSDF sampling
    /// only.
    pub(super) lights: Option<&'a LightList>,
    pub(super) num_samples: u32,
    pub(super) max_bounces: u32,
    pub(super) roulette_from: Option<u32>,
    /// τ_E.
    pub(super) threshold: f32,
    pub(super) hits: Hits,
    pub(super) key: RandomKey,
}

/// A pixel's surface, from which its paths go on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub(super) pixel: u32,
    pub(super) surface: Surface,
}

/// Light of a path, and the rays traced for it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PathLight {
    pub(super) light: Vec3,
    pub(super) num_rays: u32,
}

/// A path on its way.
#[derive(Debug, Clone, Copy)]
struct Path {
    /// Number of its start, and of its sample there.
    start: u32,
    sample: u32,
    pixel: u32,
    surface: Surface,
    throughput: Vec3,
    brought: PathLight,
    is_alive: bool,
}

impl Path {
    /// Four random numbers of a block of a bounce, 0 to [`BLOCKS`].
    fn numbers(&self, key: RandomKey, bounce: u32, block: u32) -> [f32; 4] {
        Points::new(key, self.pixel).block(self.sample, BLOCKS * bounce + block)
    }
}

impl Paths<'_> {
    /// Incident light of all paths of each start, not yet multiplied by the albedo there, `[n]`.
    pub(super) fn sample(&self, starts: &[Start]) -> Vec<Samples> {
        let at_once = (PATHS_AT_ONCE / self.num_samples.max(1)).max(1);
        let some = starts.chunks(at_once as usize);
        some.flat_map(|starts| self.sample_some(starts)).collect()
    }

    fn sample_some(&self, starts: &[Start]) -> Vec<Samples> {
        let num_samples = self.num_samples as usize;
        let mut lights = vec![PathLight::default(); starts.len() * num_samples];
        let mut paths: Vec<Path> = (starts.par_iter().enumerate())
            .flat_map_iter(|(number, start)| self.first_bounce(number as u32, start))
            .collect();
        let mut bounce = 1;
        loop {
            paths.retain(|path| {
                let number = path.start as usize * num_samples + path.sample as usize;
                lights[number] = path.brought;
                path.is_alive
            });
            if bounce >= self.max_bounces || paths.is_empty() {
                break;
            }
            self.put_in_order(&mut paths, bounce);
            (paths.par_chunks_mut(PATHS_OF_A_TURN)).for_each(|some| {
                for path in some {
                    let of_bounce = self.importances(&path.surface);
                    self.advance(path, bounce, of_bounce.as_ref());
                }
            });
            bounce += 1;
        }
        let of_start = |lights: &[PathLight]| {
            let mut samples = Samples::default();
            lights.iter().for_each(|&light| samples.add(light));
            samples
        };
        lights.chunks(num_samples.max(1)).map(of_start).collect()
    }

    /// The paths of a start after one bounce, whose emitters are weighed once for all.
    fn first_bounce(&self, number: u32, start: &Start) -> impl Iterator<Item = Path> {
        let importances = self.importances(&start.surface);
        (0..self.num_samples).map(move |sample| {
            let mut path = Path {
                start: number,
                sample,
                pixel: start.pixel,
                surface: start.surface,
                throughput: Vec3::ONE,
                brought: PathLight::default(),
                is_alive: true,
            };
            self.advance(&mut path, 0, importances.as_ref());
            path
        })
    }

    /// Light that emitters may give `surface`.
    fn importances(&self, surface: &Surface) -> Option<Importances> {
        self.lights.map(|lights| lights.importances(surface))
    }

    /// Follows a path for a bounce, and collects the light of its emitters.
    ///
    /// A direction contributes R where E > τ_E, nothing elsewhere. With next-event estimation every
    /// bounce samples a direction towards an emitter (density p) and one from the BSDF (density q =
    /// cos θ/π), and both are weighted by q/(p + q): the balance heuristic of multiple importance
    /// sampling (Veach 1997, section 9.2). No weight exceeds 1, and the mean is that of q alone.
    fn advance(&self, path: &mut Path, bounce: u32, importances: Option<&Importances>) {
        path.is_alive = false;
        let surface = path.surface;
        let [a, b, survive, choice] = path.numbers(self.key, bounce, 0);
        let seen = self.seen(bounce, choice);
        let lights = self.lights.zip(importances);
        if let Some(lights) = lights
            && let Some(light) =
                self.towards_light(lights, &surface, seen, path.numbers(self.key, bounce, 1))
        {
            path.brought.light += path.throughput * light;
            path.brought.num_rays += 1;
        }
        let ray = surface.ray(cosine_direction(surface.normal, a, b));
        let direction = Vec3::from(ray.direction);
        let met = seen.trace(self.scene, &ray);
        path.brought.num_rays += 1;
        if met.emission() > self.threshold {
            let weight = lights.map_or(1.0, |lights| {
                let bsdf = direction.dot(surface.normal) * FRAC_1_PI;
                bsdf / (bsdf + seen.density(lights, &surface, direction))
            });
            path.brought.light += path.throughput * met.radiance() * weight;
            return;
        }
        path.throughput *= met.albedo();
        if bounce + 1 >= self.roulette_from.unwrap_or(u32::MAX) {
            let chance = path.throughput.max_element().min(1.0);
            if survive >= chance {
                return;
            }
            path.throughput /= chance;
        }
        if let Some(next) = Surface::at(ray.origin.into(), direction, &met) {
            path.surface = next;
            path.is_alive = true;
        }
    }

    /// The scene as the rays of a bounce meet it; `choice` is a number in [0, 1).
    fn seen(&self, bounce: u32, choice: f32) -> Seen {
        match self.hits.is_sampled(bounce) {
            false => Seen::Blend,
            true => Seen::realization(choice),
        }
    }

    /// Light from a direction towards a random emitter, weighted; `None` if that is below the
    /// surface and no ray was traced.
    fn towards_light(
        &self,
        lights: (&LightList, &Importances),
        surface: &Surface,
        seen: Seen,
        [pick, a, b, _]: [f32; 4],
    ) -> Option<Vec3> {
        let direction = seen.sample(lights, surface, [pick, a, b])?;
        let bsdf = direction.dot(surface.normal) * FRAC_1_PI;
        if bsdf <= 0.0 {
            return None;
        }
        let met = seen.trace(self.scene, &surface.ray(direction));
        if met.emission() <= self.threshold {
            return Some(Vec3::ZERO);
        }
        let density = seen.density(lights, surface, direction);
        let weight = bsdf / (bsdf + density);
        Some(met.radiance() * weight)
    }
}
