//! A bulb in a shade is the ball that its lower part is of, with all its power.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::Kinds;
use eagpt_lamps::shape::{Flat, Shape};
use eagpt_scene::lamps::LampShape;
use eagpt_scene::{Camera, Gaussian, Gaussians};
use eagpt_trace::{Device, Ray};
use glam::{DVec3, Mat3, Quat, Vec3};
use rig::{RADIANCE, cameras, find_in, heap, patch, photograph, room};
use std::f32::consts::TAU;

const NUM_SIDES: u8 = 8;
const RADIUS: f32 = 0.18;
const HEIGHT: f32 = 0.4;
/// Height of a low shade, whose bulb no view sees from the side.
const LOW: f32 = 0.25;

/// The sides of a shade about a vertical axis, open below and above.
fn sides(lower_edge: Vec3, height: f32) -> Vec<Flat> {
    let side = |i: u8| {
        let angle = f32::from(i) / f32::from(NUM_SIDES) * TAU;
        let outwards = Vec3::new(angle.cos(), angle.sin(), 0.0);
        let frame = Mat3::from_cols(Vec3::Z.cross(outwards), Vec3::Z, outwards);
        let width = 2.0 * RADIUS * (0.5 * TAU / f32::from(NUM_SIDES)).tan();
        Flat {
            centre: lower_edge + outwards * RADIUS + Vec3::Z * (0.5 * height),
            rotation: Quat::from_mat3(&frame),
            size: [width, height],
        }
    };
    (0..NUM_SIDES).map(side).collect()
}

/// A side as training has it.
fn discs(side: &Flat) -> Vec<Gaussian> {
    let [width, height] = side.size;
    let edges = [Vec3::X * width, Vec3::Y * height].map(|edge| side.rotation * edge);
    patch(side.centre, edges, None).iter().collect()
}

#[test]
fn a_bulb_in_a_shade_has_the_power_of_a_whole_ball() {
    let (centre, radius) = (Vec3::new(0.1, 0.1, 2.1), 0.12);
    let bulb = Shape::Ball { centre, radius };
    let sides = sides(centre - Vec3::Z * 0.2, HEIGHT);
    let shade: Vec<Shape> = sides.iter().copied().map(Shape::Rectangle).collect();
    let scene: Gaussians = (room().iter())
        .chain(sides.iter().flat_map(discs))
        .chain(heap(&bulb, RADIANCE))
        .collect();
    let cameras = cameras().into_iter().enumerate();
    let photographs = cameras.map(|(i, camera)| photograph(i, camera, &bulb, &shade));
    let found = find_in(&scene, Kinds::All, photographs);
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

/// Cameras around a place, some so far below it and others nearly as high, that look at it.
fn around(place: Vec3, below: [f64; 2]) -> Vec<Camera> {
    let target = place.as_dvec3();
    let camera = |i: u8| {
        let angle = f64::from(i) * 0.9;
        let out = DVec3::new(angle.cos(), angle.sin(), 0.0) * 1.4;
        let eye = target + out - DVec3::Z * below[usize::from(i % 2)];
        let pose = Camera::level_pose(eye, (target - eye).normalize());
        Camera::centred([120, 80], 1.3, pose)
    };
    (0..14).map(camera).collect()
}

/// Share of the rays from a bulb that leave the room's middle within a metre, by the sine of their
/// elevation.
fn free(scene: &Gaussians, (centre, radius): (Vec3, f32), sine: f32) -> f32 {
    let tracer = Device::Cpu.scene(scene).unwrap();
    let flat = (1.0 - sine * sine).sqrt();
    let rays: Vec<Ray> = (0..36_u8)
        .map(|i| {
            let (sin, cos) = (f32::from(i) * TAU / 36.0).sin_cos();
            let towards = Vec3::new(cos * flat, sin * flat, sine);
            let origin = centre + towards * (1.1 * radius);
            Ray::free(origin.to_array(), towards.to_array())
        })
        .collect();
    let met = tracer.trace_rays(&rays).unwrap();
    let is_free = |met: &&eagpt_trace::Features| met.mean_distance() > 1.5 * RADIUS;
    met.iter().filter(is_free).count() as f32 / rays.len() as f32
}

#[test]
fn a_low_shade_is_closed_above_unless_the_ceiling_is_lit() {
    let (centre, radius) = (Vec3::new(0.1, 0.1, 2.0), 0.05);
    let bulb = Shape::Ball { centre, radius };
    let sides = sides(centre - Vec3::Z * 0.08, LOW);
    let shade: Vec<Shape> = sides.iter().copied().map(Shape::Rectangle).collect();
    let found_in = |room: &[Gaussian], shade: &[Shape], discs: Vec<Gaussian>| {
        let scene: Gaussians = (room.iter().copied())
            .chain(discs)
            .chain(heap(&bulb, RADIANCE))
            .collect();
        let cameras = around(centre, [1.2, 0.2]).into_iter().enumerate();
        let photographs = cameras.map(|(i, camera)| photograph(i, camera, &bulb, shade));
        let found = find_in(&scene, Kinds::All, photographs);
        (found.edit.applied(&scene), found.lamps.lamps)
    };
    let dark: Vec<Gaussian> = room().iter().collect();
    let found = |shade: &[Shape], discs: Vec<Gaussian>| found_in(&dark, shade, discs);
    let (scene, lamps) = found(&shade, sides.iter().flat_map(discs).collect());
    let [lamp] = lamps.as_slice() else {
        panic!("{lamps:?}");
    };
    assert!(lamp.centre().distance(centre) < radius, "{lamp:?}");
    // Its upper corner is 0.25 from the middle of the bulb, and what glows as much as a quarter
    // farther is of it.
    assert!((0.25..0.32).contains(&lamp.shade), "{}", lamp.shade);
    let bulb = (centre, radius);
    // The edge is seen at 24 degrees below the bulb.
    for (sine, expected) in [
        (0.95, 0.0),
        (0.6, 0.0),
        (0.1, 0.0),
        (-0.6, 1.0),
        (-0.95, 1.0),
    ] {
        assert_eq!(free(&scene, bulb, sine), expected, "{sine}");
    }
    // Open if the ceiling is lit, which its edge lets up to 47 degrees beside the axis.
    let lit: Vec<Gaussian> = (room().iter())
        .map(|disc| {
            let offset = disc.position - centre;
            let cos = offset.normalize().z;
            let share = (radius / offset.length()).powi(2) * cos;
            let is_lit = cos * RADIUS > (1.0 - cos * cos).sqrt() * (LOW - 0.08);
            let more = if is_lit { 0.5 * share } else { 0.0 };
            Gaussian {
                radiance: disc.radiance + RADIANCE * more,
                ..disc
            }
        })
        .collect();
    let (open, lamps) = found_in(&lit, &shade, sides.iter().flat_map(discs).collect());
    assert!((0.25..0.32).contains(&lamps[0].shade), "{}", lamps[0].shade);
    for (sine, expected) in [(0.95, 1.0), (0.6, 0.0), (0.1, 0.0), (-0.6, 1.0)] {
        assert_eq!(free(&open, bulb, sine), expected, "{sine}");
    }
    // A bulb that is seen from all sides has none.
    let (scene, lamps) = found(&[], Vec::new());
    assert_eq!(lamps[0].shade, 0.0);
    assert_eq!(free(&scene, bulb, 0.95), 1.0);
    // Nor has one behind a board, that hides it from two sides of eight.
    let board: Vec<Shape> = shade[..2].to_vec();
    let (scene, lamps) = found(&board, sides[..2].iter().flat_map(discs).collect());
    assert_eq!(lamps[0].shade, 0.0);
    assert_eq!(free(&scene, bulb, 0.95), 1.0);
}

/// Checks that rays from a bulb leave its shade downwards alone.
fn check_closed_above(scene: &Gaussians, bulb: (Vec3, f32)) {
    for (sine, expected) in [(0.95, 0.0), (0.6, 0.0), (0.1, 0.0), (-0.6, 1.0)] {
        assert_eq!(free(scene, bulb, sine), expected, "{sine}");
    }
}

/// Where few views from far below show the bulb, views do not tell where the edge is, 14 degrees
/// below it.
#[test]
fn the_edge_of_a_shade_is_where_the_scene_has_it() {
    let (centre, radius) = (Vec3::new(0.1, 0.1, 2.0), 0.05);
    let bulb = Shape::Ball { centre, radius };
    let sides = sides(centre - Vec3::Z * 0.045, LOW);
    let shade: Vec<Shape> = sides.iter().copied().map(Shape::Rectangle).collect();
    let scene: Gaussians = (room().iter())
        .chain(sides.iter().flat_map(discs))
        .chain(heap(&bulb, RADIANCE))
        .collect();
    let from_below = around(centre, [1.2; 2]).into_iter().take(4);
    let views = from_below.chain(around(centre, [0.2; 2])).enumerate();
    let photographs = views.map(|(i, camera)| photograph(i, camera, &bulb, &shade));
    let found = find_in(&scene, Kinds::All, photographs);
    check_closed_above(&found.edit.applied(&scene), (centre, radius));
}

#[test]
fn a_shade_that_was_trained_closed_stays() {
    let (centre, radius) = (Vec3::new(0.1, 0.1, 2.0), 0.05);
    let bulb = Shape::Ball { centre, radius };
    let sides = sides(centre - Vec3::Z * 0.08, LOW);
    let shade: Vec<Shape> = sides.iter().copied().map(Shape::Rectangle).collect();
    let edges = [Vec3::X, Vec3::Y].map(|edge| edge * 2.2 * RADIUS);
    let lid = patch(centre + Vec3::Z * (LOW - 0.08), edges, None);
    let scene: Gaussians = (room().iter())
        .chain(sides.iter().flat_map(discs))
        .chain(lid.iter())
        .chain(heap(&bulb, RADIANCE))
        .collect();
    let views = around(centre, [1.2, 0.2]).into_iter().enumerate();
    let photographs = views.map(|(i, camera)| photograph(i, camera, &bulb, &shade));
    let found = find_in(&scene, Kinds::All, photographs);
    assert!((0.25..0.32).contains(&found.lamps.lamps[0].shade));
    // All that is put in is the bulb, and all that goes is its heap.
    assert!(found.edit.fixed.emissions.iter().all(|e| *e > 0.0));
    let gone = found.edit.keep.iter().zip(&scene.emissions);
    assert!(gone.into_iter().all(|(keep, e)| *keep || *e > 0.0));
    check_closed_above(&found.edit.applied(&scene), (centre, radius));
}
