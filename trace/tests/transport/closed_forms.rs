//! Scenes whose light is known.

use super::{inside_view, mean_and_error, path, render, render_with};
use eagpt_scene::Gaussians;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_testkit::gaussians::{look_at, material, rectangle, sphere};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::ray::Ray;
use eagpt_trace::transport::lights::BounceSampler;
use eagpt_trace::transport::points::Points;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{EMISSION_THRESHOLD, Hits};
use eagpt_trace::{Features, Integrator, LightOptions};
use glam::{DVec3, Vec3};

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
