//! Lamps of known place and power, photographed by exact rays, are found as they are.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_lamps::{Found, Kinds};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::lamps::{LampShape, Lamps};
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
/// film, a bright disc beside it that no mask shows, and one that it may light.
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
    let like = scene[0];
    let beside = |share: f32| Gaussian {
        position: flat.centre + Vec3::new(0.12, 0.0, 0.015),
        scale: Vec2::splat(0.03),
        opacity: 0.5,
        radiance: RADIANCE * share,
        ..like
    };
    let (bright, dim) = (scene.len(), scene.len() + 1);
    scene.extend([0.7, 0.3].map(beside));
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
    assert!(!found.edit.keep[bright] && found.edit.keep[dim]);
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
        is_open: false,
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
