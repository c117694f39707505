//! The integrators on the CPU (EAG-PT, sections 3.3 and 3.4): camera rays are blended, others take
//! one hit unless told otherwise.

use super::CpuScene;
use super::glossy::Mirrors;
use super::path::Paths;
use super::record::CameraRecord;
use super::samples::{PathLight, Samples};
use crate::features::GBuffer;
use crate::ray::Ray;
use crate::transport::lights::{BounceSampler, Lights};
use crate::transport::points::Points;
use crate::transport::start::Surface;
use crate::transport::vertex::{Start, Vertex, surfaces_of_pixels};
use crate::transport::{Integrator, LIGHT_SHARE, LightOptions, Sampling};
use crate::view::{Pixels, RenderedView, SampledLight, View};
use eagpt_scene::Camera;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::Vec3;
use rayon::prelude::*;
use std::convert::Infallible;

/// Frame of `camera`, given the composited features of its camera rays and, of a glossy scene,
/// their record (`0-bounce` without mirrors needs none). Deterministic for a seed: each pixel has
/// its own random numbers and adds its samples in order.
pub(super) fn render(
    scene: &CpuScene,
    camera: &Camera,
    (features, record): (GBuffer, CameraRecord),
    integrator: &Integrator,
    options: &LightOptions,
) -> RenderedView {
    let lights = match options.sampling {
        Sampling::Cosine => None,
        Sampling::NextEvent => scene.lights(),
    };
    let pixels = match integrator {
        Integrator::ZeroBounce if !scene.has_mirrors() => Pixels::diffuse(features),
        _ => scene.pixels(&record, features),
    };
    let view = View::new(camera, pixels, integrator, options.emission_threshold);
    let starts = view.starts();
    let sampled = sampled(scene, &starts, lights, integrator, options, camera.width);
    let lights: Vec<SampledLight> = sampled.iter().map(Samples::light).collect();
    let trace = |rays: &[Ray]| {
        let met = rays.par_iter().map(|ray| scene.trace_glossy(ray));
        Ok::<_, Infallible>(met.collect())
    };
    match view.finish(&starts, &lights, trace) {
        Ok(view) => view,
        Err(never) => match never {},
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
        Integrator::ZeroBounce => Vec::new(),
        Integrator::Gather { num_samples } | Integrator::OneBounce { num_samples } => {
            let sampler = BounceSampler::new(lights, LIGHT_SHARE);
            let mirrors = Mirrors {
                scene,
                lights,
                num_samples,
                hit: CpuScene::sample_hit,
            };
            let of_start = |start: &Start| {
                let points = Points::new(key, start.pixel);
                if start.vertex.is_glossy() {
                    return mirrors.samples(start, &points);
                }
                let mut samples = Samples::default();
                for s in 0..num_samples {
                    let light = bounced(scene, &sampler, &start.vertex.surface, &points, s);
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
