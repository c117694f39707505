//! Light transport against closed forms.

use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussian, Gaussians, Image};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle, sphere};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::ray::Ray;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::matrix::{Directions, TransportMatrix};
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::sampling::cosine_direction;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{EMISSION_THRESHOLD, Hits, Sampling};
use eagpt_trace::{Features, Integrator, LightOptions, Tracer};
use glam::{DVec3, Vec3};

fn render(gaussians: &Gaussians, camera: &Camera, integrator: Integrator, seed: u64) -> Image<3> {
    let options = LightOptions {
        seed,
        ..LightOptions::default()
    };
    render_with(gaussians, camera, integrator, &options)
}

fn render_with(
    gaussians: &Gaussians,
    camera: &Camera,
    integrator: Integrator,
    options: &LightOptions,
) -> Image<3> {
    let scene = CpuScene::new(gaussians);
    scene
        .render(camera, &integrator, options)
        .expect("the CPU engine does not fail")
        .radiance
}

fn path(num_samples: u32, max_bounces: u32) -> Integrator {
    Integrator::Path {
        num_samples,
        max_bounces,
        roulette_from: None,
    }
}

/// Mean of the first channel and the standard error of that mean over pixels.
fn mean_and_error(image: &Image<3>) -> (f64, f64) {
    let n = image.pixels().len() as f64;
    let mean = image.pixels().iter().map(|p| f64::from(p[0])).sum::<f64>() / n;
    let variance = image
        .pixels()
        .iter()
        .map(|p| (f64::from(p[0]) - mean).powi(2))
        .sum::<f64>()
        / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn inside_view() -> Camera {
    look_at(DVec3::ZERO, DVec3::new(0.2, -1.0, -0.6), 24, 24)
}

/// A furnace: radiance 1 from everywhere, so that one bounce off albedo a shows a.
#[test]
fn one_bounce_in_a_furnace_shows_the_albedo() {
    let furnace = sphere(4000, 1.0, |_| {
        material(Vec3::ONE, 0.0, Vec3::new(0.3, 0.6, 0.9))
    });
    let image = render(
        &furnace,
        &inside_view(),
        Integrator::OneBounce { num_samples: 16 },
        1,
    );
    for pixel in image.pixels() {
        for (value, expected) in pixel.iter().zip([0.3, 0.6, 0.9]) {
            // 1e-4 of the light passes between discs at each of two hits.
            assert!(
                (value - expected).abs() < 5e-4,
                "{value} instead of {expected}"
            );
        }
    }
}

/// Inside a sphere every cosine-weighted bounce lands uniformly on its area. With a share p of it
/// emitting L and the rest of albedo a, paths of at most B bounces bring `Σ aᵏ (1−p)ᵏ⁻¹ p L`.
#[test]
fn paths_in_a_sphere_sum_the_geometric_series() {
    let albedo = 0.7;
    let cap = |d: Vec3| {
        if d.z > 0.5 {
            material(Vec3::splat(3.0), 1.0, Vec3::ZERO)
        } else {
            material(Vec3::ONE, 0.0, Vec3::splat(albedo))
        }
    };
    let gaussians = sphere(6000, 1.0, cap);
    let scene = CpuScene::new(&gaussians);
    for hits in [Hits::Blended, Hits::Sampled] {
        let (p, brightness) = cap_seen_by(&scene, hits);
        for bounces in [1, 2, 7] {
            let expected: f64 = (1..=bounces)
                .map(|k| f64::from(albedo).powi(k) * (1.0 - p).powi(k - 1) * p * brightness)
                .sum();
            let options = LightOptions {
                seed: 2,
                hits,
                ..LightOptions::default()
            };
            let paths = path(64, bounces as u32);
            let image = render_with(&gaussians, &inside_view(), paths, &options);
            let (mean, error) = mean_and_error(&image);
            // Four standard errors, and 1 % for paths that see a share of the cap's rim blended
            // with the wall. A path that starts on one of several discs may meet the others: 0.25 %
            // of the light of each of up to seven bounces.
            let share = if hits == Hits::Blended { 0.01 } else { 0.02 };
            let tolerance = 4.0 * error + share * expected;
            assert!(
                (mean - expected).abs() < tolerance,
                "{hits:?}, {bounces} bounces: {mean} ± {error} instead of {expected}"
            );
        }
    }
}

/// Share of directions from the middle that meet an emitter, and its mean radiance: the soft rim of
/// a cap makes them what rays say they are, not what the geometry would.
fn cap_seen_by(scene: &CpuScene, hits: Hits) -> (f64, f64) {
    let (mut emitting, mut light) = (0.0_f64, 0.0_f64);
    let num = 40_000_u32;
    for i in 0..num {
        let golden = i as f32 * 2.399_963_2;
        let z = 1.0 - (2 * i + 1) as f32 / num as f32;
        let flat = (1.0 - z * z).sqrt();
        let direction = Vec3::new(flat * golden.cos(), flat * golden.sin(), z)
            .normalize()
            .to_array();
        let ray = Ray::free([0.0; 3], direction);
        let features = match hits {
            Hits::Blended => scene.trace(&ray),
            Hits::Sampled => scene
                .sample_hit(&ray, i)
                .map_or(Features::default(), |hit| {
                    Features(scene.attributes(hit.index).0)
                }),
        };
        if features.emission() > EMISSION_THRESHOLD {
            emitting += 1.0;
            light += f64::from(features.radiance().x);
        }
    }
    (emitting / f64::from(num), light / emitting)
}

/// A floor under a coaxial disc of radius ρ at height h receives `L ρ²/(ρ² + h²)` at its centre.
#[test]
fn a_disc_light_over_a_floor() {
    let (radius, height, albedo, light) = (1.0_f32, 0.8_f32, 0.5, 4.0);
    let floor = material(Vec3::ZERO, 0.0, Vec3::splat(albedo));
    let lamp = material(Vec3::splat(light), 1.0, Vec3::ZERO);
    let mut all = rectangle(Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5, 0.05, floor);
    let square = rectangle(Vec3::Z * height, Vec3::X * 1.5, Vec3::Y * 1.5, 0.04, lamp);
    all.extend(
        square
            .into_iter()
            .filter(|g| g.position.truncate().length() < radius),
    );
    let gaussians: Gaussians = all.into_iter().collect();
    let mut camera = look_at(DVec3::new(0.0, -0.35, 0.4), DVec3::ZERO, 16, 16);
    // A narrow view of the floor's centre.
    (camera.fx, camera.fy, camera.cx, camera.cy) = (200.0, 200.0, 8.0, 8.0);
    let (mean, error) = mean_and_error(&render(&gaussians, &camera, path(256, 3), 3));
    // The lamp's rim is soft and wider than the ring of its last centres: the radius is that of an
    // even disc as bright in sum.
    let scene = CpuScene::new(&gaussians);
    let step = 0.01_f32;
    let brightness: f32 = (0..150)
        .flat_map(|ring| {
            (0..16).map(move |spoke| {
                (
                    (ring as f32 + 0.5) * step,
                    spoke as f32 * std::f32::consts::FRAC_PI_8,
                )
            })
        })
        .map(|(r, azimuth)| {
            let origin = [r * azimuth.cos(), r * azimuth.sin(), 0.5 * height];
            scene
                .trace(&Ray::free(origin, [0.0, 0.0, 1.0]))
                .radiance()
                .x
                * 2.0
                * r
                * step
                / 16.0
        })
        .sum();
    let radius = (brightness / light).sqrt();
    assert!((1.0..1.1).contains(&radius), "{radius}");
    let expected = f64::from(albedo * light * radius.powi(2) / (radius.powi(2) + height.powi(2)));
    assert!(
        (mean - expected).abs() < 4.0 * error + 0.005 * expected,
        "{mean} ± {error} instead of {expected}"
    );
}

/// With white walls and no light but one lamp, nothing is brighter than the lamp, however many
/// bounces there are.
#[test]
fn energy_never_grows() {
    let room = cube(1.0, 0.08, |side| {
        if side == Vec3::Z {
            material(Vec3::ONE, 1.0, Vec3::ONE)
        } else {
            material(Vec3::ONE, 0.0, Vec3::ONE)
        }
    });
    let gaussians: Gaussians = room.into_iter().collect();
    // Cosine sampling, whose samples have no weights: the bound then holds for every pixel.
    let options = LightOptions {
        seed: 4,
        sampling: Sampling::Cosine,
        ..LightOptions::default()
    };
    let image = render_with(&gaussians, &inside_view(), path(16, 40), &options);
    let (mean, _) = mean_and_error(&image);
    assert!(image.pixels().iter().flatten().all(|&v| v <= 1.0 + 1e-4));
    // White walls lose nothing either: with 40 bounces nearly every path finds the lamp.
    assert!(mean > 0.97, "{mean}");
}

fn lit_room(scale: f32) -> Gaussians {
    let room = cube(1.0, 0.08, |side| {
        let color = Vec3::new(0.6, 0.5 + 0.3 * side.x, 0.5 - 0.3 * side.y);
        material(Vec3::splat(0.3), 0.0, color)
    });
    let lamp = rectangle(
        Vec3::Z * 0.97,
        Vec3::X * 0.4,
        Vec3::Y * 0.4,
        0.06,
        material(Vec3::splat(5.0), 1.0, Vec3::ZERO),
    );
    room.into_iter()
        .chain(lamp)
        .map(|g| Gaussian {
            position: g.position * scale,
            scale: g.scale * scale,
            ..g
        })
        .collect()
}

/// No length in the code has a unit: a room 128 times as large, or as small, looks the same. Powers
/// of two leave every rounding as it is.
#[test]
fn the_unit_of_length_does_not_matter() {
    let reference = render(&lit_room(1.0), &inside_view(), path(16, 5), 5);
    let (mean, _) = mean_and_error(&reference);
    for scale in [128.0, 1.0 / 128.0] {
        let image = render(&lit_room(scale), &inside_view(), path(16, 5), 5);
        let difference: f32 = image
            .values()
            .iter()
            .zip(reference.values())
            .map(|(a, b)| (a - b).abs())
            .sum::<f32>()
            / reference.values().len() as f32;
        assert!(
            f64::from(difference) < 1e-3 * mean,
            "scale {scale}: {difference} of {mean}"
        );
    }
}

/// Light outside a closed room stays outside, also along its edges and in its corners.
#[test]
fn closed_rooms_do_not_leak() {
    let mut all = cube(1.0, 0.06, |_| material(Vec3::ZERO, 0.0, Vec3::splat(0.8)));
    for side in [Vec3::X, Vec3::NEG_Y, Vec3::Z] {
        let (a, b) = side.any_orthonormal_pair();
        all.extend(rectangle(
            side * 1.6,
            a * 2.0,
            b * 2.0,
            0.1,
            material(Vec3::splat(10.0), 1.0, Vec3::ZERO),
        ));
    }
    let gaussians: Gaussians = all.into_iter().collect();
    let corner = look_at(
        DVec3::new(-0.5, 0.5, -0.5),
        DVec3::new(1.0, -1.0, 1.0),
        24,
        24,
    );
    let (mean, _) = mean_and_error(&render(&gaussians, &corner, path(64, 7), 6));
    // The light through the walls themselves is 1e-4 of the light at each of up to eight hits.
    assert!(mean < 10.0 * 8.0 * 1e-4, "{mean}");
}

/// Contact shadows: right beside a wall that ends a light, within one disc of the corner, the floor
/// is lit by what the geometry says. An upright lamp wall meets the floor; next to it half the
/// hemisphere is lamp.
#[test]
fn light_reaches_into_corners() {
    let floor = rectangle(
        Vec3::ZERO,
        Vec3::X,
        Vec3::Y,
        0.04,
        material(Vec3::ZERO, 0.0, Vec3::ONE),
    );
    let wall = rectangle(
        Vec3::new(0.0, 1.0, 1.0),
        Vec3::X * 4.0,
        Vec3::Z,
        0.04,
        material(Vec3::ONE, 1.0, Vec3::ZERO),
    );
    let gaussians: Gaussians = floor.into_iter().chain(wall).collect();
    let scene = CpuScene::new(&gaussians);
    let key = RandomKey::new(8, Purpose::Render, 0);
    for distance in [0.1_f32, 0.2, 0.5] {
        let direction = Vec3::new(0.0, 0.0, -1.0);
        let origin = Vec3::new(0.0, 1.0 - distance, 0.5);
        let features = scene.trace(&Ray::free(origin.to_array(), direction.to_array()));
        let surface = Surface::at(origin, direction, &features).unwrap();
        let (sampler, points) = (BounceSampler::new(None, 0.0), Points::new(key, 0));
        let light = scene.irradiance_at(&surface, &sampler, 4000, &points).x;
        // A strip of height 2 at the distance d, wide compared with it: (1 − cos θ)/2 with tan θ =
        // 2/d.
        let expected = 0.5 * (1.0 - distance / (distance * distance + 4.0).sqrt());
        // Noise 0.008, ends of the strip 0.01, and up to one disc's offset (0.05) of shadow from
        // the grazing start near the wall.
        let offset_loss = 0.05 * (0.1 / distance).min(1.0);
        assert!(
            (light - expected).abs() < 0.025 + offset_loss,
            "at {distance}: {light} instead of {expected}"
        );
    }
}

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

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let room = lit_room(1.0);
    let in_pool = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| render(&room, &inside_view(), path(4, 4), seed))
    };
    let one = in_pool(1, 11);
    assert!(one == in_pool(3, 11));
    assert!(one != in_pool(1, 12));
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
