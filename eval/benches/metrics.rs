//! The metrics of a pair of images, 540×360 and 24 megapixels: HDR- and LDR-FLIP, SSIM, PSNR.
//! `cargo bench -p eagpt-eval`.
#![allow(
    missing_docs,
    reason = "the macros of the benchmark harness write undocumented items"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use eagpt_eval::{FlipOptions, flip_hdr, flip_ldr, psnr_pq, psnr_srgb, srgb_clipped, ssim};
use eagpt_scene::Image;
use std::hint::black_box;

/// A wall in uneven light with a lamp of 16 in every 64 × 64 pixels, and the same with noise: seven
/// exposures.
fn pair(width: u32, height: u32) -> (Image<3>, Image<3>) {
    let mut reference = Image::filled(width, height, [0.0; 3]);
    let mut test = reference.clone();
    for y in 0..height {
        for x in 0..width {
            let i = y as usize * width as usize + x as usize;
            let lamp = if x % 64 < 8 && y % 64 < 8 { 16.0 } else { 0.0 };
            for c in 0..3 {
                let wave = ((x * 7 + y * 3 + c * 11) % 256) as f32 / 1024.0;
                let noise = ((x * 37 + y * 91 + c * 53) % 17) as f32 / 256.0;
                reference.pixels_mut()[i][c as usize] = 0.02 + wave + lamp;
                test.pixels_mut()[i][c as usize] = 0.02 + wave + lamp + noise;
            }
        }
    }
    (reference, test)
}

fn metrics(c: &mut Criterion) {
    for (name, width, height) in [("540x360", 540, 360), ("24 MP", 6000, 4000)] {
        let (reference, test) = pair(width, height);
        let (reference_srgb, test_srgb) = (srgb_clipped(&reference), srgb_clipped(&test));
        let options = FlipOptions::default();
        let mut group = c.benchmark_group(name);
        group
            .throughput(Throughput::Elements(u64::from(width) * u64::from(height)))
            .sample_size(10);
        group.bench_function("HDR-FLIP", |b| {
            b.iter(|| black_box(flip_hdr(&reference, &test, &options)));
        });
        group.bench_function("LDR-FLIP", |b| {
            b.iter(|| black_box(flip_ldr(&reference_srgb, &test_srgb, options.ppd)));
        });
        group.bench_function("SSIM", |b| {
            b.iter(|| black_box(ssim(&reference_srgb, &test_srgb)));
        });
        group.bench_function("PSNR, sRGB", |b| {
            b.iter(|| black_box(psnr_srgb(&reference, &test)));
        });
        group.bench_function("PSNR, PQ", |b| {
            b.iter(|| black_box(psnr_pq(&reference, &test)));
        });
        group.finish();
    }
}

criterion_group!(benches, metrics);
criterion_main!(benches);
