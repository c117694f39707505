//! Lamps of one make share the shape of the one that views show best; a lamp of another size keeps
//! its own.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::Kinds;
use eagpt_lamps::shape::{Flat, Shape};
use eagpt_scene::lamps::{Lamp, LampShape};
use eagpt_scene::{Camera, Gaussians, rotation};
use glam::{DVec3, Vec3};
use rig::{RADIANCE, find_in, heap, photograph_all, room};
use std::f32::consts::PI;

/// A strip under a cabinet along the wall at x = −2.
fn strip(y: f32, length: f32) -> Shape {
    Shape::Rectangle(Flat {
        centre: Vec3::new(-1.7, y, 1.6),
        rotation: rotation::from_z_to(Vec3::NEG_Z),
        size: [0.07, length],
    })
}

/// The lamps of a room with `strips`, which views from lower down see at a grazing angle.
fn found(strips: &[Shape], eyes: &[(DVec3, DVec3)]) -> Vec<Lamp> {
    let heaps = strips.iter().flat_map(|strip| heap(strip, RADIANCE));
    let scene: Gaussians = room().iter().chain(heaps).collect();
    let shining: Vec<(Shape, Vec3)> = strips.iter().map(|strip| (*strip, RADIANCE)).collect();
    let photographs = eyes.iter().enumerate().map(|(i, (eye, target))| {
        let pose = Camera::level_pose(*eye, (*target - *eye).normalize());
        let camera = Camera::centred([120, 80], 1.3, pose);
        photograph_all(i, camera, &shining, &[])
    });
    find_in(&scene, Kinds::All, photographs).lamps.lamps
}

/// Two views of all strips from afar, and two of the first one from close by.
fn eyes() -> [(DVec3, DVec3); 4] {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    [
        (at(0.3, -0.6, 0.6), at(-1.7, 0.0, 1.5)),
        (at(0.2, 0.9, 0.7), at(-1.7, 0.1, 1.5)),
        (at(-1.0, -0.9, 1.0), at(-1.7, -0.9, 1.6)),
        (at(-1.1, -1.3, 0.9), at(-1.7, -0.9, 1.6)),
    ]
}

/// Power of a lamp over that of a strip of this length.
fn share(lamp: &Lamp, length: f32) -> f32 {
    lamp.power[0] / (RADIANCE.x * PI * 0.07 * length)
}

#[test]
fn strips_that_few_pixels_show_are_like_the_one_that_many_show() {
    let lamps = found(&[-0.9, 0.1, 0.9].map(|y| strip(y, 0.5)), &eyes());
    assert_eq!(lamps.len(), 3, "{lamps:?}");
    // By its own 58 pixels the last one is a tube of 1.4 times the power.
    assert!(lamps.iter().any(|lamp| lamp.num_pixels < 70));
    for lamp in &lamps {
        assert_eq!(lamp.shape, LampShape::Panel, "{lamp:?}");
        assert_eq!(lamp.size, lamps[0].size);
        // Pixels are half as wide as strips; within 2.3 % seen.
        assert!((share(lamp, 0.5) - 1.0).abs() < 0.05, "{lamp:?}");
    }
}

#[test]
fn a_longer_strip_stays_longer() {
    let lamps = found(&[strip(-0.9, 0.5), strip(0.2, 0.75)], &eyes());
    let [long, short] = lamps.as_slice() else {
        panic!("{lamps:?}");
    };
    assert!((share(long, 0.75) - 1.0).abs() < 0.05, "{long:?}");
    assert!((share(short, 0.5) - 1.0).abs() < 0.05, "{short:?}");
}
