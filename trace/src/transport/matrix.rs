//! Which surfaces light each other: rays traced once, for light that goes back and forth many
//! times.
//!
//! Light that arrives at a point is `E/π = 1/π ∫ L cos θ dω`. The integral is taken apart by what a
//! direction meets. Emitters are looked for by two kinds of directions, towards them with density p
//! and about the normal with density q = cos θ/π, and what either finds counts with the balance
//! heuristic over both (Veach 1997, section 9.2). All other surfaces are met by the directions
//! about the normal alone; of each only the Gaussian is kept, which is a link. Whatever light the
//! Gaussians carry, `E/π` is then the emitters' part plus the mean of the light of the matrix:
//! further bounces, or other albedos, cost a look-up for each link and no ray.
//!
//! [`TransportMatrix::trace`] is the plain way, for whatever traces single rays;
//! [`crate::Tracer::trace_transport`] is that of an engine. [`known`] has the directions one by
//! one, for scenes of which only a part has changed.

pub mod known;

use super::EMISSION_THRESHOLD;
use super::lights::Lights;
use super::points::Points;
use super::sampling::cosine_direction;
use super::start::Surface;
use crate::cpu::CpuScene;
use crate::features::lane;
use eagpt_scene::rng::RandomKey;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Target of a link that meets nothing, or an emitter. It is no index, and a finite float to those
/// who store matrix as such.
pub const NOTHING: u32 = 0x7f7f_ffff;

/// Number of realizations: a power of two. What is left of the noise of a single edge is a
/// sixteenth of a step at most; the trees of all realizations together take some 1 KiB for each
/// Gaussian.
pub const NUM_REALIZATIONS: u32 = 16;

/// Points that are gathered for together: their rays take turns in the realizations of the scene,
/// so that a realization's tree stays in a near cache.
const TOGETHER: usize = 256;

/// A Gaussian for which light is gathered, and where it arrives.
pub type Receiver = (u32, Surface);

/// How many directions are traced for each receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Directions {
    /// About the normal, at least 1.
    pub plain: u32,
    /// Towards emitters.
    pub to_lights: u32,
}

impl Directions {
    /// `num` directions, at least 1, one in `every` (at least 2) towards emitters.
    pub fn divided(num: u32, every: u32) -> Self {
        let to_lights = num / every.max(2);
        Self {
            plain: (num - to_lights).max(1),
            to_lights,
        }
    }
}

/// Light of emitters at receivers, and matrix to what else they see.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TransportMatrix {
    /// Irradiance over π that comes from emitters, `[receivers]`.
    pub direct: Vec<Vec3>,
    /// Indices of Gaussians, or [`NOTHING`], `[receivers, directions.plain]`.
    pub targets: Vec<u32>,
    /// Rays traced.
    pub num_rays: u64,
}

impl TransportMatrix {
    /// Traces `directions` for some `receivers`, each with random numbers of its own among those of
    /// `key`.
    pub fn trace(
        scene: &CpuScene,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Self {
        let plain = directions.plain as usize;
        let mut matrix = Self {
            targets: vec![NOTHING; plain * receivers.len()],
            ..Self::default()
        };
        let found: Vec<(Vec<Vec3>, u64)> = (matrix.targets)
            .par_chunks_mut(plain * TOGETHER)
            .zip(receivers.par_chunks(TOGETHER))
            .map(|(targets, receivers)| {
                let mut tracing = Tracing {
                    scene,
                    sampler: Sampler {
                        lights: scene.lights(),
                        directions,
                        key,
                    },
                    num_rays: 0,
                };
                let direct = tracing.together(receivers, targets);
                (direct, tracing.num_rays)
            })
            .collect();
        for (direct, num_rays) in found {
            matrix.direct.extend(direct);
            matrix.num_rays += num_rays;
        }
        matrix
    }

    /// Adds those of more receivers, traced in as many directions.
    pub fn append(&mut self, mut more: Self) {
        self.direct.append(&mut more.direct);
        self.targets.append(&mut more.targets);
        self.num_rays += more.num_rays;
    }

    /// Irradiance over π that reaches each receiver from the others alone, of the light that all
    /// Gaussians carry: `radiances`, `[n]`; that of emitters does not count.
    pub fn from_others(&self, directions: Directions, radiances: &[Vec3]) -> Vec<Vec3> {
        let plain = directions.plain as usize;
        let light = |target: &u32| radiances.get(*target as usize).copied();
        self.targets
            .par_chunks_exact(plain)
            .with_min_len(1024)
            .map(|matrix| matrix.iter().filter_map(light).sum::<Vec3>() / plain as f32)
            .collect()
    }
}

/// What decides the directions of receivers, and what the light of an emitter that they find
/// counts.
#[derive(Debug, Clone, Copy)]
struct Sampler<'a> {
    lights: Option<&'a Lights>,
    directions: Directions,
    key: RandomKey,
}

impl Sampler<'_> {
    /// Random numbers of a receiver.
    fn points(&self, element: u32) -> Points {
        Points::new(self.key, element)
    }

    /// The samples of `num` that meet `realization`: those of a receiver take turns in the
    /// realizations, and receivers begin with different ones.
    fn turn(points: &Points, realization: u32, num: u32) -> impl Iterator<Item = u32> + use<> {
        let first = realization.wrapping_sub(points.word(0)) % NUM_REALIZATIONS;
        (first..num).step_by(NUM_REALIZATIONS as usize)
    }

    /// A direction about the normal.
    fn plain(&self, surface: &Surface, points: &Points, sample: u32) -> Vec3 {
        let [a, b, ..] = points.block(sample, 0);
        cosine_direction(surface.normal, a, b)
    }

    /// A direction towards an emitter, if there is one and it is above the surface.
    fn towards_light(&self, surface: &Surface, points: &Points, sample: u32) -> Option<Vec3> {
        let [pick, a, b, _] = points.block(sample, 1);
        (self.lights)
            .and_then(|lights| lights.sample(surface.position, pick, a, b))
            .filter(|direction| direction.dot(surface.normal) > 0.0)
    }

    /// What radiance counts that a direction found at an emitter: q / (n q + m p), for n directions
    /// of density q and m of density p.
    fn weight(&self, surface: &Surface, direction: Vec3) -> f32 {
        let density = |lights: &Lights| lights.density(surface.position, direction);
        let (q, p) = (
            direction.dot(surface.normal) * FRAC_1_PI,
            self.lights.map_or(0.0, density),
        );
        let all = self.directions.plain as f32 * q + self.directions.to_lights as f32 * p;
        q / all
    }
}

struct Tracing<'a> {
    scene: &'a CpuScene,
    sampler: Sampler<'a>,
    num_rays: u64,
}

impl Tracing<'_> {
    /// Light of emitters at each of `receivers`; fills in their `targets`.
    fn together(&mut self, receivers: &[Receiver], targets: &mut [u32]) -> Vec<Vec3> {
        let mut direct = vec![Vec3::ZERO; receivers.len()];
        let Directions { plain, to_lights } = self.sampler.directions;
        for realization in 0..NUM_REALIZATIONS {
            for (at, (element, surface)) in receivers.iter().enumerate() {
                let points = self.sampler.points(*element);
                for sample in Sampler::turn(&points, realization, plain) {
                    let direction = self.sampler.plain(surface, &points, sample);
                    let (target, light) = self.follow(surface, direction, realization);
                    targets[at * plain as usize + sample as usize] = target;
                    direct[at] += light;
                }
                for sample in Sampler::turn(&points, realization, to_lights) {
                    let direction = self.sampler.towards_light(surface, &points, sample);
                    if let Some(direction) = direction {
                        direct[at] += self.follow(surface, direction, realization).1;
                    }
                }
            }
        }
        direct
    }

    /// Follows a direction: the target of a link, or the light of an emitter.
    fn follow(&mut self, surface: &Surface, direction: Vec3, realization: u32) -> (u32, Vec3) {
        self.num_rays += 1;
        let Some(hit) = self
            .scene
            .realization_hit(&surface.ray(direction), realization)
        else {
            return (NOTHING, Vec3::ZERO);
        };
        let attributes = self.scene.attributes(hit.index);
        if attributes.0[lane::EMISSION] <= EMISSION_THRESHOLD {
            return (hit.index, Vec3::ZERO);
        }
        let weight = self.sampler.weight(surface, direction);
        (NOTHING, attributes.radiance() * weight)
    }
}
