//! A bulb in a shade is the ball that its lower part is of, with all its power.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_lamps::{Evidence, find};
use eagpt_scene::Gaussians;
use eagpt_scene::lamps::LampShape;
use eagpt_trace::Device;
use glam::{Mat3, Quat, Vec3};
use rig::{RADIANCE, cameras, heap, patch, photograph, room};
use std::f32::consts::TAU;

const NUM_SIDES: u8 = 8;
const RADIUS: f32 = 0.18;
const HEIGHT: f32 = 0.4;

/// The sides of a shade about a vertical axis, open below and above.
fn sides(lower_edge: Vec3) -> Vec<Flat> {
    let side = |i: u8| {
        let angle = f32::from(i) / f32::from(NUM_SIDES) * TAU;
        let outwards = Vec3::new(angle.cos(), angle.sin(), 0.0);
        let frame = Mat3::from_cols(Vec3::Z.cross(outwards), Vec3::Z, outwards);
        let width = 2.0 * RADIUS * (0.5 * TAU / f32::from(NUM_SIDES)).tan();
        Flat {
            centre: lower_edge + outwards * RADIUS + Vec3::Z * (0.5 * HEIGHT),
            rotation: Quat::from_mat3(&frame),
            size: [width, HEIGHT],
        }
    };
    (0..NUM_SIDES).map(side).collect()
}

#[test]
fn a_bulb_in_a_shade_has_the_power_of_a_whole_ball() {
    let (centre, radius) = (Vec3::new(0.1, 0.1, 2.1), 0.12);
    let bulb = Shape::Ball { centre, radius };
    let sides = sides(centre - Vec3::Z * 0.2);
    let shade: Vec<Shape> = sides.iter().copied().map(Shape::Rectangle).collect();
    let discs = sides.iter().flat_map(|side| {
        let [width, height] = side.size;
        let edges = [Vec3::X * width, Vec3::Y * height].map(|edge| side.rotation * edge);
        patch(side.centre, edges, None).iter().collect::<Vec<_>>()
    });
    let scene: Gaussians = (room().iter())
        .chain(discs)
        .chain(heap(&bulb, RADIANCE))
        .collect();
    let tracer = Device::Cpu.scene(&scene).unwrap();
    let mut evidence = Evidence::default();
    for (i, camera) in cameras().into_iter().enumerate() {
        let seen = tracer.gbuffer(&camera).unwrap();
        evidence.add(&photograph(i, camera, &bulb, &shade), 0, &seen);
    }
    let found = find(&evidence, &scene, Vec3::Z, &*tracer, &mut |_, _| ()).unwrap();
    let [lamp] = found.lamps.lamps.as_slice() else {
        panic!("{:?}", found.lamps);
    };
    assert_eq!(lamp.shape, LampShape::Ball);
    assert!(lamp.centre().distance(centre) < 0.1 * radius, "{lamp:?}");
    let share = lamp.radiance[0] / RADIANCE.x;
    assert!((share - 1.0).abs() < 0.02, "{share}");
    // The scene's shade ends softly, where in photographs it ends at once.
    let share = lamp.area / bulb.area();
    assert!((share - 1.0).abs() < 0.2, "{share}");
    // The shade stays.
    let gone = found.edit.keep.iter().zip(&scene.emissions);
    assert!(
        gone.clone()
            .all(|(keep, emission)| *keep || *emission > 0.0)
    );
    assert!(gone.clone().any(|(keep, _)| !keep));
}
