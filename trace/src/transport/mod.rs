//! Light transport on blended rays (EAG-PT, sections 3.3 and 3.4).
//!
//! - `0-bounce`: the blended radiance R itself.
//! - `1-bounce`: emitters (E > τ_E) show R; any other point shows P/π · ∫ R(ω) (ω·Ñ) dω, the light that arrives being what the
//!   scene's Gaussians already carry (a radiance cache).
//! - `path`: only emitters carry light; paths bounce in cosine-weighted directions until they meet one.
//!
//! Directions are cosine-weighted, or a share of them goes to the emitters ([`lights`]); the mean is the same.

pub mod lights;
pub mod sampling;
pub mod start;

use crate::ray::Ray;
use crate::sums::{SumImage, Sums};
use eagpt_scene::rng::{Purpose, RandomKey, RandomStream};
use eagpt_scene::{Camera, Image};
use glam::Vec3;
use lights::{BounceSampler, Lights};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use start::Surface;

/// Emission above which a blended hit counts as an emitter, τ_E of the paper.
pub const EMISSION_THRESHOLD: f32 = 0.1;

/// How a frame's light is computed. The names are those of the paper's tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "mode")]
pub enum Integrator {
    /// The scene's own radiance.
    #[serde(rename = "0-bounce")]
    ZeroBounce,
    /// One bounce into the scene's own radiance.
    #[serde(rename = "1-bounce")]
    OneBounce {
        /// Samples per pixel, at least 1.
        num_samples: u32,
    },
    /// Multi-bounce path tracing from the emitters alone.
    #[serde(rename = "path")]
    Path {
        /// Samples per pixel, at least 1.
        num_samples: u32,
        /// Most bounces of a path, at least 1; 7 in the paper.
        max_bounces: u32,
        /// First bounce at which a path may be ended at random (survivors are weighted up, so the mean stays); `None`: never.
        roulette_from: Option<u32>,
    },
}

/// What all integrators share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LightOptions {
    /// Seed of the random numbers.
    pub seed: u64,
    /// τ_E, 0 to 1.
    pub emission_threshold: f32,
    /// Share of the directions that go to emitters, 0 to below 1; 0 is plain cosine sampling.
    pub light_share: f32,
}

/// Half the directions to the emitters: no direction's weight exceeds 2.
pub const LIGHT_SHARE: f32 = 0.5;

impl Default for LightOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            emission_threshold: EMISSION_THRESHOLD,
            light_share: LIGHT_SHARE,
        }
    }
}

/// Something that blends the hits of a single ray.
pub trait RayTracer: Sync {
    /// Blended sums along `ray`.
    fn trace(&self, ray: &Ray) -> Sums;

    /// The scene's emitters, if it has any.
    fn lights(&self) -> Option<&Lights>;
}

/// Light of every pixel of `camera`, given the blended sums of its camera rays. Deterministic for a seed: each pixel has
/// its own random numbers and adds its samples in order.
pub fn render(
    scene: &impl RayTracer,
    camera: &Camera,
    sums: &SumImage,
    integrator: &Integrator,
    options: &LightOptions,
) -> Image<3> {
    let frame = camera.ray_frame();
    let key = RandomKey::new(options.seed, Purpose::Render, 0);
    let sampler = BounceSampler::new(scene.lights(), options.light_share);
    let light = |pixel: usize| -> Vec3 {
        let seen = &sums.pixels[pixel];
        if seen.emission() > options.emission_threshold || *integrator == Integrator::ZeroBounce {
            return seen.radiance();
        }
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let Some(surface) = Surface::at(frame.origin, direction, seen) else {
            return Vec3::ZERO;
        };
        let streams = |sample| key.stream(pixel as u32, sample);
        match *integrator {
            Integrator::ZeroBounce => seen.radiance(),
            Integrator::OneBounce { num_samples } => {
                seen.albedo() * irradiance_over_pi(scene, &sampler, &surface, num_samples, streams)
            }
            Integrator::Path {
                num_samples,
                max_bounces,
                roulette_from,
            } => {
                let paths = Paths {
                    scene,
                    sampler,
                    max_bounces,
                    roulette_from,
                    threshold: options.emission_threshold,
                };
                let total: Vec3 = (0..num_samples)
                    .map(|s| paths.sample(&surface, &mut streams(s)))
                    .sum();
                seen.albedo() * total / num_samples as f32
            }
        }
    };
    let pixels = (0..camera.num_pixels())
        .into_par_iter()
        .map(|pixel| light(pixel).to_array())
        .collect();
    Image::from_pixels(camera.width, camera.height, pixels).expect("one light value for each pixel")
}

/// Monte-Carlo estimate of `1/π · ∫ R(ω) (ω·n) dω` over the hemisphere above `surface`: the weighted mean of the radiance met in
/// sampled directions. `streams` gives each sample its random numbers.
pub fn irradiance_over_pi(
    scene: &impl RayTracer,
    sampler: &BounceSampler<'_>,
    surface: &Surface,
    num_samples: u32,
    streams: impl Fn(u32) -> RandomStream,
) -> Vec3 {
    let total: Vec3 = (0..num_samples)
        .filter_map(|sample| {
            let bounce = sampler.sample(surface, streams(sample).next_uniforms())?;
            Some(scene.trace(&surface.ray(bounce.direction)).radiance() * bounce.weight)
        })
        .sum();
    total / num_samples as f32
}

/// Paths through a scene, and when they end.
struct Paths<'a, T> {
    scene: &'a T,
    sampler: BounceSampler<'a>,
    max_bounces: u32,
    roulette_from: Option<u32>,
    threshold: f32,
}

impl<T: RayTracer> Paths<'_, T> {
    /// Light that one path brings to `start`, not yet multiplied by the albedo there. A path without an emitter brings none.
    fn sample(&self, start: &Surface, random: &mut RandomStream) -> Vec3 {
        let mut surface = *start;
        let mut throughput = Vec3::ONE;
        for number in 1..=self.max_bounces {
            let Some(bounce) = self.sampler.sample(&surface, random.next_uniforms()) else {
                return Vec3::ZERO;
            };
            let ray = surface.ray(bounce.direction);
            let met = self.scene.trace(&ray);
            throughput *= bounce.weight;
            if met.emission() > self.threshold {
                return throughput * met.radiance();
            }
            throughput *= met.albedo();
            if number >= self.roulette_from.unwrap_or(u32::MAX) {
                let chance = throughput.max_element().min(1.0);
                let [survive, ..] = random.next_uniforms();
                if survive >= chance {
                    return Vec3::ZERO;
                }
                throughput /= chance;
            }
            let Some(next) = Surface::at(ray.origin.into(), ray.direction.into(), &met) else {
                return Vec3::ZERO;
            };
            surface = next;
        }
        Vec3::ZERO
    }
}
