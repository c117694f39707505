//! Files at full size: an EXR image of 24 megapixels (half precision, ZIP) and a scene of a million
//! Gaussians. `cargo bench -p eagpt-scene`.
#![allow(
    missing_docs,
    reason = "the macros of the benchmark harness write undocumented items"
)]
#![expect(
    clippy::unwrap_used,
    reason = "a benchmark ends with its first surprise"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Image, ply, random_cloud};
use std::hint::black_box;

const NUM_GAUSSIANS: usize = 1_000_000;

/// Uneven light with noise, so that it compresses as photographs do.
fn image(width: u32, height: u32) -> Image<3> {
    let mut image = Image::filled(width, height, [0.0; 3]);
    for (index, pixel) in image.pixels_mut().iter_mut().enumerate() {
        let (x, y) = (index as u32 % width, index as u32 / width);
        for c in 0..3 {
            let wave = ((x * 7 + y * 3 + c * 11) % 256) as f32 / 1024.0;
            let noise = ((x * 37 + y * 91 + c * 53) % 17) as f32 / 256.0;
            pixel[c as usize] = 0.02 + wave + noise;
        }
    }
    image
}

fn files(c: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let image = image(6000, 4000);
    let path = folder.path().join("image.exr");
    let mut group = c.benchmark_group("EXR, 24 MP, bytes of the samples");
    group
        .throughput(Throughput::Bytes(image.pixels().len() as u64 * 6))
        .sample_size(10);
    group.bench_function("write", |b| {
        b.iter(|| exr::write_rgb(&path, &image, Precision::Half).unwrap());
    });
    group.bench_function("read", |b| {
        b.iter(|| black_box(exr::read_rgb(&path).unwrap()));
    });
    group.finish();

    let gaussians = random_cloud(NUM_GAUSSIANS, 0);
    let path = folder.path().join("scene.ply");
    let mut group = c.benchmark_group("PLY, 1 M Gaussians");
    group
        .throughput(Throughput::Bytes(NUM_GAUSSIANS as u64 * 17 * 4))
        .sample_size(10);
    group.bench_function("write", |b| {
        b.iter(|| ply::write_gaussians(&path, &gaussians).unwrap());
    });
    group.bench_function("read", |b| {
        b.iter(|| black_box(ply::read_gaussians(&path).unwrap()));
    });
    group.finish();
}

criterion_group!(benches, files);
criterion_main!(benches);
