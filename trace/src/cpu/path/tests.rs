use super::{Path, Paths, Start};
use crate::blend::features_of_one;
use crate::cpu::CpuScene;
use crate::transport::points::Points;
use crate::transport::sampling::cosine_direction;
use crate::transport::start::Surface;
use crate::transport::vertex::surfaces_of_pixels;
use crate::transport::{EMISSION_THRESHOLD, Hits, MAX_BOUNCES, ROULETTE_FROM};
use crate::{Integrator, LightOptions, Tracer};
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussian, Gaussians};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle};
use glam::{DVec3, Quat, Vec3};

/// A room of tilted, half-transparent discs at different heights, as training leaves them, with a
/// table in it and `lamps`.
fn room(lamps: Vec<Gaussian>, seed: u64) -> Gaussians {
    let key = RandomKey::new(seed, Purpose::Initialise, 0);
    let paint = |side: Vec3| {
        let color = Vec3::new(0.6, 0.5 + 0.3 * side.x, 0.5 - 0.3 * side.y);
        material(Vec3::ZERO, 0.0, color)
    };
    let top = material(Vec3::ZERO, 0.0, Vec3::new(0.7, 0.4, 0.2));
    let (across, along) = (Vec3::X * 0.4, Vec3::Y * 0.3);
    let table = rectangle(Vec3::new(0.1, 0.2, -0.4), across, along, 0.08, top);
    let surfaces = cube(1.0, 0.1, paint).into_iter().chain(table);
    let rough = (0..).zip(surfaces).map(|(i, disc)| {
        let [tilt, about, height, opacity] = key.stream(i, 0).next_uniforms();
        let axis = Quat::from_rotation_z(about * std::f32::consts::TAU) * Vec3::X;
        let normal = disc.rotation * Vec3::Z;
        Gaussian {
            position: disc.position + normal * (0.4 * (height - 0.5) * disc.scale.x),
            rotation: disc.rotation * Quat::from_axis_angle(axis, 0.4 * tilt),
            opacity: 0.4 + 0.55 * opacity,
            ..disc
        }
    });
    rough.chain(lamps).collect()
}

fn lamp(place: Vec3, across: Vec3, along: Vec3, radiance: f32) -> Vec<Gaussian> {
    let light = material(Vec3::splat(radiance), 1.0, Vec3::ZERO);
    rectangle(place, across, along, 0.03, light)
}

fn inside_view() -> Camera {
    let (eye, middle) = (DVec3::new(-0.7, -0.7, 0.3), DVec3::new(0.4, 0.5, -0.4));
    look_at(eye, middle, 16, 12)
}

/// A panel under the ceiling, a strip along a wall, and two lamps that stand in the room.
fn rooms() -> [Gaussians; 3] {
    let panel = lamp(Vec3::Z * 0.9, Vec3::X * 0.4, Vec3::Y * 0.3, 3.0);
    let strip = lamp(Vec3::new(0.0, 0.85, 0.3), Vec3::X * 0.7, Vec3::Y * 0.1, 5.0);
    let low = Vec3::new(-0.4, -0.3, -0.1);
    let upright = lamp(low, Vec3::X * 0.25, Vec3::Z * 0.2, 4.0);
    let flat = lamp(
        Vec3::new(0.5, -0.5, 0.5),
        Vec3::Y * 0.25,
        Vec3::X * 0.25,
        6.0,
    );
    let standing = upright.into_iter().chain(flat).collect();
    [room(panel, 1), room(strip, 2), room(standing, 3)]
}

/// Surfaces that the pixels of `camera` show, as paths start from them.
fn starts(scene: &CpuScene, camera: &Camera) -> Vec<Start> {
    let features = scene.gbuffer(camera).unwrap();
    surfaces_of_pixels(camera, &features, EMISSION_THRESHOLD, &[])
        .into_iter()
        .map(|(pixel, vertex)| Start::new(pixel, vertex))
        .collect()
}

fn paths<'a>(scene: &'a CpuScene, camera: &Camera, num_samples: u32) -> Paths<'a> {
    Paths {
        scene,
        width: camera.width,
        lights: scene.light_list(),
        num_samples,
        max_bounces: MAX_BOUNCES,
        roulette_from: Some(ROULETTE_FROM),
        threshold: EMISSION_THRESHOLD,
        hits: Hits::Sampled,
        key: RandomKey::new(5, Purpose::Render, 0),
        key_of_expected: RandomKey::new(5, Purpose::Expect, 0),
    }
}

/// Starts receive in the mean of paths the light that they are expected to.
#[test]
fn expected_light_is_what_paths_find() {
    for (number, gaussians) in rooms().into_iter().enumerate() {
        let scene = CpuScene::new(&gaussians);
        let camera = inside_view();
        let (paths, starts) = (paths(&scene, &camera, 64), starts(&scene, &camera));
        let expected = paths.expected(&starts);
        let light = |start: &Start| f64::from(expected.light(&start.vertex.surface).y);
        let told = starts.iter().map(light).sum::<f64>();
        let samples = paths.sample(&starts);
        let found: f64 = (samples.iter())
            .map(|samples| f64::from(samples.light().mean.y))
            .sum();
        // A few thousand vertices, whose light differs by about its mean: 2 % and the light of all
        // bounces that follows from it.
        let ratio = told / found;
        assert!((0.9..1.1).contains(&ratio), "room {number}: {ratio}");
    }
}

/// Whatever the rest of a path brings, it is the same in the mean if the path may end, and nothing
/// is lost where nothing is expected, nor is more taken off than a path has brought.
#[test]
fn ends_at_random_leave_the_mean() {
    let scene = CpuScene::new(&rooms()[0]);
    let camera = inside_view();
    let (paths, starts) = (paths(&scene, &camera, 64), starts(&scene, &camera));
    let expected = paths.expected(&starts);
    let num = 4096;
    let cases = [(0.1, 0.0), (0.5, 0.02), (1.0, 0.3), (3.0, 0.0), (0.3, 10.0)];
    for (start, &(throughput, brought)) in starts.iter().step_by(17).zip(cases.iter().cycle()) {
        let next = start.vertex;
        let rest = Vec3::new(0.2, 0.7, 1.9);
        let mut path = Path {
            throughput: Vec3::splat(throughput),
            worth: 0.4,
            ..Path::new(0, 0, 0, next)
        };
        path.brought.light = Vec3::new(brought, 0.5 * brought, 0.0);
        let found = |number: i32| {
            let mut path = path;
            let goes_on = expected.goes_on(&mut path, &next, (number as f32 + 0.5) / num as f32);
            assert!(path.brought.light.min_element() >= 0.0);
            let light = path.throughput * next.reflectance() * rest;
            path.brought.light + if goes_on { light } else { Vec3::ZERO }
        };
        let mean = (0..num).map(found).sum::<Vec3>() / num as f32;
        let plain = path.brought.light + path.throughput * next.reflectance() * rest;
        // Chances are multiples of one over the number of cases, and no smaller than a hundredth.
        assert!(
            (mean - plain).abs().max_element() < 0.02 * plain.max_element(),
            "{mean} instead of {plain}"
        );
    }
}

/// Light of one path, plainly: each ray takes one hit of all by its weight, whatever others take,
/// directions are those of the cosine alone, and nothing ends before the last bounce.
fn plain_path(scene: &CpuScene, start: Surface, points: &Points, sample: u32) -> f64 {
    let mut surface = start;
    let mut throughput = 1.0_f64;
    for bounce in 0..MAX_BOUNCES {
        let [a, b, choice, _] = points.block(sample, bounce);
        let direction = cosine_direction(surface.normal, a, b);
        let Some(hit) = scene.sample_hit(&surface.ray(direction), choice.to_bits()) else {
            return 0.0;
        };
        let met = features_of_one(hit.t, scene.attributes(hit.index), direction.to_array());
        if met.emission() > EMISSION_THRESHOLD {
            return throughput * f64::from(met.radiance().y);
        }
        throughput *= f64::from(met.albedo().y);
        match Surface::at(surface.position, direction, &met) {
            Some(next) => surface = next,
            None => return 0.0,
        }
    }
    0.0
}

/// The image that `plain_path` gives of each pixel that shows a surface, `[pixels]`.
fn plain_image(scene: &CpuScene, camera: &Camera, num_samples: u32) -> Vec<(usize, f64)> {
    let key = RandomKey::new(77, Purpose::Render, 0);
    let frame = camera.ray_frame();
    let features = scene.gbuffer(camera).unwrap();
    let of_pixel = |pixel: usize| {
        let seen = &features.pixels[pixel];
        if seen.emission() > EMISSION_THRESHOLD {
            return None;
        }
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let start = Surface::at(frame.origin, direction, seen)?;
        let points = Points::new(key, pixel as u32);
        let paths = (0..num_samples).map(|s| plain_path(scene, start, &points, s));
        let light = paths.sum::<f64>() / f64::from(num_samples);
        Some((pixel, light * f64::from(seen.albedo().y)))
    };
    (0..camera.num_pixels()).filter_map(of_pixel).collect()
}

/// Realizations that rays share, emitters chosen among the discs of each, and paths that end at
/// random leave the mean where it is: in three rooms within three standard errors.
#[test]
fn paths_have_the_mean_of_plain_ones() {
    let camera = inside_view();
    let integrator = Integrator::Path {
        num_samples: 512,
        max_bounces: MAX_BOUNCES,
        roulette_from: Some(ROULETTE_FROM),
    };
    for (number, gaussians) in rooms().into_iter().enumerate() {
        let scene = CpuScene::new(&gaussians);
        let view = scene
            .render(&camera, &integrator, &LightOptions::default())
            .unwrap();
        let plain = plain_image(&scene, &camera, 1024);
        let differences: Vec<f64> = (plain.iter())
            .map(|&(pixel, light)| f64::from(view.radiance.pixels()[pixel][1]) - light)
            .collect();
        let num = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / num;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (num - 1.0);
        let error = (variance / num).sqrt();
        let light = plain.iter().map(|(_, light)| light).sum::<f64>() / num;
        assert!(
            mean.abs() < 3.0 * error,
            "room {number}: {mean} ± {error} of {light}"
        );
        // The comparison tells something: it would see 2.4 percent.
        assert!(error < 0.008 * light, "room {number}: {error} of {light}");
    }
}
