//! Paths from surfaces to the emitters.
//!
//! A path that a diffuse lobe has scattered meets surfaces at least [`ROUGH_BEHIND`] rough: light
//! of lamps by way of mirrors, which such paths find by chance alone, is a little blurred in place
//! of spots of noise.
//!
//! Many paths are followed at once, bounce by bounce: before each, they are put in an order in
//! which neighbours meet the same parts of the scene ([`order`]), which the processor's caches then
//! hold. The light of a path does not depend on the order.
//!
//! Paths end at random where little light is left to find; [`expected`] has what then stands in for
//! the rest. The samples of pixels that lie near each other are of one low-discrepancy sequence
//! ([`RowPoints`]): what one has too much of, its neighbours have too little of, which denoisers
//! see.

mod expected;
mod order;
mod seen;
#[cfg(test)]
mod tests;

use super::CpuScene;
use super::samples::{PathLight, Samples};
use crate::transport::Hits;
use crate::transport::bsdf::Bsdf;
use crate::transport::light_list::{Importances, LightList};
use crate::transport::points::RowPoints;
use crate::transport::start::Surface;
use crate::transport::vertex::{ROUGH_BEHIND, Start, Vertex};
use eagpt_scene::morton;
use eagpt_scene::rng::RandomKey;
use expected::Expected;
use glam::Vec3;
use rayon::prelude::*;
use seen::Seen;

/// Blocks of random numbers of a bounce: one for the bounce, one for the light.
const BLOCKS: u32 = 2;

/// Paths that are followed at once, unless one pixel has more samples.
const PATHS_AT_ONCE: u32 = 1 << 20;

/// Chance of a light sample where paths start. The samples of a pixel choose among the same
/// emitters there, evenly, so that half as many find them as well as one more ray for every path
/// would.
const LIGHT_CHANCE_OF_STARTS: f32 = 0.5;

/// Paths that a thread follows before it looks for others.
const PATHS_OF_A_TURN: usize = 1024;

/// Paths through a scene, and when they end.
pub(super) struct Paths<'a> {
    pub(super) scene: &'a CpuScene,
    /// Pixels in a row of the image.
    pub(super) width: u32,
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
    /// Of the paths that tell what to expect: what a path finds may not depend on it.
    pub(super) key_of_expected: RandomKey,
}

/// A path on its way.
#[derive(Debug, Clone, Copy)]
struct Path {
    /// Number of its start, and of its sample there.
    start: u32,
    sample: u32,
    /// Number of its start among all that may be: neighbours have neighbouring numbers.
    element: u32,
    vertex: Vertex,
    throughput: Vec3,
    brought: PathLight,
    /// Least roughness of what it meets.
    min_roughness: f32,
    /// Light that its start is expected to receive, the unit of what is worth following.
    worth: f32,
    is_alive: bool,
}

impl Path {
    /// A path of a start before its first bounce.
    fn new(number: u32, sample: u32, element: u32, vertex: Vertex) -> Self {
        Self {
            start: number,
            sample,
            element,
            vertex,
            throughput: Vec3::ONE,
            brought: PathLight::default(),
            min_roughness: 0.0,
            worth: 0.0,
            is_alive: true,
        }
    }
}

impl Paths<'_> {
    /// Light of all paths of each start, before the reflectance there, `[n]`.
    pub(super) fn sample(&self, starts: &[Start]) -> Vec<Samples> {
        let expected = self.roulette_from.map(|_| self.expected(starts));
        let at_once = (PATHS_AT_ONCE / self.num_samples.max(1)).max(1);
        let some = starts.chunks(at_once as usize);
        some.flat_map(|starts| self.sample_some(starts, expected.as_ref()))
            .collect()
    }

    fn sample_some(&self, starts: &[Start], expected: Option<&Expected>) -> Vec<Samples> {
        let num_samples = self.num_samples as usize;
        let mut lights = vec![PathLight::default(); starts.len() * num_samples];
        // Of the first bounce, where all paths of a start weigh the same emitters.
        let of_starts: Vec<Option<Importances>> = (starts.par_iter())
            .map(|start| self.importances(&start.vertex.surface))
            .collect();
        let mut paths: Vec<Path> = (starts.par_iter().enumerate())
            .flat_map_iter(|(number, start)| {
                let vertex = start.vertex;
                let element = self.element(start.pixel);
                let worth = expected.map_or(0.0, |expected| {
                    expected.worth(expected.light(&vertex.surface), vertex.reflectance())
                });
                (0..self.num_samples).map(move |sample| Path {
                    worth,
                    ..Path::new(number as u32, sample, element, vertex)
                })
            })
            .collect();
        for bounce in 0..self.max_bounces {
            self.put_in_order(&mut paths, bounce);
            (paths.par_chunks_mut(PATHS_OF_A_TURN)).for_each(|some| {
                for path in some {
                    let importances = match bounce {
                        0 => of_starts[path.start as usize],
                        _ => self.importances(&path.vertex.surface),
                    };
                    self.advance(path, bounce, importances.as_ref(), expected);
                }
            });
            paths.retain(|path| {
                if !path.is_alive {
                    let number = path.start as usize * num_samples + path.sample as usize;
                    lights[number] = path.brought;
                }
                path.is_alive
            });
            if paths.is_empty() {
                break;
            }
        }
        let of_start = |(start, lights): (&Start, &[PathLight])| {
            let mut samples = Samples::default();
            for &PathLight { light, num_rays } in lights {
                samples.add(PathLight {
                    light: light / start.divisor,
                    num_rays,
                });
            }
            samples
        };
        let of_starts = lights.chunks(num_samples.max(1));
        starts.iter().zip(of_starts).map(of_start).collect()
    }

    /// Number of a pixel on a Z-order curve.
    fn element(&self, pixel: u32) -> u32 {
        morton::square_code([pixel % self.width, pixel / self.width]) as u32
    }

    /// Four random numbers of a block of a bounce, 0 to [`BLOCKS`].
    fn numbers(&self, path: &Path, bounce: u32, block: u32) -> [f32; 4] {
        let points = RowPoints::new(self.key, path.element, self.num_samples);
        points.block(path.sample, BLOCKS * bounce + block)
    }

    /// Light that emitters may give `surface`.
    fn importances(&self, surface: &Surface) -> Option<Importances> {
        self.lights.map(|lights| lights.importances(surface))
    }

    /// Follows a path for a bounce, and collects the light of its emitters.
    ///
    /// A direction contributes R where E > τ_E, nothing elsewhere. With next-event estimation a
    /// bounce samples a direction towards an emitter (density p, by the chance c) and one from the
    /// BSDF (density q), and both are weighted by q/(c p + q): the balance heuristic of multiple
    /// importance sampling (Veach 1997, section 9.2). The mean is that of q alone.
    fn advance(
        &self,
        path: &mut Path,
        bounce: u32,
        importances: Option<&Importances>,
        expected: Option<&Expected>,
    ) {
        path.is_alive = false;
        let surface = path.vertex.surface;
        let bsdf = path.vertex.bsdf();
        let [a, b, lobe, choice] = self.numbers(path, bounce, 0);
        let [pick, u, v, survive] = self.numbers(path, bounce, 1);
        let lights = self.lights.zip(importances).map(|lights| LightSampling {
            lights,
            seen: self.seen(choice),
            chance: match bounce {
                0 => LIGHT_CHANCE_OF_STARTS,
                _ => 1.0,
            },
        });
        let seen = self.seen(choice);
        // The remainder of the number that made the choice is as evenly spread as the number was.
        if let Some(lights) = &lights
            && pick < lights.chance
            && let numbers = [pick / lights.chance, u, v]
            && let Some(light) = lights.sample(self, (&surface, &bsdf), numbers)
        {
            path.brought.light += path.throughput * light;
            path.brought.num_rays += 1;
        }
        let Some(sample) = bsdf.sample([lobe, a, b]) else {
            return;
        };
        let direction = sample.direction;
        let (met, gloss) = seen.trace(self.scene, &surface.ray(direction));
        path.brought.num_rays += 1;
        if met.emission() > self.threshold {
            let of_lights = (lights.as_ref()).map_or(0.0, |l| l.density(&surface, direction));
            let weight = sample.value / (sample.density + of_lights);
            path.brought.light += path.throughput * met.radiance() * weight;
            return;
        }
        if lobe >= bsdf.specular_share() {
            path.min_roughness = ROUGH_BEHIND;
        }
        let ray = (surface.position, direction);
        let Some(next) = Vertex::new(ray, &met, gloss, path.min_roughness) else {
            return;
        };
        path.throughput *= sample.value / sample.density * next.alpha;
        let goes_on = match (expected, self.roulette_from) {
            _ if bounce + 1 == self.max_bounces => false,
            (Some(expected), Some(from)) if bounce + 1 >= from => {
                expected.goes_on(path, &next, survive)
            }
            _ => true,
        };
        if goes_on {
            path.vertex = next;
            path.is_alive = true;
        }
    }

    /// The scene as the rays of a bounce meet it; `choice` is a number in [0, 1).
    fn seen(&self, choice: f32) -> Seen {
        match self.hits {
            Hits::Blended => Seen::Blend,
            Hits::Sampled => Seen::realization(choice),
        }
    }
}

/// Next-event estimation at a vertex.
struct LightSampling<'a> {
    lights: (&'a LightList, &'a Importances),
    /// The scene that its rays meet.
    seen: Seen,
    /// Chance of a light sample.
    chance: f32,
}

impl LightSampling<'_> {
    /// Light from a direction towards a random emitter, weighted; `None` if that is below the
    /// surface and no ray was traced.
    fn sample(
        &self,
        paths: &Paths<'_>,
        (surface, bsdf): (&Surface, &Bsdf),
        numbers: [f32; 3],
    ) -> Option<Vec3> {
        let direction = self.seen.sample(self.lights, surface, numbers)?;
        let (value, density) = bsdf.evaluate(direction);
        if density <= 0.0 {
            return None;
        }
        let (met, _) = self.seen.trace(paths.scene, &surface.ray(direction));
        if met.emission() <= paths.threshold {
            return Some(Vec3::ZERO);
        }
        Some(met.radiance() * value / (density + self.density(surface, direction)))
    }

    /// Density over solid angle of light samples, times their chance.
    fn density(&self, surface: &Surface, direction: Vec3) -> f32 {
        self.chance * self.seen.density(self.lights, surface, direction)
    }
}
