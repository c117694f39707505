//! Lamps of known place and power, photographed by exact rays, are found as they are, and what
//! training puts before one goes: behind it, along its ceiling, or away.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_lamps::{Found, Kinds, freed};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::lamps::{Lamp, LampShape, Lamps};
use eagpt_scene::{Gaussian, Gaussians, Gloss, SceneEdit, rotation};
use glam::{Quat, Vec2, Vec3};
use rig::{RADIANCE, cameras, find_in, patch, photograph, room};
use std::f32::consts::PI;

fn found(lamp: &Shape, scene: &Gaussians) -> Found {
    found_of(Kinds::All, lamp, scene)
}

fn found_of(kinds: Kinds, lamp: &Shape, scene: &Gaussians) -> Found {
    let cameras = cameras().into_iter().enumerate();
    find_in(
        scene,
        kinds,
        cameras.map(|(i, camera)| photograph(i, camera, lamp, &[])),
    )
}

/// A flat square of 5 cm discs of this opacity.
fn film(centre: Vec3, size: f32, opacity: f32, radiance: Option<Vec3>) -> Vec<Gaussian> {
    let edges = [Vec3::X, Vec3::NEG_Y].map(|edge| edge * size);
    let discs = patch(centre, edges, radiance);
    discs
        .iter()
        .map(|disc| Gaussian { opacity, ..disc })
        .collect()
}

/// A panel of 20 × 16 cm flush with the ceiling, where training left a heap of discs behind a dim
/// film.
#[test]
fn a_panel_at_the_ceiling_is_flat_and_nothing_hides_it() {
    let flat = Flat {
        centre: Vec3::new(0.2, 0.1, 2.49),
        rotation: rotation::from_z_to(Vec3::NEG_Z) * Quat::from_rotation_z(0.4),
        size: [0.2, 0.16],
    };
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let num_room = scene.len();
    scene.extend(film(
        flat.centre + Vec3::Z * 0.02,
        0.3,
        0.9,
        Some(RADIANCE * 2.0),
    ));
    let first = scene.len();
    scene.extend(film(flat.centre - Vec3::Z * 0.03, 0.12, 0.4, None));
    let film = first..scene.len();
    let scene: Gaussians = scene.into_iter().collect();
    let bare = found_of(Kinds::Bare, &Shape::Rectangle(flat), &scene);
    assert_eq!(bare.lamps, Lamps::default());
    assert_eq!(bare.edit, SceneEdit::nothing(scene.len()));
    let found = found(&Shape::Rectangle(flat), &scene);
    let [lamp] = found.lamps.lamps.as_slice() else {
        panic!("{:?}", found.lamps)
    };
    assert_eq!(
        (lamp.name.as_str(), lamp.shape),
        ("ceiling-1", LampShape::Panel)
    );
    assert!(lamp.centre().distance(flat.centre) < 0.01, "{lamp:?}");
    let normal = lamp.world_from_lamp() * Vec3::Z;
    assert!(normal.dot(Vec3::NEG_Z) > 0.999, "{normal}");
    // Pixels of some 2 cm and masks of whole ones.
    let power = RADIANCE.x * PI * 0.2 * 0.16;
    assert!(
        (lamp.power[0] / power - 1.0).abs() < 0.04,
        "{} {power}",
        lamp.power[0]
    );
    assert!(
        (lamp.power[2] / lamp.power[0] - 0.5).abs() < 0.01,
        "{:?}",
        lamp.power
    );
    assert!(film.into_iter().all(|i| !found.edit.keep[i]));
    // The ceiling stays, behind the lamp.
    let without_lamps = SceneEdit {
        fixed: Gaussians::default(),
        ..found.edit
    };
    let after = without_lamps.applied(&scene);
    assert!(after.len() + 40 > num_room, "{} of {num_room}", after.len());
    let sticks_out = |p: &&Vec3| p.z < lamp.centre[2] && p.distance(lamp.centre()) < 0.15;
    assert_eq!(after.positions.iter().filter(sticks_out).count(), 0);
}

#[test]
fn round_and_long_lamps_have_their_power() {
    let ball = Shape::Ball {
        centre: Vec3::new(0.1, 0.2, 1.9),
        radius: 0.06,
    };
    let tube = Shape::Tube {
        centre: Vec3::new(0.1, 0.2, 2.0),
        rotation: rotation::from_z_to(Vec3::X),
        radius: 0.03,
        length: 0.6,
        taper: 0.0,
    };
    for (lamp, shape) in [(ball, LampShape::Ball), (tube, LampShape::Tube)] {
        // As training leaves it: discs that are about where the lamp is.
        let mut scene: Vec<Gaussian> = room().iter().collect();
        let left = match lamp {
            Shape::Ball { centre, .. } => Solid::Ball {
                centre,
                radius: 0.05,
            },
            _ => Solid::Box {
                centre: lamp.centre(),
                size: Vec3::new(0.6, 0.04, 0.04),
                rotation: Quat::IDENTITY,
            },
        };
        let surface = Surface {
            solid: left,
            material: Material {
                albedo: Vec3::ZERO,
                radiance: Some(RADIANCE),
                gloss: Gloss::NONE,
            },
            spacing: Some(0.02),
        };
        scene.extend(surface.discs().iter());
        let scene: Gaussians = scene.into_iter().collect();
        let found = found(&lamp, &scene);
        // To some views it is large.
        let bare = found_of(Kinds::Bare, &lamp, &scene);
        assert_eq!(bare.lamps, Lamps::default());
        let [own] = found.lamps.lamps.as_slice() else {
            panic!("{:?}", found.lamps)
        };
        assert_eq!(own.shape, shape);
        assert!(own.centre().distance(lamp.centre()) < 0.01, "{own:?}");
        let power = RADIANCE.x * PI * lamp.area();
        assert!(
            (own.power[0] / power - 1.0).abs() < 0.05,
            "{} {power}",
            own.power[0]
        );
    }
}

#[test]
fn a_ball_of_a_few_pixels_is_a_bare_lamp() {
    let ball = Shape::Ball {
        centre: Vec3::new(0.1, 0.2, 1.9),
        radius: 0.015,
    };
    let bare = found_of(Kinds::Bare, &ball, &room());
    assert_eq!(bare, found(&ball, &room()));
    let [lamp] = bare.lamps.lamps.as_slice() else {
        panic!("{:?}", bare.lamps)
    };
    assert_eq!(lamp.shape, LampShape::Ball);
    assert!(lamp.centre().distance(ball.centre()) < 0.01, "{lamp:?}");
}

#[test]
fn where_no_mask_shows_a_lamp_nothing_changes() {
    let scene = room();
    let found = find_in(&scene, Kinds::All, std::iter::empty());
    assert!(found.lamps.lamps.is_empty());
    assert_eq!(found.edit, SceneEdit::nothing(scene.len()));
    assert_eq!(found.edit.applied(&scene), scene);
}

/// Height of the panel of [`panel`].
const HEIGHT: f32 = 2.49;

fn panel(bars: bool) -> Lamps {
    let size = Vec3::new(0.2, 0.16, 0.0);
    let down = rotation::from_z_to(Vec3::NEG_Z);
    let frame = (Vec3::new(0.2, 0.1, HEIGHT), down, size);
    let lamp = Lamp {
        name: "ceiling-1".to_owned(),
        one_sided: true,
        bars,
        num_pixels: 100,
        ..Lamp::unmeasured(LampShape::Panel, frame, (0.032, RADIANCE))
    };
    Lamps { lamps: vec![lamp] }
}

/// Discs before the lamp: the edge of a large one of the ceiling that is tilted, a faint one below
/// the lamp, one that stands upright beside it, one of the ceiling farther away, and the lamp's
/// own.
fn discs() -> [Gaussian; 5] {
    let like = room().get(0);
    let disc = |position: [f32; 3], scale: [f32; 2], rotation: Quat, opacity: f32| Gaussian {
        position: position.into(),
        scale: Vec2::from(scale),
        rotation,
        opacity,
        ..like
    };
    let tilted = Quat::from_rotation_y(-0.03);
    let upright = rotation::from_z_to(Vec3::X);
    [
        disc([1.0, 0.1, 2.5], [0.5, 0.3], tilted, 0.95),
        disc([0.25, 0.1, 2.42], [0.05, 0.05], Quat::IDENTITY, 0.12),
        disc([0.32, 0.1, 2.4], [0.05, 0.05], upright, 0.9),
        disc([1.0, 1.5, 2.5], [0.2, 0.2], Quat::IDENTITY, 0.9),
        disc(
            [0.2, 0.1, HEIGHT - 0.001],
            [0.01, 0.01],
            Quat::IDENTITY,
            0.99,
        ),
    ]
}

#[test]
fn nothing_along_the_ceiling_stays_before_a_panel() {
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    scene.extend(discs());
    let scene: Gaussians = scene.into_iter().collect();
    let [tilted, faint, upright, far, own] = [0, 1, 2, 3, 4].map(|i| first + i);

    let edit = freed(&scene, own, &panel(false), |_| Vec::new());
    let moved = |i: usize| edit.moved.iter().find(|(at, _)| *at as usize == i);
    let (_, flat) = moved(tilted).unwrap();
    let normal = flat.rotation * Vec3::Z;
    assert!(normal.z.abs() > 0.999_99, "{normal}");
    assert!(flat.position.z > HEIGHT, "{}", flat.position);
    assert_eq!(flat.scale, scene.scales[tilted]);
    let gone: Vec<usize> = (0..scene.len()).filter(|&i| !edit.keep[i]).collect();
    assert_eq!(gone, [faint]);
    for i in [upright, far, own] {
        assert!(moved(i).is_none(), "{i}");
    }
    assert!(edit.moved.is_sorted_by_key(|(i, _)| *i));

    // Freed once, there is nothing left to do but for what lies right already.
    let after = edit.applied(&scene);
    let again = freed(&after, own - 1, &panel(false), |_| Vec::new());
    assert!(again.keep.iter().all(|keep| *keep));
    for (i, gaussian) in &again.moved {
        let before = after.positions[*i as usize];
        assert!(gaussian.position.distance(before) < 1e-5, "{before}");
    }
}

#[test]
fn what_stands_before_a_window_stays() {
    let scene: Gaussians = room().iter().chain(discs()).collect();
    let edit = freed(&scene, scene.len() - 1, &panel(true), |_| Vec::new());
    assert_eq!(edit, SceneEdit::nothing(scene.len()));
}

/// A flat can at the ceiling, seen from below: a faint disc hangs before its face, one of the
/// ceiling hangs down beside it, and a board is farther below.
#[test]
fn nothing_hides_the_face_of_a_can_at_the_ceiling() {
    let [mut can] = <[Lamp; 1]>::try_from(panel(false).lamps).unwrap();
    can.shape = LampShape::Tube;
    can.size = [0.1, 0.1, 0.01];
    can.centre[2] = HEIGHT - 0.005;
    let face = HEIGHT - 0.01;
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    let like = scene[0];
    let disc = |x: f32, z: f32, size: f32, opacity: f32| Gaussian {
        position: Vec3::new(x, 0.1, z),
        scale: Vec2::splat(size),
        rotation: Quat::IDENTITY,
        opacity,
        ..like
    };
    // Enough of the ceiling for a plane.
    for k in 0..12 {
        scene.push(disc(0.14 + 0.01 * k as f32, HEIGHT + 0.001, 0.02, 0.9));
    }
    let hanging = scene.len();
    scene.push(disc(0.28, HEIGHT - 0.002, 0.02, 0.9));
    let film = scene.len();
    scene.push(disc(0.21, face - 0.08, 0.05, 0.12));
    let board = scene.len();
    scene.push(disc(0.2, face - 0.6, 0.3, 0.9));
    let scene: Gaussians = scene.into_iter().collect();
    let lamps = Lamps { lamps: vec![can] };
    let eyes = |_: &Lamp| [0.0, 0.4].map(|x| Vec3::new(x, 0.0, HEIGHT - 0.6)).to_vec();

    let edit = freed(&scene, scene.len(), &lamps, eyes);
    let gone: Vec<usize> = (0..scene.len()).filter(|&i| !edit.keep[i]).collect();
    assert_eq!(gone, [film]);
    let after = |i: usize| edit.moved.iter().find(|(at, _)| *at as usize == i);
    let moved = after(hanging).unwrap().1;
    assert!(moved.position.z > HEIGHT, "{}", moved.position);
    assert!(after(board).is_none());
    assert!(edit.moved.iter().all(|(i, _)| *i as usize >= first));

    // Without views that show it, a face is not known to shine, and what is before it stays.
    let edit = freed(&scene, scene.len(), &lamps, |_| Vec::new());
    assert!(edit.keep[film]);
}

/// A strip under a shelf, which cameras see from a little below it: the shelf, trained too low, is
/// over the strip, not under it.
#[test]
fn a_strip_under_a_shelf_hangs_from_it() {
    let [mut strip] = <[Lamp; 1]>::try_from(panel(false).lamps).unwrap();
    strip.shape = LampShape::Box;
    strip.size = [0.8, 0.03, 0.015];
    strip.rotation = [1.0, 0.0, 0.0, 0.0];
    strip.centre[2] = HEIGHT - 0.9;
    let centre = strip.centre();
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    let like = scene[0];
    for k in 0..16 {
        scene.push(Gaussian {
            position: centre + Vec3::new(0.05 * (k as f32 - 7.5), 0.02, -0.004 + 0.001 * k as f32),
            scale: Vec2::splat(0.04),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            ..like
        });
    }
    let scene: Gaussians = scene.into_iter().collect();
    let lamps = Lamps { lamps: vec![strip] };
    let eyes = |_: &Lamp| {
        [-0.5, 0.0, 0.5]
            .map(|x| centre + Vec3::new(x, -2.0, -0.15))
            .to_vec()
    };
    let edit = freed(&scene, scene.len(), &lamps, eyes);
    let after = edit.applied(&scene);
    let shelf: Vec<f32> = (first..after.len()).map(|i| after.positions[i].z).collect();
    let top = centre.z + 0.5 * 0.015;
    assert!(
        shelf.len() >= 8 && shelf.iter().all(|z| *z > top),
        "{top} {shelf:?}"
    );
}

/// A tube before a wall whose discs training has bulging around it, and a picture that hangs beside
/// it.
#[test]
fn a_tube_hangs_before_its_wall() {
    let [mut tube] = <[Lamp; 1]>::try_from(panel(false).lamps).unwrap();
    let (centre, radius) = (Vec3::new(0.0, 0.0, 1.6), 0.015);
    tube.shape = LampShape::Tube;
    tube.centre = centre.to_array();
    tube.size = [2.0 * radius, 2.0 * radius, 0.6];
    let along_x = rotation::from_z_to(Vec3::X);
    tube.rotation = [along_x.w, along_x.x, along_x.y, along_x.z];
    let mut scene: Vec<Gaussian> = room().iter().collect();
    let first = scene.len();
    let like = scene[0];
    let facing = rotation::from_z_to(Vec3::NEG_Y);
    let disc = |x: f32, y: f32, z: f32| Gaussian {
        position: centre + Vec3::new(x, y, z),
        scale: Vec2::splat(0.02),
        rotation: facing,
        opacity: 0.9,
        ..like
    };
    // The wall is at 0.03; it bulges by up to 0.025.
    for k in 0..60 {
        let x = 0.01 * (k as f32 - 29.5);
        let z = 0.02 * ((k % 5) as f32 - 2.0);
        scene.push(disc(x, 0.03 - 0.005 * (k % 6) as f32, z));
    }
    let picture = scene.len();
    scene.push(disc(0.1, -0.02, 0.2));
    let scene: Gaussians = scene.into_iter().collect();
    let lamps = Lamps { lamps: vec![tube] };
    let eyes = |_: &Lamp| {
        [-0.5, 0.0, 0.5]
            .map(|x| centre + Vec3::new(x, -2.0, 0.1))
            .to_vec()
    };
    let edit = freed(&scene, scene.len(), &lamps, eyes);
    assert!(edit.keep.iter().all(|keep| *keep));
    let after = edit.applied(&scene);
    let wall = (first..picture).map(|i| after.positions[i].y);
    assert!(
        wall.clone().all(|y| y > radius),
        "{:?}",
        wall.collect::<Vec<_>>()
    );
    assert_eq!(after.get(picture), scene.get(picture));
    // Seen from the other side it has no wall.
    let behind = |lamp: &Lamp| eyes(lamp).into_iter().map(|eye| eye.with_y(2.0)).collect();
    let edit = freed(&scene, scene.len(), &lamps, behind);
    assert!(edit.moved.is_empty());
}
