//! Ways to sample light against each other: the noise differs, the mean does not.

use super::{inside_view, lit_room, mean_and_error, path, render, render_with};
use eagpt_scene::Gaussians;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_testkit::gaussians::{cube, material, rectangle};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::ray::Ray;
use eagpt_trace::transport::Sampling;
use eagpt_trace::transport::matrix::{Directions, TransportMatrix};
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::{Integrator, LightOptions};
use glam::Vec3;

#[test]
fn russian_roulette_keeps_the_mean() {
    let room = lit_room(1.0);
    let plain = mean_and_error(&render(&room, &inside_view(), path(64, 12), 9));
    let roulette = Integrator::Path {
        num_samples: 64,
        max_bounces: 12,
        roulette_from: Some(1),
    };
    let ended = mean_and_error(&render(&room, &inside_view(), roulette, 10));
    // Per-pixel values differ across the image, so errors of the mean over pixels bound the noise
    // from above.
    assert!(
        (plain.0 - ended.0).abs() < 4.0 * (plain.1 + ended.1),
        "{plain:?} {ended:?}"
    );
}

/// A room with two small lamps in opposite corners, one ten times as strong as the other: which of
/// them lights a place depends on where it is.
fn room_of_small_lamps() -> Gaussians {
    let room = cube(1.0, 0.08, |side| {
        let color = Vec3::new(0.6, 0.5 + 0.3 * side.x, 0.5 - 0.3 * side.y);
        material(Vec3::splat(0.3), 0.0, color)
    });
    let lamp = |place: Vec3, radiance: f32| {
        let light = material(Vec3::splat(radiance), 1.0, Vec3::ZERO);
        rectangle(place, Vec3::X * 0.05, Vec3::Y * 0.05, 0.02, light)
    };
    let lamps = [
        lamp(Vec3::new(0.8, 0.8, 0.6), 400.0),
        lamp(Vec3::new(-0.7, -0.8, -0.8), 40.0),
    ];
    room.into_iter()
        .chain(lamps.into_iter().flatten())
        .collect()
}

/// Renderings of several seeds, green channel, `[seeds][pixels]`.
fn green_of_seeds(
    gaussians: &Gaussians,
    integrator: Integrator,
    sampling: Sampling,
    seeds: std::ops::Range<u64>,
) -> Vec<Vec<f64>> {
    let rendering = |seed| {
        let options = LightOptions {
            seed,
            sampling,
            ..LightOptions::default()
        };
        let image = render_with(gaussians, &inside_view(), integrator, &options);
        let green = image.pixels().iter().map(|pixel| f64::from(pixel[1]));
        green.collect()
    };
    seeds.map(rendering).collect()
}

/// Mean over seeds of each pixel, and the variance over seeds, summed over pixels.
fn means_and_noise(seeds: &[Vec<f64>]) -> (Vec<f64>, f64) {
    let n = seeds.len() as f64;
    let means: Vec<f64> = (0..seeds[0].len())
        .map(|i| seeds.iter().map(|image| image[i]).sum::<f64>() / n)
        .collect();
    let squares = |image: &Vec<f64>| -> f64 {
        let pairs = image.iter().zip(&means);
        pairs.map(|(value, mean)| (value - mean).powi(2)).sum()
    };
    let noise = seeds.iter().map(squares).sum::<f64>() / (n - 1.0);
    (means, noise)
}

/// Light sampling changes the noise, not the mean: against cosine sampling on several scenes,
/// by the difference's own standard error over pixels and seeds.
#[test]
fn light_sampling_keeps_the_mean_and_lowers_the_noise() {
    // A room whose lamp has a soft, half-emissive rim around τ_E.
    let mut soft = lit_room(1.0);
    for i in 0..soft.len() {
        if soft.emissions[i] > 0.5 {
            soft.emissions[i] = (1.2 - 3.0 * soft.positions[i].x.abs()).clamp(0.0, 1.0);
        }
    }
    let rooms = [
        ("hard", lit_room(1.0), 0.7),
        ("soft", soft, 0.7),
        ("small lamps", room_of_small_lamps(), 0.02),
    ];
    for (name, room, most_noise) in rooms {
        for integrator in [path(32, 4), Integrator::OneBounce { num_samples: 32 }] {
            let [plain, guided] =
                [(Sampling::Cosine, 100), (Sampling::NextEvent, 200)].map(|(sampling, first)| {
                    means_and_noise(&green_of_seeds(
                        &room,
                        integrator,
                        sampling,
                        first..first + 4,
                    ))
                });
            let differences: Vec<f64> = (plain.0.iter().zip(&guided.0))
                .map(|(plain, guided)| plain - guided)
                .collect();
            let n = differences.len() as f64;
            let bias = differences.iter().sum::<f64>() / n;
            let variance = differences.iter().map(|d| (d - bias).powi(2)).sum::<f64>() / (n - 1.0);
            let error = (variance / n).sqrt();
            assert!(
                bias.abs() < 3.0 * error,
                "{name} {integrator:?}: bias {bias} ± {error}"
            );
            let ratio = guided.1 / plain.1;
            assert!(
                ratio < most_noise,
                "{name} {integrator:?}: noise {ratio} times that of cosine sampling"
            );
        }
    }
}

/// The transport matrix and the light of emitters beside it give the irradiance that blended rays
/// do: by the standard errors of both, at places that see the lamp, the ball and
/// corners.
#[test]
fn matrix_gives_the_irradiance_of_blended_rays() {
    const BATCHES: u32 = 64;
    let gaussians = lit_room(1.0);
    let scene = CpuScene::new(&gaussians);
    let emits = |i: usize| gaussians.emissions[i] > 0.1;
    let carried: Vec<Vec3> = (0..gaussians.len())
        .map(|i| {
            if emits(i) {
                Vec3::ZERO
            } else {
                gaussians.radiances[i]
            }
        })
        .collect();
    let (mut total, mut variance) = (0.0, 0.0);
    for k in 0..12_u32 {
        let (sin, cos) = (2.4 * k as f32).sin_cos();
        let direction = Vec3::new(cos, sin, -0.9 + 0.15 * k as f32).normalize();
        let origin = Vec3::new(-0.7, 0.6, -0.2);
        let met = scene.trace(&Ray::free(origin.to_array(), direction.to_array()));
        let surface = Surface::at(origin, direction, &met).unwrap();
        let directions = Directions::divided(256, 2);
        let batch = |seed: u32| -> [f64; 2] {
            let key = RandomKey::new(u64::from(seed), Purpose::Bake, 0);
            let matrix = TransportMatrix::trace(&scene, &[(k, surface)], directions, key);
            let linked = matrix.direct[0] + matrix.from_others(directions, &carried)[0];
            let points = Points::new(RandomKey::new(u64::from(seed), Purpose::Albedo, 0), k);
            let blended: Vec3 = (0..256)
                .map(|s| {
                    let [a, b, ..] = points.block(s, 0);
                    let ray = surface.ray(cosine_direction(surface.normal, a, b));
                    scene.trace(&ray).radiance()
                })
                .sum();
            [linked, blended / 256.0].map(|light| f64::from(light.y))
        };
        let batches: Vec<[f64; 2]> = (0..BATCHES).map(batch).collect();
        let moments = |of: usize| {
            let n = f64::from(BATCHES);
            let mean = batches.iter().map(|b| b[of]).sum::<f64>() / n;
            let squares: f64 = batches.iter().map(|b| (b[of] - mean).powi(2)).sum();
            (mean, squares / (n - 1.0) / n)
        };
        let ((linked, linked_var), (blended, blended_var)) = (moments(0), moments(1));
        // The realizations are the same in all batches: one in a hundred where few discs send the
        // light.
        let error = (linked_var + blended_var + (0.01 * blended).powi(2)).sqrt();
        assert!(
            (linked - blended).abs() < 4.5 * error,
            "place {k}: {linked} instead of {blended} ± {error}"
        );
        total += linked - blended;
        variance += error * error;
    }
    assert!(total.abs() < 4.0 * f64::sqrt(variance), "{total} in all");
}
