//! A lamp that one view shows is in the surface around it, if it may be.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_lamps::{Evidence, find};
use eagpt_scene::lamps::{Lamp, LampShape};
use eagpt_scene::{Camera, Gaussians, rotation};
use eagpt_trace::Device;
use glam::{DVec3, Vec3};
use rig::{RADIANCE, cameras, heap, photograph, room};

const CENTRE: Vec3 = Vec3::new(0.3, 0.1, 2.49);

fn looking(eye: DVec3, target: DVec3) -> Camera {
    let pose = Camera::level_pose(eye, (target - eye).normalize());
    Camera::centred([120, 80], 1.3, pose)
}

/// Lamps of a room with `lamp`, which training has `trained`; one camera sees it, others look at
/// the floor.
fn found(lamp: &Shape, trained: &Shape) -> Vec<Lamp> {
    let scene: Gaussians = room().iter().chain(heap(trained, RADIANCE)).collect();
    let tracer = Device::Cpu.scene(&scene).unwrap();
    let up = looking(DVec3::new(-1.2, -0.4, 1.0), CENTRE.as_dvec3());
    let down = cameras().into_iter().map(|camera| {
        let eye = camera.origin().as_dvec3();
        looking(eye, DVec3::new(-0.5 * eye.x, -0.5 * eye.y, 0.0))
    });
    let mut evidence = Evidence::default();
    for (i, camera) in std::iter::once(up).chain(down).enumerate() {
        let seen = tracer.gbuffer(&camera).unwrap();
        evidence.add(&photograph(i, camera, lamp, &[]), 0, &seen);
    }
    let found = find(&evidence, &scene, Vec3::Z, &*tracer).unwrap();
    found.lamps.lamps
}

#[test]
fn a_panel_that_one_view_shows_is_flush_with_the_ceiling() {
    let size = [0.2, 0.15];
    let panel = Shape::Rectangle(Flat {
        centre: CENTRE,
        rotation: rotation::from_z_to(Vec3::NEG_Z),
        size,
    });
    let found = found(&panel, &panel);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Panel);
    assert_eq!(lamp.views.len(), 1);
    assert!((lamp.world_from_lamp() * Vec3::Z).dot(Vec3::NEG_Z) > 0.99);
    assert!(lamp.centre().distance(CENTRE) < 0.02, "{lamp:?}");
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * size[0] * size[1]);
    assert!((share - 1.0).abs() < 0.05, "{share}");
}

#[test]
fn a_ball_that_one_view_shows_may_be_anywhere() {
    // It hangs before the wall that the view has around it.
    let centre = Vec3::new(0.3, 0.1, 1.6);
    let ball = Shape::Ball {
        centre,
        radius: 0.08,
    };
    assert!(
        found(&ball, &ball)
            .iter()
            .all(|lamp| lamp.shape == LampShape::Other)
    );
}
