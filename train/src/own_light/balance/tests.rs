#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use super::*;
use eagpt_scene::View;
use eagpt_testkit::gaussians::{look_at, material, random_cloud, sphere};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A closed room whose surfaces have this albedo, lit by a cap of it.
fn room(albedo: f32) -> Gaussians {
    sphere(2000, 1.0, |towards| match towards.z > 0.9 {
        true => material(Vec3::splat(3.0), 1.0, Vec3::ZERO),
        false => material(Vec3::splat(0.5), 0.0, Vec3::splat(albedo)),
    })
}

fn cameras() -> Vec<Camera> {
    let targets = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, -DVec3::Z];
    let camera = |target| look_at(DVec3::new(0.01, 0.0, 0.0), target, 48, 32);
    targets.map(camera).to_vec()
}

fn goes_on(_: BakeProgress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Photographs of a scene in its own light.
fn photographs(scene: Gaussians, cameras: &[Camera]) -> Vec<Arc<View>> {
    let solution = Solution {
        device: &Device::Cpu,
        cameras,
        method: GaussianBake {
            num_samples: Some(256),
        },
        max_bounces: MAX_BOUNCES,
        seed: 7,
    };
    let mut traced = solution.trace(&scene, &mut goes_on).unwrap().unwrap();
    let solved = traced.solve(scene, &mut goes_on).unwrap().unwrap();
    let tracer = Device::Cpu.scene(&solved.scene).unwrap();
    let photograph = |camera: &Camera| {
        let radiance = tracer.gbuffer(camera).unwrap().radiance();
        Arc::new(View::new("view".to_owned(), *camera, radiance))
    };
    cameras.iter().map(photograph).collect()
}

#[test]
fn albedos_become_those_of_the_room_that_was_photographed() {
    let cameras = cameras();
    let photographs = photographs(room(0.7), &cameras);
    let views = || {
        let views = photographs.iter().enumerate();
        views.map(|(index, view)| {
            Ok(TrainingView {
                index,
                light: 0,
                view: Arc::clone(view),
                points: None,
            })
        })
    };
    for (albedo, wanted) in [(0.7_f32, 0.7_f32), (0.715, 0.7), (0.69, 0.7)] {
        let scene = room(albedo);
        let whole = scene.len();
        let device = (&Device::Cpu, 1);
        let found = balance(device, (&scene, whole), &cameras, views, &mut goes_on).unwrap();
        let Balance {
            scale, own_light, ..
        } = found.unwrap();
        // A hundredth of albedo is three of light here; noise of the rays is 0.2 % of that.
        let relative = albedo * scale / wanted;
        assert!((relative - 1.0).abs() < 0.002, "{albedo}: {relative}");
        let factor = own_light.median_scale.unwrap();
        assert!((factor - 1.0).abs() < 0.005, "{albedo}: {factor}");
    }
    // Twice as white a room lacks a lamp; no surface reflects more than it receives.
    let scene = room(0.35);
    let whole = scene.len();
    let found = balance(
        (&Device::Cpu, 1),
        (&scene, whole),
        &cameras,
        views,
        &mut goes_on,
    );
    let scale = found.unwrap().unwrap().scale;
    assert!(scale * MAX_SURFACE <= 1.0 && scale > 1.0, "{scale}");
}

#[test]
fn lamps_keep_their_albedos() {
    let mut scene = room(0.5);
    let num_moving = scene.len() - 10;
    scene.albedos.fill(Vec3::splat(0.5));
    multiply_albedos((&mut scene, num_moving), 0.9);
    for (i, albedo) in scene.albedos.iter().enumerate() {
        let is_surface = i < num_moving && !emits(scene.emissions[i]);
        assert_eq!(*albedo, Vec3::splat(if is_surface { 0.45 } else { 0.5 }));
    }
}

#[test]
fn the_scale_of_a_geometric_series_is_that_of_its_sum() {
    let series = |albedo: f64| (1..400).map(|k| albedo.powi(k)).collect::<Vec<f64>>();
    let sum = |albedo: f64| albedo / (1.0 - albedo);
    for (from, to) in [(0.7, 0.68), (0.7, 0.7), (0.3, 0.305), (0.5, 0.49)] {
        let scale = albedo_scale(&series(from), sum(to) / sum(from));
        assert!(
            (f64::from(scale) - to / from).abs() < 1e-6,
            "{from}: {scale}"
        );
    }
    // No more than so much.
    let least = albedo_scale(&series(0.5), 0.1);
    assert_eq!(least, albedo_scale(&series(0.5), 1.0 / MOST_CHANGE));
}

#[test]
fn a_scene_without_emitters_is_left_alone() {
    let mut scene = random_cloud(20, 1);
    scene.emissions.fill(0.1);
    let mut told = |step| panic!("{step:?}");
    let device = (&Device::Cpu, 0);
    let found = balance(device, (&scene, 20), &[], std::iter::empty, &mut told);
    assert_eq!(found.unwrap(), None);
}

#[test]
fn fewer_directions_are_traced_where_memory_is_short() {
    let usual = usual_samples(1000);
    assert_eq!(num_samples(1000, None), usual);
    assert_eq!(num_samples(1000, Some(1 << 30)), usual);
    assert_eq!(num_samples(1000, Some(2 * 4 * 1000 * 20)), 20);
    assert_eq!(num_samples(1000, Some(0)), 2);
    assert_eq!(num_samples(0, Some(1 << 30)), usual);
}
