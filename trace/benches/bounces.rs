//! Rays per second of bounces: from points on surfaces, in cosine-weighted directions, blended,
//! with one chosen hit, and through realizations of the scene. Rooms of the same shape at finer and
//! finer discs, and the scene that `EAGPT_SCENE` names, if it does. `cargo bench -p eagpt-trace
//! --bench bounces`; one thread.
#![allow(
    missing_docs,
    reason = "the macros of the benchmark harness write undocumented items"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussians, ply};
use eagpt_testkit::gaussians::{cube, material, rectangle, sphere};
use eagpt_trace::Ray;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::cpu::bvh::RayScratch;
use eagpt_trace::cpu::realizations::Realizations;
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::transport::start::Surface;
use glam::Vec3;
use std::hint::black_box;
use std::path::Path;

const NUM_RAYS: u32 = 20_000;

/// A room of some `num` discs: five in six on the walls, the rest on a ball, and a lamp.
fn room(num: usize) -> Gaussians {
    let spacing = (24.0 / (num as f32 * 5.0 / 6.0)).sqrt();
    let walls = cube(1.0, spacing, |side| {
        material(Vec3::splat(0.3), 0.0, Vec3::splat(0.5) + side * 0.2)
    });
    let lamp = material(Vec3::splat(5.0), 1.0, Vec3::ZERO);
    let lamp = rectangle(Vec3::Z * 0.97, Vec3::X * 0.3, Vec3::Y * 0.3, spacing, lamp);
    let ball = sphere(num / 6, 0.3, |_| material(Vec3::ONE, 0.0, Vec3::splat(0.7)));
    walls.into_iter().chain(lamp).chain(ball.iter()).collect()
}

/// Bounces of paths that begin at the middle of the scene: whatever they meet is a place from which
/// light goes on.
fn bounces(scene: &CpuScene, gaussians: &Gaussians) -> Vec<Ray> {
    let middle = gaussians.positions.iter().sum::<Vec3>() / gaussians.len() as f32;
    let key = RandomKey::new(0, Purpose::Render, 0);
    let mut rays = Vec::new();
    for path in 0..NUM_RAYS {
        let [a, b, c, d] = key.stream(path, 0).next_uniforms();
        let axis = if a < 0.5 { Vec3::Z } else { Vec3::NEG_Z };
        let mut ray = Ray::free(
            (middle + 0.1 * (c - 0.5)).to_array(),
            cosine_direction(axis, b, d).to_array(),
        );
        for bounce in 1..4 {
            let met = scene.trace(&ray);
            let direction = Vec3::from(ray.direction);
            let Some(surface) = Surface::at(ray.origin.into(), direction, &met) else {
                break;
            };
            let [a, b, ..] = key.stream(path, bounce).next_uniforms();
            ray = surface.ray(cosine_direction(surface.normal, a, b));
            rays.push(ray);
        }
    }
    // The bounces of one path follow each other; those of a benchmark shall not.
    let num = rays.len();
    (0..NUM_RAYS as usize)
        .map(|i| rays[i * 7919 % num])
        .collect()
}

fn measure(c: &mut Criterion, name: &str, gaussians: &Gaussians) {
    let scene = CpuScene::new(gaussians);
    let rays = bounces(&scene, gaussians);
    let mut scratch = RayScratch::default();
    let mut group = c.benchmark_group(format!("bounces, {name}, {} Gaussians", gaussians.len()));
    group
        .throughput(Throughput::Elements(rays.len() as u64))
        .sample_size(10);
    group.bench_function("blended", |b| {
        b.iter(|| {
            for ray in &rays {
                black_box(scene.bvh().trace(scene.surfels(), ray, &mut scratch));
            }
        });
    });
    group.bench_function("one hit", |b| {
        b.iter(|| {
            for (ray, seed) in rays.iter().zip(0..) {
                black_box(scene.bvh().sample_hit(ray, seed, &mut scratch));
            }
        });
    });
    let realizations = Realizations::new(scene.surfels(), 0);
    for (name, together) in [
        ("a realization, at random", 1),
        ("a realization, in turns", 512),
    ] {
        group.bench_function(name, |b| {
            b.iter(|| {
                for (ray, i) in rays.iter().zip(0..) {
                    black_box(realizations.nearest(ray, i / together, &mut scratch));
                }
            });
        });
    }
    group.finish();
}

fn rooms(c: &mut Criterion) {
    for num in [25_000, 60_000, 250_000, 1_000_000] {
        measure(c, "room", &room(num));
    }
    let path = std::env::var_os("EAGPT_SCENE");
    if let Some(gaussians) = path.and_then(|path| ply::read_gaussians(Path::new(&path)).ok()) {
        measure(c, "file", &gaussians);
    }
}

criterion_group!(benches, rooms);
criterion_main!(benches);
