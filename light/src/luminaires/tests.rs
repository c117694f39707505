use super::*;
use crate::alike::testing::in_cube;
use crate::irradiance;
use bulb::black;
use eagpt_scene::discs::Solid;
use eagpt_scene::rng::Purpose;
use eagpt_scene::{Gaussian, LampShape};
use eagpt_testkit::gaussians::{cube, look_at, material};
use eagpt_trace::transport::points::Points;
use glam::Quat;
use places::hidden;
use std::f32::consts::{PI, TAU};

/// Mean albedo of the walls, and what textures differ from it by.
const ALBEDO: f32 = 0.5;
const TEXTURE: f32 = 0.2;
/// Middle of a shade, its width and its height.
const SHADE: (Vec3, [f32; 2]) = (Vec3::new(0.4, 0.1, 0.35), [0.12, 0.16]);
/// The bulb in it.
const RADIUS: f32 = 0.01;
const RADIANCE: Vec3 = Vec3::new(3000.0, 2000.0, 1000.0);

fn key(number: u32) -> RandomKey {
    RandomKey::new(5, Purpose::Albedo, number)
}

/// A black flat surface.
fn wall(centre: Vec3, edges: [Vec3; 2]) -> Gaussians {
    black(Solid::Quad { centre, edges }, None, Some(0.01)).discs()
}

/// A white cube of half edge 1 in which a shade stands that is closed below and open above, and
/// the number of discs of the cube.
fn room() -> (Vec<Gaussian>, usize) {
    let (centre, [width, height]) = SHADE;
    let half = 0.5 * width;
    let sides = [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y].map(|out| {
        let along = width * Vec3::new(-out.y, out.x, 0.0);
        wall(centre + half * out, [along, height * Vec3::Z])
    });
    let centre = centre - 0.5 * height * Vec3::Z;
    let base = wall(centre, [width * Vec3::X, width * Vec3::Y]);
    let mut discs = cube(1.0, 0.08, |_| material(Vec3::ZERO, 0.0, Vec3::ONE));
    let num_walls = discs.len();
    discs.extend(sides.iter().chain([&base]).flat_map(Gaussians::iter));
    (discs, num_walls)
}

/// Cameras around the shade, at most a little higher.
fn cameras() -> Vec<Camera> {
    let (centre, _) = SHADE;
    let camera = |k: u8| {
        let (sin, cos) = (TAU * f32::from(k) / 12.0).sin_cos();
        let height = 0.08 * f32::from(k % 3) - 0.1;
        let eye = Vec3::new(0.8 * cos, 0.8 * sin, centre.z + height);
        look_at(eye.as_dvec3(), centre.as_dvec3(), 96, 64)
    };
    (0..12).map(camera).collect()
}

/// Light that the walls, the first discs of a scene, get straight from what emits of it.
fn direct(scene: &Gaussians, num_walls: usize) -> (Vec<Receiver>, Vec<Vec3>) {
    let walls = scene.iter().take(num_walls).zip(0..);
    let receivers: Vec<Receiver> = walls.map(|(disc, i)| in_cube(&disc, i)).collect();
    let tracer = Device::Cpu.scene(scene).unwrap();
    let dark = vec![Vec3::ZERO; scene.len()];
    let direct = irradiance::received(&*tracer, &receivers, &dark, (512, key(1))).unwrap();
    (receivers, direct)
}

/// The luminaires of a room with a bulb in the shade, and its light, if it is `on`.
fn found(on: bool) -> (HiddenLamps, Vec<Vec3>) {
    let (discs, num_walls) = room();
    let bulb = Solid::Ball {
        centre: SHADE.0,
        radius: RADIUS,
    };
    let radiance = if on { RADIANCE } else { Vec3::ZERO };
    let mut gaussians: Gaussians = discs.into_iter().collect();
    let bulb = black(bulb, Some(radiance), None).discs();
    let lit = gaussians.iter().chain(bulb.iter()).collect();
    let (receivers, direct) = direct(&lit, num_walls);
    let mut received = Vec::new();
    for (receiver, direct) in receivers.into_iter().zip(&direct) {
        let known = Vec3::splat(0.5 + 0.2 * receiver.1.position.y);
        let [texture, ..] = Points::new(key(3), receiver.0).block(0, 0);
        let albedo = ALBEDO + TEXTURE * (2.0 * texture - 1.0);
        gaussians.radiances[receiver.0 as usize] = albedo * (known + *direct);
        received.push((receiver, known));
    }
    let (cameras, scene) = (cameras(), (&Device::Cpu, &gaussians));
    let found = find(scene, (&[], &received), (&cameras, Vec3::Z), key(2)).unwrap();
    (found, direct)
}

#[test]
fn what_an_uplighter_lights_tells_of_its_bulb() {
    let (found, expected) = found(true);
    let [lamp] = &found.lamps[..] else {
        panic!("{} lamps", found.lamps.len())
    };
    let off = lamp.centre() - SHADE.0;
    assert!(off.truncate().length() < 0.5 * SHADE.1[0], "{off}");
    let (room, num_walls) = room();
    assert!(found.edit.keep[..num_walls].iter().all(|stays| *stays));
    let lit = found.edit.applied(&room.into_iter().collect());
    let (_, light) = direct(&lit, num_walls);
    for channel in 0..3 {
        let sum = |of: &[Vec3]| of.iter().map(|light| light[channel]).sum::<f32>();
        let ratio = sum(&light) / sum(&expected);
        // Cones end at rings of 7.5°, and the weight on light takes some.
        assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
    }
    // Its power is that which leaves the shade, by a cone in place of a square opening.
    let [side, height] = SHADE.1.map(|length| 0.5 * length);
    let edge = height * (2.0 * side * side + height * height).sqrt();
    let opening = 4.0 * (side * side / edge).atan();
    let power = opening * PI * RADIUS * RADIUS * RADIANCE;
    let ratio = Vec3::from(lamp.power) / power;
    assert!((ratio - 1.0).abs().max_element() < 0.15, "{ratio}");
}

#[test]
fn where_no_light_is_missing_is_no_luminaire() {
    assert!(found(false).0.lamps.is_empty());
}

#[test]
fn a_bulb_hidden_in_some_lamps_of_one_make_may_be_in_all() {
    let places = |sides: [usize; 2]| {
        let mut scene = cube(1.0, 0.08, |_| material(Vec3::ZERO, 0.0, Vec3::ONE));
        let mut lamps = Vec::new();
        for (x, num_sides) in [-0.4, 0.4].into_iter().zip(sides) {
            let opening = Vec3::new(x, 0.0, 0.3);
            let sides = [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y];
            for out in sides.into_iter().take(num_sides) {
                let along = 0.12 * Vec3::new(-out.y, out.x, 0.0);
                let centre = opening + 0.06 * out + 0.1 * Vec3::Z;
                scene.extend(wall(centre, [along, 0.2 * Vec3::Z]).iter());
            }
            // Its front, +z, is turned downwards.
            let frame = (opening, Quat::from_rotation_x(PI), Vec3::new(0.1, 0.1, 0.0));
            lamps.push(Lamp {
                one_sided: true,
                ..Lamp::unmeasured(LampShape::Panel, frame, (0.01, Vec3::ONE))
            });
        }
        let tracer = Device::Cpu.scene(&scene.into_iter().collect()).unwrap();
        let camera = |k: u8| {
            let (sin, cos) = (TAU * f32::from(k) / 16.0).sin_cos();
            let eye = 0.9 * Vec3::new(cos, sin, 0.4);
            look_at(eye.as_dvec3(), glam::DVec3::new(0.0, 0.0, 0.35), 96, 64)
        };
        let cameras: Vec<Camera> = (0..16).map(camera).collect();
        let surfaces = [Vec3::splat(-1.0), Vec3::splat(1.0)];
        let found = hidden(&*tracer, (&surfaces, &lamps), (&cameras, Vec3::Z)).unwrap();
        let behind = found.all.into_iter().filter(|place| place.is_behind_lamp);
        let positions: Vec<Vec<Vec3>> = behind.map(|place| place.positions).collect();
        let num_single = |x: f32| {
            let is_at = |of: &&Vec<Vec3>| of.len() == 1 && of[0].x * x > 0.0;
            positions.iter().filter(is_at).count()
        };
        let num_sets = positions.iter().filter(|of| of.len() == 2).count();
        ([num_single(-1.0), num_single(1.0)], num_sets)
    };
    let ([first, second], sets) = places([4, 4]);
    assert!(
        first > 0 && second > 0 && sets > 0,
        "{first} {second} {sets}"
    );
    // One side of the second is missing.
    let ([first, second], sets) = places([4, 3]);
    assert!(
        first > 0 && second == 0 && sets >= first,
        "{first} {second} {sets}"
    );
    assert_eq!(places([3, 3]), ([0, 0], 0));
}
