//! Rays per second of the CPU engine on 60,000 Gaussians at 270×180: camera rays forward and
//! adjoint, by tiles and one at a time, and path tracing. `cargo bench -p eagpt-trace`.
#![allow(
    missing_docs,
    reason = "the macros of the benchmark harness write undocumented items"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use eagpt_scene::{Camera, Dataset, Gaussians, ply};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle, sphere};
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::camera::{HitSearch, Keep};
use eagpt_trace::cpu::{CameraRecord, CpuScene};
use eagpt_trace::transport::Sampling;
use eagpt_trace::{Integrator, LightOptions, Tracer};
use glam::{DVec3, Vec3};
use std::hint::black_box;
use std::path::PathBuf;

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

/// What camera rays are traced through: the scene in the file that `EAGPT_BENCH_SCENE` names, seen
/// by every 24th camera of the dataset `EAGPT_BENCH_DATASET`; without them, the room.
fn subject() -> (Gaussians, Vec<Camera>) {
    let path = |name| std::env::var_os(name).map(PathBuf::from);
    let (Some(scene), Some(dataset)) = (path("EAGPT_BENCH_SCENE"), path("EAGPT_BENCH_DATASET"))
    else {
        return (room(), vec![view()]);
    };
    let gaussians = ply::read_gaussians(&scene).expect("EAGPT_BENCH_SCENE is a scene");
    let dataset = Dataset::open_cameras(&dataset).expect("EAGPT_BENCH_DATASET is a dataset");
    let cameras = dataset.frames().iter().step_by(24);
    (gaussians, cameras.map(|frame| frame.camera).collect())
}

fn camera_rays(c: &mut Criterion) {
    let (gaussians, cameras) = subject();
    let scene = CpuScene::new(&gaussians);
    let set = scene.surfels();
    let mut group = c.benchmark_group(format!("camera rays, {} Gaussians", gaussians.len()));
    let num_rays: usize = cameras.iter().map(Camera::num_pixels).sum();
    group
        .throughput(Throughput::Elements(num_rays as u64))
        .sample_size(20);
    // Memory as training uses it: one record for all images.
    let mut record = CameraRecord::default();
    for (name, search) in [
        ("tiles", HitSearch::Tiles),
        ("single rays", HitSearch::SingleRays(scene.bvh())),
    ] {
        group.bench_function(format!("forward, {name}"), |b| {
            b.iter(|| {
                for camera in &cameras {
                    black_box(record.trace(set, camera, search, Keep::Nothing));
                }
            });
        });
        for (wanted, what) in [
            (GradientMask::Everything, "adjoint"),
            (
                GradientMask::LightAndMaterial,
                "adjoint of light and material",
            ),
        ] {
            group.bench_function(format!("forward and {what}, {name}"), |b| {
                b.iter(|| {
                    for camera in &cameras {
                        let features = record.trace(set, camera, search, Keep::Record);
                        black_box(record.adjoint(set, &features.pixels, wanted));
                    }
                });
            });
        }
    }
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
