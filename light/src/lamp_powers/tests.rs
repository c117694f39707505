use super::*;
use crate::alike::testing::in_cube;
use eagpt_scene::light_basis::NO_LIGHT;
use eagpt_scene::rng::Purpose;
use eagpt_testkit::gaussians::{cube, material};
use eagpt_testkit::lamps::boxed;
use eagpt_trace::cpu::CpuScene;
use glam::DVec3;

const ALBEDO: f32 = 0.6;

fn key(number: u32) -> RandomKey {
    RandomKey::new(5, Purpose::Albedo, number)
}

/// Factors of two lamps in a white cube of half edge 1, in its ceiling and in a wall, that send
/// `true_factors` of what their discs do; there is other light, too.
fn found(true_factors: [f32; 2], free: [bool; 2]) -> Vec<f32> {
    let room: Gaussians =
        (cube(1.0, 0.05, |_| material(Vec3::ZERO, 0.0, Vec3::ONE)).into_iter()).collect();
    let mut gaussians = room.clone();
    let lamp_at = |p: Vec3| match p {
        p if p.z > 0.99 && p.truncate().length() < 0.15 => 0,
        p if p.x > 0.99 && p.distance(Vec3::new(1.0, 0.4, 0.3)) < 0.15 => 1,
        _ => NO_LIGHT,
    };
    let of: Vec<u32> = gaussians.positions.iter().map(|p| lamp_at(*p)).collect();
    let lit = |light: u32| {
        let mut scene = room.clone();
        for (i, _) in of.iter().enumerate().filter(|(_, of)| **of == light) {
            (scene.radiances[i], scene.emissions[i]) = (Vec3::new(20.0, 15.0, 10.0), 1.0);
        }
        scene
    };
    let receivers: Vec<Receiver> = (gaussians.iter().zip(0..))
        .filter(|(_, i)| of[*i as usize] == NO_LIGHT)
        .map(|(disc, i)| in_cube(&disc, i))
        .collect();
    let parts = [0, 1].map(|lamp| {
        let scene = lit(lamp);
        let dark = vec![Vec3::ZERO; scene.len()];
        let tracer = CpuScene::new(&scene);
        irradiance::received(&tracer, &receivers, &dark, (512, key(1))).unwrap()
    });
    let mut received = Vec::new();
    for (at, receiver) in receivers.into_iter().enumerate() {
        let others = Vec3::splat(0.5 + 0.2 * receiver.1.position.y);
        let light =
            |factors: [f32; 2]| others + parts[0][at] * factors[0] + parts[1][at] * factors[1];
        gaussians.radiances[receiver.0 as usize] = ALBEDO * light(true_factors);
        received.push((receiver, light([1.0, 1.0])));
    }
    for lamp in [0, 1] {
        let lit = lit(lamp);
        for i in (0..of.len()).filter(|&i| of[i] == lamp) {
            (gaussians.radiances[i], gaussians.emissions[i]) = (lit.radiances[i], 1.0);
        }
    }
    let lights = LightGroups {
        names: ["ceiling-1", "wall-1"].map(str::to_owned).to_vec(),
        of,
    };
    let tracer = CpuScene::new(&gaussians);
    factors((&tracer, &gaussians), (&lights, &free), &received, key(2)).unwrap()
}

#[test]
fn walls_tell_how_much_stronger_lamps_are() {
    for expected in [[2.0, 1.0], [1.0, 3.0], [1.6, 2.4]] {
        let found = found(expected, [true; 2]);
        for (found, expected) in found.iter().zip(expected) {
            // The weight on light takes little, noise of the light of single receivers the rest.
            assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
        }
    }
}

#[test]
fn lamps_are_no_weaker_than_views_saw_and_others_stay() {
    assert_eq!(found([1.0, 1.0], [true; 2]), [1.0, 1.0]);
    assert_eq!(found([0.5, 1.0], [true; 2]), [1.0, 1.0]);
    assert_eq!(found([1.0, 3.0], [true, false])[1], 1.0);
}

#[test]
fn a_flat_lamp_that_views_from_before_agree_on_is_measured() {
    let lamp = |one_sided: bool, deviation: f32| Lamp {
        one_sided,
        deviation,
        shape: LampShape::Panel,
        ..boxed("wall-1", [0.0, 0.0, 1.0], [1.0, 1.0, 0.0])
    };
    let is_measured = |lamp: Lamp, cosines: [f32; 5]| {
        let eye = |cosine: f32| {
            let sine = (1.0 - cosine * cosine).sqrt();
            Vec3::new(2.0 * sine, 0.0, 1.0 + 2.0 * cosine)
        };
        is_measured(&lamp, cosines.map(eye).into_iter())
    };
    let (before, beside) = ([0.9, 0.8, 0.75, 0.2, 0.1], [0.9, 0.8, 0.3, 0.2, 0.1]);
    assert!(is_measured(lamp(true, 0.05), before));
    assert!(!is_measured(lamp(true, 0.05), beside));
    assert!(!is_measured(lamp(true, 0.2), before));
    assert!(!is_measured(lamp(false, 0.05), before));
}

#[test]
fn a_flat_lamp_that_is_as_bright_from_all_sides_is_measured() {
    let lamp = |deviation: f32| Lamp {
        one_sided: true,
        deviation,
        shape: LampShape::Panel,
        ..boxed("panel-1", [0.0, 0.0, 1.0], [0.1, 0.1, 0.0])
    };
    let is_measured = |deviation: f32, cosines: &[f32]| {
        let eye = |cosine: &f32| {
            let sine = (1.0 - cosine * cosine).sqrt();
            Vec3::new(2.0 * sine, 0.0, 1.0 + 2.0 * cosine)
        };
        is_measured(&lamp(deviation), cosines.iter().map(eye))
    };
    assert!(is_measured(0.02, &[0.3, 0.35, 0.45]));
    assert!(!is_measured(0.05, &[0.3, 0.35, 0.45]));
    // All from one side, or behind it.
    assert!(!is_measured(0.02, &[0.3, 0.32, 0.34]));
    assert!(!is_measured(0.02, &[0.3, 0.45]));
    assert!(!is_measured(0.02, &[-0.3, 0.3, 0.45]));
    assert!(!is_measured(0.02, &[]));
}

#[test]
fn a_solid_lamp_is_measured_from_anywhere() {
    let lamp = |shape: LampShape, one_sided: bool| Lamp {
        one_sided,
        deviation: 0.02,
        shape,
        ..boxed("ball-1", [0.0; 3], [0.1; 3])
    };
    let eyes = || [Vec3::X, Vec3::Y, -Vec3::Z].into_iter();
    assert!(is_measured(&lamp(LampShape::Ball, false), eyes()));
    // Views saw one face of it.
    assert!(!is_measured(&lamp(LampShape::Box, true), eyes()));
    assert!(!is_measured(&lamp(LampShape::Other, false), eyes()));
}

#[test]
fn a_bulb_that_views_show_in_a_shade_is_not_hidden() {
    let opening = boxed("panel-1", [0.0; 3], [0.4, 0.4, 0.0]);
    let at = |shape: LampShape, z: f32| Lamp {
        shape,
        ..boxed("ball-1", [0.0, 0.0, z], [0.1; 3])
    };
    let shows = |lamp: Lamp| shows_bulb(&opening, &[opening.clone(), lamp]);
    assert!(shows(at(LampShape::Ball, -0.1)));
    assert!(!shows(at(LampShape::Ball, -0.5)));
    assert!(!shows(at(LampShape::Panel, -0.1)));
}

#[test]
fn a_lamp_is_cut_where_no_picture_shows_a_corner() {
    let lamp = |shape: LampShape| Lamp {
        shape,
        ..boxed("ceiling-1", [0.0, 0.0, 2.0], [1.0, 0.5, 0.0])
    };
    // A picture is as wide as what it shows is far away.
    let at = |x: f64, z: f64| {
        let pose = Camera::level_pose(DVec3::new(x, 0.0, z), DVec3::new(0.01, 0.0, 1.0));
        Camera::centred([100, 100], 2.0 * 0.5_f64.atan(), pose)
    };
    let panel = lamp(LampShape::Panel);
    let [whole, near, left, right] = [at(0.0, 0.7), at(0.0, 1.1), at(-0.5, 0.9), at(0.5, 0.9)];
    assert!(!is_cut(&panel, &[near, whole]));
    assert!(!is_cut(&panel, &[left, right]));
    assert!(is_cut(&panel, &[near, right]));
    assert!(!is_cut(&lamp(LampShape::Tube), &[near]));
}
