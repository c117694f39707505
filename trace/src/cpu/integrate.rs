//! The integrators on the CPU: light transport on blended rays (EAG-PT, sections 3.3 and 3.4).

use super::CpuScene;
use super::camera::CameraRecord;
use super::glossy::{self, Mirrors};
use super::path::{PathLight, Paths, Start};
use super::vertex::{Vertex, surfaces_of_pixels};
use crate::features::{Features, GBuffer};
use crate::tracer::{Guide, RenderedView};
use crate::transport::lights::{BounceSampler, Lights};
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::transport::{Integrator, LIGHT_SHARE, LightOptions, Sampling};
use eagpt_scene::color::luminance;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Image};
use glam::Vec3;
use rayon::prelude::*;

/// Frame of `camera`, given the composited features of its camera rays and, of a glossy scene, their
/// record (`0-bounce` needs none). Deterministic for a seed: each pixel has its own random numbers
/// and adds its samples in order.
pub(super) fn render(
    scene: &CpuScene,
    camera: &Camera,
    (features, record): (GBuffer, CameraRecord),
    integrator: &Integrator,
    options: &LightOptions,
) -> RenderedView {
    let key = RandomKey::new(options.seed, Purpose::Render, 0);
    let lights = match options.sampling {
        Sampling::Cosine => None,
        Sampling::NextEvent => scene.lights(),
    };
    let threshold = options.emission_threshold;
    let shows_own =
        |seen: &Features| seen.emission() > threshold || integrator.shows_own_radiance();
    let own = |seen: &Features| match shows_own(seen) {
        true => seen.radiance().to_array(),
        false => [0.0; 3],
    };
    let mut radiance: Vec<[f32; 3]> = features.pixels.iter().map(own).collect();
    let mut second_moment = vec![[0.0]; camera.num_pixels()];
    let mut guides = Vec::new();
    let mut num_rays = 0;
    match *integrator {
        Integrator::Gather { num_samples } if scene.is_glossy() => {
            let mirrors = Mirrors {
                scene,
                lights,
                num_samples,
                hit: CpuScene::sample_hit,
            };
            guides = vec![Guide::default(); camera.num_pixels()];
            for (pixel, gathered) in mirrors.gather((camera, &record), &features, threshold, key) {
                radiance[pixel] = gathered.light.to_array();
                second_moment[pixel] = [gathered.second_moment];
                guides[pixel] = gathered.guide;
                num_rays += gathered.num_rays;
            }
        }
        Integrator::ZeroBounce | Integrator::Gather { .. } => {}
        Integrator::OneBounce { .. } | Integrator::Path { .. } => {
            let glosses = scene.gloss_of_pixels(&record, &features);
            let surfaces = surfaces_of_pixels(camera, &features, threshold, &glosses);
            if scene.is_glossy() {
                let of_surface =
                    |(_, vertex): &(u32, Vertex)| glossy::guide(scene, vertex, threshold);
                let found: Vec<Guide> = surfaces.par_iter().map(of_surface).collect();
                guides = vec![Guide::default(); camera.num_pixels()];
                for ((pixel, _), guide) in surfaces.iter().zip(found) {
                    guides[*pixel as usize] = guide;
                }
            }
            let starts: Vec<Start> = (surfaces.into_iter())
                .map(|(pixel, vertex)| Start::new(pixel, vertex))
                .collect();
            let sampled = sampled(scene, &starts, lights, integrator, options, camera.width);
            for (start, samples) in starts.iter().zip(sampled) {
                let pixel = start.pixel as usize;
                let (mean, moment) = samples.moments();
                radiance[pixel] = (start.factor * mean).to_array();
                second_moment[pixel] = [moment];
                num_rays += u64::from(samples.num_rays);
            }
        }
    }
    let (width, height) = (camera.width, camera.height);
    let one_each = "one value for each pixel";
    RenderedView {
        radiance: Image::from_pixels(width, height, radiance).expect(one_each),
        second_moment: Image::from_pixels(width, height, second_moment).expect(one_each),
        num_rays,
        features,
        guides,
    }
}

/// Samples of the light at each of `starts`, `[n]`, in an image of rows of `width` pixels.
fn sampled(
    scene: &CpuScene,
    starts: &[Start],
    lights: Option<&Lights>,
    integrator: &Integrator,
    options: &LightOptions,
    width: u32,
) -> Vec<Samples> {
    let key = RandomKey::new(options.seed, Purpose::Render, 0);
    match *integrator {
        Integrator::ZeroBounce | Integrator::Gather { .. } => Vec::new(),
        Integrator::OneBounce { num_samples } => {
            let sampler = BounceSampler::new(lights, LIGHT_SHARE);
            let mirrors = Mirrors {
                scene,
                lights,
                num_samples,
                hit: CpuScene::sample_hit,
            };
            let of_start = |start: &Start| {
                let points = Points::new(key, start.pixel);
                let mut samples = Samples::default();
                for s in 0..num_samples {
                    let light = match start.vertex.is_glossy() {
                        true => {
                            let bsdf = start.vertex.bsdf();
                            let surface = &start.vertex.surface;
                            mirrors.bounced((surface, &bsdf), &points, s) / start.divisor
                        }
                        false => bounced(scene, &sampler, &start.vertex.surface, &points, s),
                    };
                    samples.add(PathLight { light, num_rays: 1 });
                }
                samples
            };
            starts.par_iter().map(of_start).collect()
        }
        Integrator::Path {
            num_samples,
            max_bounces,
            roulette_from,
        } => {
            let paths = Paths {
                scene,
                width,
                lights: lights.and(scene.light_list()),
                num_samples,
                max_bounces,
                roulette_from,
                threshold: options.emission_threshold,
                hits: options.hits,
                key,
                key_of_expected: RandomKey::new(options.seed, Purpose::Expect, 0),
            };
            paths.sample(starts)
        }
    }
}

/// Samples of the light at one point, before the albedo.
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
        let sampler = BounceSampler::new(self.lights(), LIGHT_SHARE);
        let surfaces = surfaces_of_pixels(camera, features, emission_threshold, &[]);
        let of_surface = |(pixel, vertex): &(u32, Vertex)| {
            let points = Points::new(key, *pixel);
            self.irradiance_at(&vertex.surface, &sampler, num_samples, &points)
        };
        let found: Vec<Vec3> = surfaces.par_iter().map(of_surface).collect();
        let mut irradiance = vec![Vec3::ZERO; camera.num_pixels()];
        for ((pixel, _), light) in surfaces.iter().zip(found) {
            irradiance[*pixel as usize] = light;
        }
        irradiance
    }
}
