//! Light transport on blended rays (EAG-PT, sections 3.3 and 3.4).
//!
//! - `0-bounce`: the blended radiance R itself.
//! - `1-bounce`: emitters (E > τ_E) show R; any other point shows P/π · ∫ R(ω) (ω·Ñ) dω, the light
//!   that arrives being what the scene's Gaussians already carry (a radiance cache).
//! - `path`: only emitters carry light; paths bounce in cosine-weighted directions until they meet
//!   one.
//!
//! Directions are cosine-weighted, as in the paper, or emitters are looked for besides
//! ([`Sampling`]); the mean is the same.

pub mod lights;
pub mod matrix;
mod path;
pub mod points;
pub mod sampling;
pub mod start;

use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::surfel::Attributes;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Image};
use glam::Vec3;
use lights::{BounceSampler, Lights};
use path::{PathLight, Paths};
use points::Points;
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
        /// First bounce at which a path may be ended at random (survivors are weighted up, so the
        /// mean stays); `None`: never.
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
    /// How light is looked for.
    pub sampling: Sampling,
    /// What the rays of a path make of their hits. A single bounce is linear in what it meets, and
    /// always takes one.
    pub hits: Hits,
}

/// What a ray makes of the Gaussians it meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Hits {
    /// The blend of all is one surface, as in the paper
    Blended,
    /// One of them, chosen by its weight, stands for all: about twice as fast, for light that comes
    /// to about one percent less in a room. 1-bounce does so always, to the same mean
    ///
    /// The mean is lower because emission is compared with τ_E hit by hit, which takes nothing from
    /// the Gaussians around an emitter, and because bounces start on one disc of several that
    /// overlap.
    Sampled,
}

/// Light sampling. The noise differs, the mean does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Sampling {
    /// In directions about the normal only, as in the paper
    ///
    /// Emitters are found by BSDF sampling only.
    Cosine,
    /// Towards emitters as well, with multiple importance sampling
    ///
    /// Next-event estimation at every bounce of a path, and half of the directions of a single
    /// bounce.
    NextEvent,
}

/// Share of a single bounce's directions that go to emitters: no direction's weight exceeds 2.
pub const LIGHT_SHARE: f32 = 0.5;

impl Default for LightOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            emission_threshold: EMISSION_THRESHOLD,
            sampling: Sampling::NextEvent,
            hits: Hits::Blended,
        }
    }
}

/// The one hit of a ray that stands for all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledHit {
    /// Index of the Gaussian.
    pub index: u32,
    /// Distance along the ray.
    pub t: f32,
}

/// Something that blends the hits of a single ray.
pub trait RayTracer: Sync {
    /// composited features along `ray`.
    fn trace(&self, ray: &Ray) -> Features;

    /// One hit of `ray`, chosen by its weight: over all values of `seed`, the mean of what hits
    /// carry is the blended sum of [`Self::trace`], at a fraction of the cost. For features over
    /// many rays whose mean alone matters.
    fn sample_hit(&self, ray: &Ray, seed: u32) -> Option<SampledHit>;

    /// As [`Self::sample_hit`], with luck that all rays of the same `realization` (modulo
    /// [`matrix::NUM_REALIZATIONS`]) share: a mean over few realizations does not get better with
    /// more rays through the same Gaussians, but rays that take turns in the realizations together
    /// are cheaper still.
    fn realization_hit(&self, ray: &Ray, realization: u32) -> Option<SampledHit>;

    /// Light and material of a Gaussian.
    fn attributes(&self, index: u32) -> &Attributes;

    /// The scene's emitters, if it has any.
    fn lights(&self) -> Option<&Lights>;
}

/// Light of every pixel of `camera`, given the composited features of its camera rays.
/// Deterministic for a seed: each pixel has its own random numbers and adds its samples in order.
pub fn render(
    scene: &impl RayTracer,
    camera: &Camera,
    features: &GBuffer,
    integrator: &Integrator,
    options: &LightOptions,
) -> Light {
    let frame = camera.ray_frame();
    let key = RandomKey::new(options.seed, Purpose::Render, 0);
    let lights = match options.sampling {
        Sampling::Cosine => None,
        Sampling::NextEvent => scene.lights(),
    };
    let sampler = BounceSampler::new(lights, LIGHT_SHARE);
    let light = |pixel: usize| -> (Vec3, f32, u32) {
        let seen = &features.pixels[pixel];
        if seen.emission() > options.emission_threshold || *integrator == Integrator::ZeroBounce {
            return (seen.radiance(), 0.0, 0);
        }
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let Some(surface) = Surface::at(frame.origin, direction, seen) else {
            return (Vec3::ZERO, 0.0, 0);
        };
        let points = Points::new(key, pixel as u32);
        let mut samples = Samples::default();
        match *integrator {
            Integrator::ZeroBounce => {}
            Integrator::OneBounce { num_samples } => {
                for s in 0..num_samples {
                    let light = bounced(scene, &sampler, &surface, &points, s);
                    samples.add(PathLight { light, num_rays: 1 });
                }
            }
            Integrator::Path {
                num_samples,
                max_bounces,
                roulette_from,
            } => {
                let paths = Paths {
                    scene,
                    lights,
                    max_bounces,
                    roulette_from,
                    threshold: options.emission_threshold,
                    hits: options.hits,
                };
                for s in 0..num_samples {
                    samples.add(paths.sample(&surface, &points, s));
                }
            }
        }
        let (mean, second_moment) = samples.moments();
        (seen.albedo() * mean, second_moment, samples.num_rays)
    };
    let pixels: Vec<(Vec3, f32, u32)> = (0..camera.num_pixels())
        .into_par_iter()
        .map(light)
        .collect();
    let (width, height) = (camera.width, camera.height);
    let radiance = pixels.iter().map(|(light, ..)| light.to_array()).collect();
    let second_moment = pixels.iter().map(|&(_, moment, _)| [moment]).collect();
    let one_each = "one value for each pixel";
    Light {
        radiance: Image::from_pixels(width, height, radiance).expect(one_each),
        second_moment: Image::from_pixels(width, height, second_moment).expect(one_each),
        num_rays: pixels.iter().map(|&(.., rays)| u64::from(rays)).sum(),
    }
}

/// What [`render`] finds for every pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Linear radiance.
    pub radiance: Image<3>,
    /// Mean over the samples of the squared luminance of the light before the albedo; 0 where no
    /// light is sampled. With the mean it says how noisy a pixel is.
    pub second_moment: Image<1>,
    /// Rays traced beside those of the camera.
    pub num_rays: u64,
}

/// Light that samples bring to one point, before the albedo.
#[derive(Default)]
struct Samples {
    total: Vec3,
    squares: f32,
    num: u32,
    num_rays: u32,
}

impl Samples {
    fn add(&mut self, path: PathLight) {
        self.total += path.light;
        self.squares += luminance(path.light.to_array()).powi(2);
        self.num += 1;
        self.num_rays += path.num_rays;
    }

    /// The mean and the mean squared luminance.
    fn moments(&self) -> (Vec3, f32) {
        if self.num == 0 {
            return (Vec3::ZERO, 0.0);
        }
        (self.total / self.num as f32, self.squares / self.num as f32)
    }
}

/// What the direction of one sample brings of `1/π · ∫ R(ω) (ω·n) dω`. Linear in R, it needs no
/// blended ray.
fn bounced(
    scene: &impl RayTracer,
    sampler: &BounceSampler<'_>,
    surface: &Surface,
    points: &Points,
    sample: u32,
) -> Vec3 {
    let bounce = sampler.sample(surface, points.block(sample, 0));
    bounce.map_or(Vec3::ZERO, |bounce| {
        let ray = surface.ray(bounce.direction);
        let hit = scene.sample_hit(&ray, points.word(sample));
        hit.map_or(Vec3::ZERO, |hit| {
            scene.attributes(hit.index).radiance() * bounce.weight
        })
    })
}

/// Monte-Carlo estimate of `1/π · ∫ R(ω) (ω·n) dω` over the hemisphere above `surface`: the
/// weighted mean of the radiance met in sampled directions.
pub fn irradiance_over_pi(
    scene: &impl RayTracer,
    sampler: &BounceSampler<'_>,
    surface: &Surface,
    num_samples: u32,
    points: &Points,
) -> Vec3 {
    let total: Vec3 = (0..num_samples)
        .map(|sample| bounced(scene, sampler, surface, points, sample))
        .sum();
    total / num_samples as f32
}
