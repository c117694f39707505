//! Noise and bias of the irradiance at Gaussians of a trained scene, against many directions.
//!
//! `EAGPT_SCENE` is a scene, `EAGPT_CAMERAS` the dataset of its cameras. The reference of some
//! receivers is kept in `EAGPT_REFERENCE` if that is set.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a measurement fails by panicking, and prints"
)]

use eagpt_scene::color::luminance;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Dataset, ply};
use eagpt_trace::Tracer;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::matrix::{Directions, Receiver, TransportMatrix};
use eagpt_train::irradiance::smooth::Smoothing;
use eagpt_train::surfaces::BestSeen;
use glam::Vec3;
use std::path::PathBuf;
use std::time::Instant;

const REFERENCE: Directions = Directions {
    bsdf: 8192,
    to_lights: 8192,
};
const NUM_REFERENCE: usize = 1500;

fn path(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).map(PathBuf::from)
}

fn bright(light: &[Vec3]) -> Vec<f64> {
    light
        .iter()
        .map(|l| f64::from(luminance(l.to_array())))
        .collect()
}

/// Errors of luminances against `wanted`: RMS over the mean of `wanted`, 90th percentile over
/// `all`, bias over the mean.
fn errors(got: &[f64], wanted: &[f64], all: &[f64]) -> String {
    let num = got.len() as f64;
    let mean = wanted.iter().sum::<f64>() / num;
    let ms = got
        .iter()
        .zip(wanted)
        .map(|(g, w)| (g - w).powi(2))
        .sum::<f64>()
        / num;
    let bias = got.iter().zip(wanted).map(|(g, w)| g - w).sum::<f64>() / num;
    let mut relative: Vec<f64> = (got.iter().zip(wanted).zip(all))
        .map(|((g, w), a)| (g - w).abs() / a.max(1e-9))
        .collect();
    relative.sort_by(f64::total_cmp);
    format!(
        "rms {:.3} relative rms {:.3} median {:.3} p90 {:.3} bias {:+.4}",
        ms.sqrt() / mean,
        (relative.iter().map(|r| r * r).sum::<f64>() / num).sqrt(),
        relative[relative.len() / 2],
        relative[relative.len() * 9 / 10],
        bias / mean
    )
}

#[test]
#[ignore = "measures a trained scene"]
fn noise_of_a_trained_scene() {
    let scene = ply::read_gaussians(&path("EAGPT_SCENE").expect("EAGPT_SCENE")).unwrap();
    let dataset = Dataset::open_cameras(&path("EAGPT_CAMERAS").expect("EAGPT_CAMERAS")).unwrap();
    let tracer = CpuScene::new(&scene);
    let mut best = BestSeen::new(scene.len());
    for frame in dataset.frames().iter().step_by(2) {
        best.add(&tracer, &frame.camera).unwrap();
    }
    let receivers: Vec<Receiver> = (0..)
        .zip(best.finish())
        .filter(|(i, _): &(u32, _)| scene.emissions[*i as usize] <= 0.1)
        .filter_map(|(i, found)| Some((i, found?)))
        .collect();
    println!(
        "{} Gaussians, {} emit, {} receivers",
        scene.len(),
        scene.emissions.iter().filter(|e| **e > 0.1).count(),
        receivers.len()
    );
    let every = receivers.len().div_ceil(NUM_REFERENCE);
    let some: Vec<Receiver> = receivers.iter().copied().step_by(every).collect();
    let reference = match path("EAGPT_REFERENCE").filter(|path| path.exists()) {
        Some(path) => std::fs::read(path).unwrap(),
        None => {
            let start = Instant::now();
            let key = RandomKey::new(99, Purpose::Albedo, 7);
            let matrix = TransportMatrix::trace(&tracer, &some, REFERENCE, key);
            let others = matrix.from_others(REFERENCE, &scene.radiances);
            println!("reference: {:.1} s", start.elapsed().as_secs_f64());
            let both = matrix.direct.iter().chain(&others);
            let bytes: Vec<u8> = both
                .flat_map(Vec3::to_array)
                .flat_map(f32::to_le_bytes)
                .collect();
            if let Some(path) = path("EAGPT_REFERENCE") {
                std::fs::write(path, &bytes).unwrap();
            }
            bytes
        }
    };
    let reference: Vec<Vec3> = reference
        .as_chunks::<12>()
        .0
        .iter()
        .map(|b| Vec3::from_slice(bytemuck_floats(b).as_slice()))
        .collect();
    let (wanted_direct, wanted_others) = reference.split_at(some.len());
    let (wanted_direct, wanted_others) = (bright(wanted_direct), bright(wanted_others));
    let all: Vec<f64> = (wanted_direct.iter().zip(&wanted_others))
        .map(|(a, b)| a + b)
        .collect();
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    println!(
        "direct {:.4}, indirect {:.4}",
        mean(&wanted_direct),
        mean(&wanted_others)
    );
    for (num, every) in [(64, 2), (128, 4), (128, 2)] {
        let directions = Directions::divided(num, every);
        let start = Instant::now();
        let key = RandomKey::new(1, Purpose::Albedo, 0);
        let matrix = tracer.trace_transport(&receivers, directions, key).unwrap();
        let others = matrix.from_others(directions, &scene.radiances);
        let seconds = start.elapsed().as_secs_f64();
        let whole = [matrix.direct.clone(), others.clone()];
        let chosen = |of: &[Vec3]| {
            bright(of)
                .into_iter()
                .step_by(every_of(&receivers))
                .collect::<Vec<f64>>()
        };
        let (direct, others) = (chosen(&matrix.direct), chosen(&others));
        let both: Vec<f64> = direct.iter().zip(&others).map(|(a, b)| a + b).collect();
        println!(
            "{num} directions, 1/{every} to lights: {seconds:.1} s, {} rays",
            matrix.num_rays
        );
        println!("  direct    {}", errors(&direct, &wanted_direct, &all));
        println!("  indirect  {}", errors(&others, &wanted_others, &all));
        println!("  both      {}", errors(&both, &all, &all));
        let variances = [
            matrix.variance_of_direct(directions),
            matrix.variance_from_others(directions, &scene.radiances),
        ];
        let predicted = |of: &[f32], got: &[f64], wanted: &[f64]| {
            let picked = of.iter().step_by(every_of(&receivers));
            let mut ratios: Vec<f64> = (picked.zip(got).zip(wanted))
                .map(|((v, g), w)| (g - w).abs() / f64::from(v.sqrt()).max(1e-9))
                .collect();
            ratios.sort_by(f64::total_cmp);
            (ratios[ratios.len() / 2], ratios[ratios.len() * 9 / 10])
        };
        println!(
            "  error over standard error, median and p90: {:.2?} {:.2?}",
            predicted(&variances[0], &direct, &wanted_direct),
            predicted(&variances[1], &others, &wanted_others)
        );
        let smoothing = Smoothing::new(&receivers);
        let smoothed: [Vec<Vec3>; 2] =
            std::array::from_fn(|k| smoothing.apply(&whole[k], &variances[k]));
        let sum = |of: &[Vec3]| bright(of).iter().sum::<f64>();
        let kept = |k: usize| sum(&smoothed[k]) / sum(&whole[k]) - 1.0;
        let [a, b] = smoothed.each_ref().map(|of| chosen(of));
        let ab: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + b).collect();
        println!(
            "  smoothed, sums kept within {:+.1e} {:+.1e}",
            kept(0),
            kept(1)
        );
        println!("  direct    {}", errors(&a, &wanted_direct, &all));
        println!("  indirect  {}", errors(&b, &wanted_others, &all));
        println!("  both      {}", errors(&ab, &all, &all));
        if std::env::var_os("EAGPT_WORST").is_some() {
            let mut order: Vec<usize> = (0..some.len()).collect();
            let off = |i: usize| (direct[i] - wanted_direct[i]).abs();
            order.sort_by(|&a, &b| off(b).total_cmp(&off(a)));
            let sum: f64 = order.iter().map(|&i| off(i).powi(2)).sum();
            for &i in order.iter().take(12) {
                let (index, surface) = some[i];
                let near = (0..scene.len())
                    .filter(|&e| scene.emissions[e] > 0.1)
                    .map(|e| (scene.positions[e].distance(surface.position), e))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .unwrap();
                println!(
                    "   #{index} {:.2} of all: {:.3} not {:.3}, emission {:.3}, offset {:.4}, normal {:.2}, position {:.2}; nearest {:.4} radiance {:.2} scale {:.3} ",
                    off(i).powi(2) / sum,
                    direct[i],
                    wanted_direct[i],
                    scene.emissions[index as usize],
                    surface.offset,
                    surface.normal,
                    surface.position,
                    near.0,
                    scene.radiances[near.1],
                    scene.scales[near.1]
                );
            }
            // By distance of the nearest emitter.
            let mut order: Vec<(f32, usize)> = (0..some.len())
                .map(|i| {
                    let near = (0..scene.len())
                        .filter(|&e| scene.emissions[e] > 0.1)
                        .map(|e| scene.positions[e].distance(some[i].1.position))
                        .min_by(f32::total_cmp)
                        .unwrap();
                    (near, i)
                })
                .collect();
            order.sort_by(|a, b| a.0.total_cmp(&b.0));
            for part in order.chunks(order.len() / 6) {
                let pick = |of: &[f64]| part.iter().map(|&(_, i)| of[i]).collect::<Vec<f64>>();
                println!(
                    "   to {:.3}: {}",
                    part.last().unwrap().0,
                    errors(&pick(&direct), &pick(&wanted_direct), &pick(&all))
                );
            }
        }
    }
}

fn every_of(receivers: &[Receiver]) -> usize {
    receivers.len().div_ceil(NUM_REFERENCE)
}

fn bytemuck_floats(bytes: &[u8; 12]) -> [f32; 3] {
    std::array::from_fn(|i| {
        f32::from_le_bytes([
            bytes[4 * i],
            bytes[4 * i + 1],
            bytes[4 * i + 2],
            bytes[4 * i + 3],
        ])
    })
}
