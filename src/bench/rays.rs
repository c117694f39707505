//! Stages of the ray tracer.

use super::inputs::Bench;
use super::sheet::{Sheet, Unit};
use anyhow::Result;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::bvh::Bvh;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::cpu::realizations::NUM_REALIZATIONS;
use eagpt_trace::cpu::{CameraRecord, CpuScene};
#[cfg(feature = "gpu")]
use eagpt_trace::gpu::{self, GpuScene};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::matrix::{Directions, Receiver};
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{EMISSION_THRESHOLD, Sampling};
use eagpt_trace::{Device, Integrator, LightOptions, Ray, Tracer};
use glam::Vec3;
use rayon::prelude::*;
use std::hint::black_box;
#[cfg(feature = "gpu")]
use std::sync::Arc;

/// Rays of a run, at most: from pixels spread over the views.
const MAX_RAYS: usize = 200_000;
/// Gaussians that transport is traced for, at most, with so many directions each.
const MAX_RECEIVERS: usize = 8192;
const DIRECTIONS: u32 = 64;

/// Building what rays are traced against, and refitting it after Gaussians have moved; on a GPU,
/// bringing Gaussians there.
pub(super) fn structure(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    if !bench.is_on_cpu() {
        sheet.measure("build", Unit::Seconds, 1.0, || bench.tracer())?;
        let mut tracer = bench.tracer()?;
        return sheet.measure("update and refit", Unit::Seconds, 1.0, || {
            Ok(tracer.update(bench.gaussians)?)
        });
    }
    let mut set = SurfelSet::new(bench.gaussians);
    sheet.measure("build", Unit::Seconds, 1.0, || Ok(Bvh::new(&set)))?;
    let mut bvh = Bvh::new(&set);
    sheet.measure("update and refit", Unit::Seconds, 1.0, || {
        set.update(bench.gaussians);
        bvh.refit(&set);
        Ok(())
    })
}

/// Camera rays, tiles of pixels at a time.
pub(super) fn camera_rays(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    match bench.device {
        Device::Cpu => cpu_cameras(bench, sheet, HitSearch::Tiles)?,
        #[cfg(feature = "gpu")]
        Device::Gpu(device) => gpu_cameras(bench, sheet, device)?,
    }
    let tracer = bench.tracer()?;
    let num_rays = bench.num_pixels() as f64;
    sheet.measure("contributions of Gaussians", Unit::Rays, num_rays, || {
        for camera in bench.cameras() {
            black_box(tracer.contributions(camera, &|_, _| 1.0)?);
        }
        Ok(())
    })
}

/// Camera rays, each on its own.
pub(super) fn single_rays(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let scene = CpuScene::new(bench.gaussians);
    cpu_cameras(bench, sheet, HitSearch::SingleRays(scene.bvh()))
}

fn cpu_cameras(bench: &Bench<'_>, sheet: &mut Sheet<'_>, search: HitSearch<'_>) -> Result<()> {
    let set = SurfelSet::new(bench.gaussians);
    let num_rays = bench.num_pixels() as f64;
    sheet.measure("forward", Unit::Rays, num_rays, || {
        for camera in bench.cameras() {
            black_box(camera::trace(&set, camera, search, Keep::Nothing));
        }
        Ok(())
    })?;
    // Memory as training uses it: one record for all images.
    let mut record = CameraRecord::default();
    for (what, gradients) in [
        ("forward and adjoint", GradientMask::Everything),
        (
            "forward and adjoint of light and material",
            GradientMask::LightAndMaterial,
        ),
    ] {
        sheet.measure(what, Unit::Rays, num_rays, || {
            for camera in bench.cameras() {
                let features = record.trace(&set, &(*camera).into(), search, Keep::Record);
                black_box(record.adjoint(&set, &features.pixels, gradients));
            }
            Ok(())
        })?;
    }
    Ok(())
}

/// The rays as training traces them, in buffers that stay on the GPU.
#[cfg(feature = "gpu")]
fn gpu_cameras(bench: &Bench<'_>, sheet: &mut Sheet<'_>, device: &Arc<gpu::Device>) -> Result<()> {
    let fit = GpuScene::new(device, bench.gaussians)?;
    // Makes the buffers as large as any of the cameras needs.
    for camera in bench.cameras() {
        fit.contributions(camera, &|_, _| 1.0)?;
    }
    let num_rays = bench.num_pixels() as f64;
    let trace = |with_adjoint: bool| -> Result<()> {
        for camera in bench.cameras() {
            let mut commands = device.commands();
            let rays = (*camera).into();
            fit.forward(&rays, &mut commands)?;
            if with_adjoint {
                fit.backward(&rays, &mut commands)?;
            }
            device.submit(commands)?;
        }
        Ok(device.wait()?)
    };
    sheet.measure("forward", Unit::Rays, num_rays, || trace(false))?;
    sheet.measure("forward and adjoint", Unit::Rays, num_rays, || trace(true))?;
    sheet.measure_kernels("forward and adjoint", || trace(true))?;
    sheet.measure("forward, read back", Unit::Rays, num_rays, || {
        for camera in bench.cameras() {
            black_box(fit.gbuffer(camera)?);
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
    let num_rays = rays.len() as f64;
    if !bench.is_on_cpu() {
        let tracer = bench.tracer()?;
        return sheet.measure("all hits, blended", Unit::Rays, num_rays, || {
            Ok(tracer.trace_rays(&rays)?)
        });
    }
    sheet.measure("all hits, blended", Unit::Rays, num_rays, || {
        rays.par_iter().for_each(|ray| {
            black_box(scene.trace(ray));
        });
        Ok(())
    })?;
    one_hit(sheet, &scene, &rays)?;
    // As paths take them: a ray's realization is another than that of the ray before.
    sheet.measure(
        "one hit of realizations in turns",
        Unit::Rays,
        num_rays,
        || {
            rays.par_iter().enumerate().for_each(|(index, ray)| {
                black_box(scene.realization_hit(ray, index as u32));
            });
            Ok(())
        },
    )
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

/// Entries of the light-transport matrix, half of the directions towards emitters.
pub(super) fn transport(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let tracer = bench.tracer()?;
    let receivers = receivers(bench.gaussians);
    let directions = Directions::divided(DIRECTIONS, 2);
    let key = RandomKey::new(0, Purpose::Bake, 1);
    sheet.measure_counted("64 directions", Unit::Rays, || {
        let matrix = tracer.trace_transport(&receivers, directions, key)?;
        Ok(matrix.num_rays as f64)
    })
}

/// Gaussians that reflect, on their sides towards the middle of the scene.
fn receivers(gaussians: &Gaussians) -> Vec<Receiver> {
    let middle = gaussians
        .bounds()
        .map_or(Vec3::ZERO, |(low, high)| 0.5 * (low + high));
    let all = (0..).zip(gaussians.iter());
    let reflecting = all.filter(|(_, g)| g.emission <= EMISSION_THRESHOLD);
    reflecting
        .take(MAX_RECEIVERS)
        .map(|(index, g)| {
            let axis = g.rotation * Vec3::Z;
            let surface = Surface {
                position: g.position,
                normal: axis * axis.dot(middle - g.position).signum(),
                offset: 0.5 * g.scale.x,
            };
            (index, surface)
        })
        .collect()
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
    // As matrix entries are traced: rays of a realization together.
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

/// Path-traced frames of one view.
pub(super) fn paths(bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
    let tracer = bench.tracer()?;
    let num_samples = bench.num_samples;
    let path = Integrator::Path {
        num_samples,
        max_bounces: 7,
        roulette_from: None,
    };
    let camera = &bench.views[0].camera;
    let num_paths = camera.num_pixels() as f64 * f64::from(num_samples);
    for (what, integrator, sampling) in [
        ("7 bounces, next event", path, Sampling::NextEvent),
        ("7 bounces, cosine", path, Sampling::Cosine),
        (
            "1 bounce, next event",
            Integrator::OneBounce { num_samples },
            Sampling::NextEvent,
        ),
    ] {
        let options = LightOptions {
            sampling,
            ..LightOptions::default()
        };
        let mut frame = || -> Result<()> {
            black_box(tracer.render(camera, &integrator, &options)?);
            Ok(())
        };
        sheet.measure(what, Unit::Paths, num_paths, &mut frame)?;
        sheet.measure_kernels(what, frame)?;
    }
    Ok(())
}
