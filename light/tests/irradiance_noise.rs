//! Noise and bias of the irradiance at Gaussians of a trained scene, against many directions.
//!
//! `EAGPT_SCENE` is a scene, `EAGPT_CAMERAS` the dataset of its cameras. The reference, at some of
//! the receivers, is kept in the file `EAGPT_REFERENCE` if that is set.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a measurement fails by panicking, and prints"
)]

use eagpt_light::irradiance::NoisyLight;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::surfaces;
use eagpt_scene::color::luminance;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Dataset, Gaussians, ply};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::transport::matrix::{Directions, Receiver};
use glam::Vec3;
use std::path::PathBuf;
use std::time::Instant;

const REFERENCE: Directions = Directions {
    bsdf: 8192,
    to_lights: 8192,
};
/// Receivers of the reference, about.
const NUM_REFERENCE: usize = 1500;
/// Numbers of directions, and one in how many is a light sample.
const MEASURED: [(u32, u32); 3] = [(64, 2), (128, 4), (128, 2)];

fn path(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).map(PathBuf::from)
}

/// Luminances of every `every`-th.
fn bright(light: &[Vec3], every: usize) -> Vec<f64> {
    let some = light.iter().step_by(every);
    some.map(|l| f64::from(luminance(l.to_array()))).collect()
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Errors of luminances against `wanted`: RMS and bias over the mean, and percentiles of the errors
/// over the whole light of each receiver, `all`.
fn errors(got: &[f64], wanted: &[f64], all: &[f64]) -> String {
    let num = got.len() as f64;
    let mean = wanted.iter().sum::<f64>() / num;
    let off: Vec<f64> = got.iter().zip(wanted).map(|(g, w)| g - w).collect();
    let rms = (off.iter().map(|o| o * o).sum::<f64>() / num).sqrt();
    let bias = off.iter().sum::<f64>() / num;
    let pairs = off.iter().zip(all);
    let mut relative: Vec<f64> = pairs.map(|(o, a)| o.abs() / a.max(1e-9)).collect();
    relative.sort_by(f64::total_cmp);
    format!(
        "rms {:.3}, relative rms {:.3}, median {:.3}, p90 {:.3}, bias {:+.4} ± {:.4}",
        rms / mean,
        (relative.iter().map(|r| r * r).sum::<f64>() / num).sqrt(),
        relative[relative.len() / 2],
        relative[relative.len() * 9 / 10],
        bias / mean,
        rms / mean / num.sqrt()
    )
}

/// Gaussians that reflect, where cameras see them best.
fn receivers(scene: &Gaussians, tracer: &CpuScene) -> Vec<Receiver> {
    let dataset = Dataset::open_cameras(&path("EAGPT_CAMERAS").expect("EAGPT_CAMERAS")).unwrap();
    let frames = dataset.frames().iter().step_by(2);
    let cameras: Vec<Camera> = frames.map(|frame| frame.camera).collect();
    let seen = surfaces::best_seen(tracer, scene.len(), &cameras).unwrap();
    let mut receivers = surfaces::receivers(&seen);
    receivers.retain(|(i, _)| scene.emissions[*i as usize] <= EMISSION_THRESHOLD);
    receivers
}

/// Direct and indirect light, `directions` at each.
fn gather(
    scene: &Gaussians,
    tracer: &CpuScene,
    receivers: &[Receiver],
    directions: Directions,
    seed: u64,
) -> ([NoisyLight; 2], u64) {
    let key = RandomKey::new(seed, Purpose::Albedo, 0);
    let matrix = tracer.trace_transport(receivers, directions, key).unwrap();
    let direct = NoisyLight::direct(&matrix, directions);
    let indirect = NoisyLight::indirect(&matrix, directions, &scene.radiances);
    ([direct, indirect], matrix.num_rays)
}

/// Direct and indirect light, the one after the other, from the file if it is there.
fn reference(scene: &Gaussians, tracer: &CpuScene, receivers: &[Receiver]) -> Vec<Vec3> {
    let file = path("EAGPT_REFERENCE");
    if let Some(file) = file.as_ref().filter(|file| file.exists()) {
        let bytes = std::fs::read(file).unwrap();
        let (floats, _) = bytes.as_chunks::<4>();
        let floats: Vec<f32> = floats.iter().map(|b| f32::from_le_bytes(*b)).collect();
        return floats.chunks_exact(3).map(Vec3::from_slice).collect();
    }
    let ([direct, indirect], _) = gather(scene, tracer, receivers, REFERENCE, 99);
    let both: Vec<Vec3> = [direct.irradiance, indirect.irradiance].concat();
    if let Some(file) = file {
        let floats = both.iter().flat_map(Vec3::to_array);
        let bytes: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
        std::fs::write(file, bytes).unwrap();
    }
    both
}

#[test]
#[ignore = "measures a trained scene"]
fn noise_of_a_trained_scene() {
    let scene = ply::read_gaussians(&path("EAGPT_SCENE").expect("EAGPT_SCENE")).unwrap();
    let tracer = CpuScene::new(&scene);
    let receivers = receivers(&scene, &tracer);
    let emitting = scene.emissions.iter().filter(|e| **e > EMISSION_THRESHOLD);
    let (num_emitting, num) = (emitting.count(), receivers.len());
    println!(
        "{} Gaussians, {num_emitting} emit, {num} receivers",
        scene.len()
    );
    let every = num.div_ceil(NUM_REFERENCE);
    let some: Vec<Receiver> = receivers.iter().copied().step_by(every).collect();
    let wanted = reference(&scene, &tracer, &some);
    let (direct, indirect) = wanted.split_at(some.len());
    let wanted = [bright(direct, 1), bright(indirect, 1)];
    let all = sum(&wanted[0], &wanted[1]);
    let smoothing = Smoothing::new(&receivers);
    for (num, to_lights) in MEASURED {
        let directions = Directions::divided(num, to_lights);
        let start = Instant::now();
        let (light, num_rays) = gather(&scene, &tracer, &receivers, directions, 1);
        let seconds = start.elapsed().as_secs_f64();
        println!("{num} directions, 1/{to_lights} to lights: {seconds:.1} s, {num_rays} rays");
        let raw = light.each_ref().map(|of| of.irradiance.clone());
        let smooth = light.each_ref().map(|of| of.smoothed(&smoothing));
        let kept = |k: usize| {
            let total = |of: &[Vec3]| bright(of, 1).iter().sum::<f64>();
            total(&smooth[k]) / total(&raw[k]) - 1.0
        };
        println!(
            "  smoothing changes sums by {:+.1e}, {:+.1e}",
            kept(0),
            kept(1)
        );
        for (name, light) in [("as found", raw), ("smoothed", smooth)] {
            let [direct, indirect] = light.each_ref().map(|of| bright(of, every));
            let both = sum(&direct, &indirect);
            println!("  {name} direct    {}", errors(&direct, &wanted[0], &all));
            println!("  {name} indirect  {}", errors(&indirect, &wanted[1], &all));
            println!("  {name} both      {}", errors(&both, &all, &all));
        }
    }
}
