//! Rays per second of the CPU engine on 60,000 Gaussians at 270×180: camera rays forward and adjoint, by tiles and one at a time,
//! and path tracing. `cargo bench -p eagpt-trace`.
#![allow(
    missing_docs,
    reason = "the macros of the benchmark harness write undocumented items"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use eagpt_scene::{Camera, Gaussians};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle, sphere};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::Wanted;
use eagpt_trace::cpu::camera::{self, HitSearch, Keep};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::Sampling;
use eagpt_trace::{Integrator, LightOptions, Tracer};
use glam::{DVec3, Vec3};
use std::hint::black_box;

/// A white room of 50,000 discs with a lamp under the ceiling and a ball of 10,000 discs.
fn room() -> Gaussians {
    let walls = cube(1.0, 0.0219, |side| {
        material(Vec3::splat(0.3), 0.0, Vec3::splat(0.5) + side * 0.2)
    });
    let lamp = material(Vec3::splat(5.0), 1.0, Vec3::ZERO);
    let lamp = rectangle(Vec3::Z * 0.97, Vec3::X * 0.3, Vec3::Y * 0.3, 0.03, lamp);
    let ball = sphere(10_000, 0.3, |_| material(Vec3::ONE, 0.0, Vec3::splat(0.7)));
    walls.into_iter().chain(lamp).chain(ball.iter()).collect()
}

fn view() -> Camera {
    look_at(
        DVec3::new(-0.8, 0.7, 0.3),
        DVec3::new(0.3, -0.2, -0.1),
        270,
        180,
    )
}

fn camera_rays(c: &mut Criterion) {
    let (gaussians, camera) = (room(), view());
    let set = SurfelSet::new(&gaussians);
    let scene = CpuScene::new(&gaussians);
    let mut group = c.benchmark_group(format!("camera rays, {} Gaussians", gaussians.len()));
    group
        .throughput(Throughput::Elements(camera.num_pixels() as u64))
        .sample_size(20);
    for (name, search) in [
        ("tiles", HitSearch::Tiles),
        ("single rays", HitSearch::SingleRays(scene.bvh())),
    ] {
        group.bench_function(format!("forward, {name}"), |b| {
            b.iter(|| black_box(camera::trace(&set, &camera, search, Keep::Nothing)));
        });
        group.bench_function(format!("forward and adjoint, {name}"), |b| {
            b.iter(|| {
                let (sums, mut record) = camera::trace(&set, &camera, search, Keep::Record);
                black_box(record.adjoint(&set, &sums.pixels, Wanted::Everything))
            });
        });
    }
    let (sums, mut record) = camera::trace(&set, &camera, HitSearch::Tiles, Keep::Record);
    group.bench_function("adjoint alone", |b| {
        b.iter(|| black_box(record.adjoint(&set, &sums.pixels, Wanted::Everything)));
    });
    group.finish();
}

fn paths(c: &mut Criterion) {
    let (gaussians, camera) = (room(), view());
    let scene = CpuScene::new(&gaussians);
    let mut group = c.benchmark_group("paths of at most 7 bounces");
    group
        .throughput(Throughput::Elements(camera.num_pixels() as u64))
        .sample_size(10);
    for (name, sampling) in [
        ("cosine", Sampling::Cosine),
        ("next event", Sampling::NextEvent),
    ] {
        let options = LightOptions {
            sampling,
            ..LightOptions::default()
        };
        let path = Integrator::Path {
            num_samples: 1,
            max_bounces: 7,
            roulette_from: None,
        };
        group.bench_function(name, |b| {
            b.iter(|| black_box(scene.render(&camera, &path, &options)));
        });
    }
    group.finish();
}

fn refit(c: &mut Criterion) {
    let gaussians = room();
    let mut scene = CpuScene::new(&gaussians);
    let mut group = c.benchmark_group("acceleration structure");
    group.sample_size(20);
    group.bench_function("build", |b| b.iter(|| black_box(CpuScene::new(&gaussians))));
    group.bench_function("refit", |b| b.iter(|| scene.update(black_box(&gaussians))));
    group.finish();
}

criterion_group!(benches, camera_rays, paths, refit);
criterion_main!(benches);
