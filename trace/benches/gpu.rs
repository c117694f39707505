//! The engine on a device, in one command: `cargo bench -p eagpt-trace --bench gpu`. Half a million Gaussians at 540×360 on a GPU, 60,000 at
//! 270×180 where there is only a program that stands in for one. The name of the device stands in the names of the groups.
#![allow(
    missing_docs,
    reason = "the macros of the benchmark harness write undocumented items"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussians};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle, sphere};
use eagpt_trace::gpu::{Device, GpuScene, Kind, Wanted};
use eagpt_trace::ray::Ray;
use eagpt_trace::transport::links::{Directions, Receiver};
use eagpt_trace::transport::start::Surface;
use eagpt_trace::{Integrator, LightOptions, Tracer};
use glam::{DVec3, Mat3, Vec3};
use std::hint::black_box;
use std::sync::Arc;

/// A room with a lamp and a ball, of about `num` discs.
fn room(num: usize) -> Gaussians {
    // Five sixths of them on the walls: 24 square units.
    let spacing = (24.0 / (num as f32 * 5.0 / 6.0)).sqrt();
    let walls = cube(1.0, spacing, |side| {
        material(Vec3::splat(0.3), 0.0, Vec3::splat(0.5) + side * 0.2)
    });
    let lamp = material(Vec3::splat(5.0), 1.0, Vec3::ZERO);
    let lamp = rectangle(Vec3::Z * 0.97, Vec3::X * 0.3, Vec3::Y * 0.3, 0.03, lamp);
    let ball = sphere(num / 6, 0.3, |_| material(Vec3::ONE, 0.0, Vec3::splat(0.7)));
    walls.into_iter().chain(lamp).chain(ball.iter()).collect()
}

fn view(width: u32, height: u32) -> Camera {
    let (eye, target) = (DVec3::new(-0.8, 0.7, 0.3), DVec3::new(0.3, -0.2, -0.1));
    look_at(eye, target, width, height)
}

/// From points in the room in all directions.
fn bounce_rays(num: usize) -> Vec<Ray> {
    (0..num)
        .map(|i| {
            let turn = |step: f32| (i as f32 * step).fract() * 1.6 - 0.8;
            let azimuth = i as f32 * 2.399_963;
            let z = 1.0 - (2 * (i * 7919 % num) + 1) as f32 / num as f32;
            let flat = (1.0 - z * z).sqrt();
            let direction = Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), z).normalize();
            let origin = [turn(0.618_034), turn(0.754_877), turn(0.569_84)];
            Ray::free(origin, direction.to_array())
        })
        .collect()
}

/// What does not emit, from the side of the middle of the room.
fn receivers(gaussians: &Gaussians) -> impl Iterator<Item = Receiver> {
    let reflecting = (0..)
        .zip(gaussians.iter())
        .filter(|(_, g)| g.emission < 0.1);
    reflecting.map(|(i, g)| {
        let normal = Mat3::from_quat(g.rotation).z_axis;
        let surface = Surface {
            position: g.position,
            normal: -normal * normal.dot(g.position).signum(),
            slab: 0.5 * g.scale.x,
        };
        (i, surface)
    })
}

#[allow(clippy::print_stderr, reason = "a skipped benchmark says so")]
fn engine(c: &mut Criterion) {
    let device = Device::open(&Wanted::Hardware).or_else(|_| Device::open(&Wanted::Any));
    let device: Arc<Device> = match device {
        Ok(device) => device,
        Err(error) => {
            eprintln!("skipped: {error}");
            return;
        }
    };
    let is_software = device.adapter().kind == Kind::Software;
    let (num, camera, num_rays) = if is_software {
        (60_000, view(270, 180), 50_000)
    } else {
        (500_000, view(540, 360), 4_000_000)
    };
    let gaussians = room(num);
    let mut scene = GpuScene::new(&device, &gaussians).expect("the scene fits");
    let name = format!("{}, {} Gaussians", device.adapter().name, gaussians.len());
    let sums = scene.camera_sums(&camera).expect("the device works");

    let mut group = c.benchmark_group(format!("{name}: camera rays"));
    group
        .throughput(Throughput::Elements(camera.num_pixels() as u64))
        .sample_size(10);
    group.bench_function("forward, read back", |b| {
        b.iter(|| black_box(scene.camera_sums(&camera)));
    });
    group.bench_function("forward and adjoint, read back", |b| {
        b.iter(|| black_box(scene.camera_adjoint(&camera, &sums.pixels)));
    });
    group.finish();

    let rays = bounce_rays(num_rays);
    let queries: Vec<(Ray, u32)> = (0..).zip(&rays).map(|(seed, ray)| (*ray, seed)).collect();
    let mut group = c.benchmark_group(format!("{name}: single rays"));
    group
        .throughput(Throughput::Elements(rays.len() as u64))
        .sample_size(10);
    group.bench_function("blended", |b| {
        b.iter(|| black_box(scene.trace_rays(&rays)));
    });
    group.bench_function("one hit, chosen", |b| {
        b.iter(|| black_box(scene.choose_hits(&queries)));
    });
    group.finish();

    let receivers: Vec<Receiver> = receivers(&gaussians).take(num_rays / 64).collect();
    let mut group = c.benchmark_group(format!("{name}: links"));
    group
        .throughput(Throughput::Elements(64 * receivers.len() as u64))
        .sample_size(10);
    group.bench_function("64 directions, half to emitters", |b| {
        let directions = Directions::divided(64, 2);
        let key = RandomKey::new(0, Purpose::Bake, 1);
        b.iter(|| black_box(scene.trace_links(&receivers, directions, key)));
    });
    group.finish();

    let mut group = c.benchmark_group(format!("{name}: light"));
    let num_samples = if is_software { 1 } else { 64 };
    let num_paths = camera.num_pixels() as u64 * u64::from(num_samples);
    group
        .throughput(Throughput::Elements(num_paths))
        .sample_size(10);
    let path = Integrator::Path {
        num_samples,
        max_bounces: 7,
        roulette_from: None,
    };
    for (kind, integrator) in [
        ("1-bounce", Integrator::OneBounce { num_samples }),
        ("path", path),
    ] {
        group.bench_function(kind, |b| {
            b.iter(|| black_box(scene.render(&camera, &integrator, &LightOptions::default())));
        });
    }
    group.finish();

    let mut group = c.benchmark_group(format!("{name}: scene"));
    group.sample_size(10);
    group.bench_function("update", |b| b.iter(|| scene.update(black_box(&gaussians))));
    group.finish();
}

criterion_group!(benches, engine);
criterion_main!(benches);
