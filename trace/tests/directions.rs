//! Radiance that differs with the direction: cameras see it, bounces do not.

use eagpt_scene::Gaussians;
use eagpt_testkit::gaussians::{directional, look_at, random_cloud};
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::bvh::Bvh;
use eagpt_trace::cpu::camera::{HitSearch, Keep};
use eagpt_trace::cpu::{CameraRecord, CpuScene};
use eagpt_trace::features::NUM_LANES;
use eagpt_trace::ray::Ray;
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::{Features, Tracer};
use glam::{DVec3, Vec3};

/// The same light in all directions: what leaves towards `eye`.
fn as_seen_from(eye: Vec3, gaussians: &Gaussians) -> Gaussians {
    let mut plain = gaussians.clone();
    plain.harmonics.clear();
    for (index, radiance) in plain.radiances.iter_mut().enumerate() {
        *radiance = gaussians.seen_radiance(index, eye);
    }
    plain
}

#[test]
fn a_camera_sees_what_leaves_towards_it() {
    let gaussians = directional(random_cloud(700, 3), 5);
    let set = SurfelSet::new(&gaussians);
    let bvh = Bvh::new(&set);
    let mut record = CameraRecord::default();
    for origin in [DVec3::new(3.0, 0.2, 0.4), DVec3::new(-0.2, 0.1, 0.0)] {
        let camera = look_at(origin, DVec3::new(0.4, 0.0, -0.1), 37, 29);
        let plain = SurfelSet::new(&as_seen_from(camera.origin(), &gaussians));
        let d_features: Vec<Features> = (0..camera.num_pixels())
            .map(|i| Features([0.1 + (i % 7) as f32; NUM_LANES]))
            .collect();
        for search in [HitSearch::Tiles, HitSearch::SingleRays(&bvh)] {
            // A record that is used again has forgotten the camera before.
            let seen = record.trace(&set, &camera.into(), search, Keep::Record);
            let mut other = CameraRecord::default();
            assert!(seen == other.trace(&plain, &camera.into(), search, Keep::Record));
            let gradients = record.adjoint(&set, &d_features, GradientMask::Everything);
            assert!(gradients == other.adjoint(&plain, &d_features, GradientMask::Everything));
        }
    }
}

#[test]
fn bounces_meet_the_radiance_of_all_directions() {
    let gaussians = directional(random_cloud(700, 3), 5);
    let mut plain = gaussians.clone();
    plain.harmonics.clear();
    let mut scene = CpuScene::new(&gaussians);
    let mut other = CpuScene::new(&plain);
    let mut num_hits = 0;
    for k in 0..200 {
        let angle = 0.37 * k as f32;
        let direction = Vec3::new(angle.cos(), angle.sin(), 0.01 * (k % 50) as f32 - 0.25);
        let ray = Ray::free([0.05, -0.02, 0.1], direction.normalize().to_array());
        let features = scene.trace(&ray);
        assert_eq!(features, other.trace(&ray));
        num_hits += u32::from(features.alpha() > 0.0);
    }
    assert!(num_hits > 100, "{num_hits}");
    // Harmonics come and go with an update.
    let camera = look_at(DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO, 20, 20);
    let [directional, without] = [&scene, &other].map(|scene| scene.gbuffer(&camera).unwrap());
    assert!(directional != without);
    scene.update(&plain).unwrap();
    other.update(&gaussians).unwrap();
    assert!(scene.gbuffer(&camera).unwrap() == without);
    assert!(other.gbuffer(&camera).unwrap() == directional);
}
