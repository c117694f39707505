//! The integrators on the CPU: light transport on blended rays (EAG-PT, sections 3.3 and 3.4).

use super::CpuScene;
use super::glossy::Glossy;
use super::path::{PathLight, Paths};
use crate::features::GBuffer;
use crate::tracer::RenderedView;
use crate::transport::lights::BounceSampler;
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::transport::{Integrator, LIGHT_SHARE, LightOptions, Sampling};
use eagpt_scene::color::luminance;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Image};
use glam::Vec3;
use rayon::prelude::*;

/// Frame of `camera`, given the composited features of its camera rays. Deterministic for a seed:
/// each pixel has its own random numbers and adds its samples in order.
pub(super) fn render(
    scene: &CpuScene,
    camera: &Camera,
    features: GBuffer,
    integrator: &Integrator,
    options: &LightOptions,
) -> RenderedView {
    let frame = camera.ray_frame();
    let key = RandomKey::new(options.seed, Purpose::Render, 0);
    let lights = match options.sampling {
        Sampling::Cosine => None,
        Sampling::NextEvent => scene.lights(),
    };
    if scene.is_glossy() && *integrator != Integrator::ZeroBounce {
        let glossy = Glossy::new(scene, lights, integrator, options);
        return glossy.render(camera, features, key);
    }
    let sampler = BounceSampler::new(lights, LIGHT_SHARE);
    let light = |pixel: usize| -> (Vec3, f32, u32) {
        let seen = &features.pixels[pixel];
        if seen.emission() > options.emission_threshold || integrator.shows_own_radiance() {
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
            Integrator::ZeroBounce | Integrator::Gather { .. } => {}
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
                    lights: lights.and(scene.light_list()),
                    max_bounces,
                    roulette_from,
                    threshold: options.emission_threshold,
                    hits: options.hits,
                };
                let importances = paths.importances(&surface);
                for s in 0..num_samples {
                    samples.add(paths.sample((&surface, &importances), &points, s));
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
    RenderedView {
        radiance: Image::from_pixels(width, height, radiance).expect(one_each),
        second_moment: Image::from_pixels(width, height, second_moment).expect(one_each),
        num_rays: pixels.iter().map(|&(.., rays)| u64::from(rays)).sum(),
        features,
        guides: Vec::new(),
    }
}

/// Samples of the incident light at one point, before the albedo.
#[derive(Default)]
pub(super) struct Samples {
    total: Vec3,
    squares: f32,
    num: u32,
    pub(super) num_rays: u32,
}

impl Samples {
    pub(super) fn add(&mut self, path: PathLight) {
        self.total += path.light;
        self.squares += luminance(path.light.to_array()).powi(2);
        self.num += 1;
        self.num_rays += path.num_rays;
    }

    /// The mean and the mean squared luminance.
    pub(super) fn moments(&self) -> (Vec3, f32) {
        if self.num == 0 {
            return (Vec3::ZERO, 0.0);
        }
        (self.total / self.num as f32, self.squares / self.num as f32)
    }
}

/// Contribution of the direction of one sample to `1/π · ∫ R(ω) (ω·n) dω`. Linear in R, it needs
/// no blended ray.
fn bounced(
    scene: &CpuScene,
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

impl CpuScene {
    /// Irradiance over π at `surface`: Monte-Carlo estimate of `1/π · ∫ R(ω) (ω·n) dω`, the
    /// weighted mean of the radiance met in `num_samples` directions of `sampler`.
    pub fn irradiance_at(
        &self,
        surface: &Surface,
        sampler: &BounceSampler<'_>,
        num_samples: u32,
        points: &Points,
    ) -> Vec3 {
        let bounced = |sample| bounced(self, sampler, surface, points, sample);
        (0..num_samples).map(bounced).sum::<Vec3>() / num_samples as f32
    }

    /// Irradiance over π of every pixel of `camera`, whose `features` are given, from
    /// `num_samples` directions each, half of them towards emitters, with the random numbers of
    /// `key`. Zero on emitters, whose emission is above `emission_threshold`.
    pub fn irradiance(
        &self,
        camera: &Camera,
        features: &GBuffer,
        emission_threshold: f32,
        num_samples: u32,
        key: RandomKey,
    ) -> Vec<Vec3> {
        let frame = camera.ray_frame();
        let sampler = BounceSampler::new(self.lights(), LIGHT_SHARE);
        let of_pixel = |pixel: usize| {
            let seen = &features.pixels[pixel];
            if seen.emission() > emission_threshold {
                return Vec3::ZERO;
            }
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            Surface::at(frame.origin, direction, seen).map_or(Vec3::ZERO, |surface| {
                let points = Points::new(key, pixel as u32);
                self.irradiance_at(&surface, &sampler, num_samples, &points)
            })
        };
        (0..camera.num_pixels())
            .into_par_iter()
            .map(of_pixel)
            .collect()
    }
}
