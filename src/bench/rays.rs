//! Stages of the ray tracer.

use super::sheet::{Sheet, Unit};
use super::stage::Bench;
use anyhow::Result;
use eagpt_scene::Camera;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::bvh::Bvh;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::cpu::{CameraRecord, CpuScene};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::matrix::NUM_REALIZATIONS;
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::{Integrator, LightOptions, Ray, Tracer};
use rayon::prelude::*;
use std::hint::black_box;

/// Rays of a run, at most: from pixels spread over the views.
const MAX_RAYS: usize = 200_000;

/// Building what rays are traced against, and refitting it after Gaussians have moved.
pub(super) fn structure(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let mut set = SurfelSet::new(bench.gaussians);
    sheet.measure("build", Unit::Seconds, 1.0, || {
        black_box(Bvh::new(&set));
        Ok(())
    })?;
    let mut bvh = Bvh::new(&set);
    sheet.measure("update and refit", Unit::Seconds, 1.0, || {
        set.update(bench.gaussians);
        bvh.refit(&set);
        Ok(())
    })
}

/// Camera rays, tiles of pixels at a time.
pub(super) fn camera_rays(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    through_cameras(bench, sheet, HitSearch::Tiles)
}

/// Camera rays, each on its own.
pub(super) fn single_rays(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let scene = CpuScene::new(bench.gaussians);
    through_cameras(bench, sheet, HitSearch::SingleRays(scene.bvh()))
}

fn through_cameras(bench: &Bench<'_>, sheet: &mut Sheet<'_>, search: HitSearch<'_>) -> Result<()> {
    let set = SurfelSet::new(bench.gaussians);
    let num_rays = bench.num_pixels() as f64;
    sheet.measure("forward", Unit::Rays, num_rays, || {
        for camera in bench.cameras() {
            black_box(camera::trace(&set, camera, search, Keep::Nothing));
        }
        Ok(())
    })?;
    let mut record = CameraRecord::default();
    sheet.measure("forward and adjoint", Unit::Rays, num_rays, || {
        for camera in bench.cameras() {
            let features = record.trace(&set, camera, search, Keep::Record);
            black_box(record.adjoint(&set, &features.pixels, GradientMask::Everything));
        }
        Ok(())
    })
}

/// Rays that leave surfaces in all directions.
pub(super) fn bounce_rays(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let scene = CpuScene::new(bench.gaussians);
    let rays = rays_from_surfaces(bench, &scene, |_, surface, [a, b, ..]| {
        Some(surface.ray(cosine_direction(surface.normal, a, b)))
    })?;
    sheet.measure("all hits, blended", Unit::Rays, rays.len() as f64, || {
        rays.par_iter().for_each(|ray| {
            black_box(scene.trace(ray));
        });
        Ok(())
    })?;
    one_hit(sheet, &scene, &rays)
}

/// Rays from surfaces towards emitters.
pub(super) fn shadow_rays(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let scene = CpuScene::new(bench.gaussians);
    let rays = rays_from_surfaces(bench, &scene, |scene, surface, [a, b, pick, _]| {
        let direction = scene.lights()?.sample(surface.position, pick, a, b)?;
        (direction.dot(surface.normal) > 0.0).then(|| surface.ray(direction))
    })?;
    one_hit(sheet, &scene, &rays)
}

fn one_hit(sheet: &mut Sheet<'_>, scene: &CpuScene, rays: &[Ray]) -> Result<()> {
    sheet.measure(
        "one hit, by its weight",
        Unit::Rays,
        rays.len() as f64,
        || {
            rays.par_iter().enumerate().for_each(|(seed, ray)| {
                black_box(scene.sample_hit(ray, seed as u32));
            });
            Ok(())
        },
    )?;
    // As matrix are traced: rays of a realization together.
    let together = rays.len().div_ceil(NUM_REALIZATIONS as usize);
    sheet.measure(
        "one hit of a realization",
        Unit::Rays,
        rays.len() as f64,
        || {
            rays.par_iter().enumerate().for_each(|(at, ray)| {
                black_box(scene.realization_hit(ray, (at / together) as u32));
            });
            Ok(())
        },
    )
}

/// A ray from every n-th pixel's surface that `ray` makes one of.
fn rays_from_surfaces(
    bench: &Bench<'_>,
    scene: &CpuScene,
    ray: impl Fn(&CpuScene, &Surface, [f32; 4]) -> Option<Ray>,
) -> Result<Vec<Ray>> {
    let step = bench.num_pixels().div_ceil(MAX_RAYS).max(1);
    let key = RandomKey::new(0, Purpose::Render, 0);
    let mut rays = Vec::new();
    for (view, camera) in bench.cameras().enumerate() {
        let frame = camera.ray_frame();
        let features = scene.gbuffer(camera)?;
        for (pixel, seen) in features.pixels.iter().enumerate().step_by(step) {
            let (x, y) = column_and_row(camera, pixel);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let numbers = key.stream(pixel as u32, view as u32).next_uniforms();
            let surface = Surface::at(frame.origin, direction, seen);
            rays.extend(surface.and_then(|surface| ray(scene, &surface, numbers)));
        }
    }
    Ok(rays)
}

fn column_and_row(camera: &Camera, pixel: usize) -> (u32, u32) {
    (pixel as u32 % camera.width, pixel as u32 / camera.width)
}

/// Frames of multi-bounce path tracing, one sample for each pixel.
pub(super) fn paths(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let scene = CpuScene::new(bench.gaussians);
    let integrator = Integrator::Path {
        num_samples: 1,
        max_bounces: 7,
        roulette_from: None,
    };
    let camera = &bench.views[0].camera;
    let num_paths = camera.num_pixels() as f64;
    sheet.measure("7 bounces, next event", Unit::Paths, num_paths, || {
        black_box(scene.render(camera, &integrator, &LightOptions::default())?);
        Ok(())
    })
}
