//! Lamps of known place and power, photographed by exact rays, are found as they are.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_lamps::{Evidence, Found, find};
use eagpt_scene::discs::{Material, Solid, Surface};
use eagpt_scene::lamps::LampShape;
use eagpt_scene::{Camera, Gaussian, Gaussians, Image, SceneEdit, View, rotation};
use eagpt_trace::Device;
use glam::{DVec3, Quat, Vec3};
use std::f32::consts::PI;

/// Rays along each axis of a pixel of a photograph.
const RAYS: u32 = 8;
const RADIANCE: Vec3 = Vec3::new(40.0, 30.0, 20.0);
const WALL: Vec3 = Vec3::new(0.3, 0.25, 0.2);

/// A closed room of 4 × 4 × 2.5 from the floor at z = 0.
fn room() -> Gaussians {
    let material = Material {
        albedo: Vec3::splat(0.5),
        radiance: None,
    };
    let size = Vec3::new(4.0, 4.0, 2.5);
    let solid = Solid::Box {
        centre: Vec3::new(0.0, 0.0, 1.25),
        size,
        rotation: Quat::IDENTITY,
    };
    let surface = Surface {
        solid,
        material,
        spacing: Some(0.12),
    };
    (surface.discs().iter())
        .map(|disc| Gaussian {
            radiance: WALL,
            ..disc
        })
        .collect()
}

fn cameras() -> Vec<Camera> {
    (0..9_u8)
        .map(|i| {
            let angle = f64::from(i) * 2.2;
            let out = 1.1 + 0.06 * f64::from(i);
            let eye = DVec3::new(
                out * angle.cos(),
                out * angle.sin(),
                1.0 + 0.1 * f64::from(i % 4),
            );
            let target = DVec3::new(0.1, 0.1, 2.2);
            let pose = Camera::level_pose(eye, (target - eye).normalize());
            Camera::centred([120, 80], 1.3, pose)
        })
        .collect()
}

/// What `camera` sees of the room with a lamp.
fn photograph(name: usize, camera: Camera, lamp: &Shape) -> View {
    let frame = camera.ray_frame();
    let (mut radiance, mut mask) = (Vec::new(), Vec::new());
    for y in 0..camera.height {
        for x in 0..camera.width {
            let met = (0..RAYS * RAYS).filter(|k| {
                let at = |k: u32| (k as f32 + 0.5) / RAYS as f32;
                let (u, v) = (x as f32 + at(k % RAYS), y as f32 + at(k / RAYS));
                lamp.meet(frame.origin, frame.direction(u, v)).is_some()
            });
            let cover = met.count() as f32 / (RAYS * RAYS) as f32;
            radiance.push(WALL.lerp(RADIANCE, cover).to_array());
            mask.push([f32::from(u8::from(cover >= 0.5))]);
        }
    }
    let (width, height) = (camera.width, camera.height);
    View {
        name: format!("view-{name}"),
        camera,
        radiance: Image::from_pixels(width, height, radiance).unwrap(),
        emission: Image::from_pixels(width, height, mask),
        normal: None,
        alpha: None,
        depth: None,
        albedo: None,
        clipped: None,
        valid: None,
    }
}

fn found(lamp: &Shape, scene: &Gaussians) -> Found {
    let tracer = Device::Cpu.scene(scene).unwrap();
    let mut evidence = Evidence::default();
    for (i, camera) in cameras().into_iter().enumerate() {
        let seen = tracer.gbuffer(&camera).unwrap();
        evidence.add(&photograph(i, camera, lamp), &seen);
    }
    find(&evidence, scene, Vec3::Z, &Device::Cpu).unwrap()
}

/// A flat square that shines or does not, where training left the lamp or something near it.
fn patch(centre: Vec3, size: f32, opacity: f32, radiance: Option<Vec3>) -> Vec<Gaussian> {
    let surface = Surface {
        solid: Solid::Quad {
            centre,
            edges: [Vec3::X, Vec3::NEG_Y].map(|edge| edge * size),
        },
        material: Material {
            albedo: Vec3::splat(0.5),
            radiance,
        },
        spacing: Some(0.05),
    };
    let discs = surface.discs();
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
    scene.extend(patch(
        flat.centre + Vec3::Z * 0.02,
        0.3,
        0.9,
        Some(RADIANCE * 2.0),
    ));
    let first = scene.len();
    scene.extend(patch(flat.centre - Vec3::Z * 0.03, 0.12, 0.4, None));
    let film = first..scene.len();
    let scene: Gaussians = scene.into_iter().collect();
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
        // What training left: discs that are about where the lamp is.
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
            },
            spacing: Some(0.02),
        };
        scene.extend(surface.discs().iter());
        let scene: Gaussians = scene.into_iter().collect();
        let found = found(&lamp, &scene);
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
fn where_no_mask_shows_a_lamp_nothing_changes() {
    let scene = room();
    let found = find(&Evidence::default(), &scene, Vec3::Z, &Device::Cpu).unwrap();
    assert!(found.lamps.lamps.is_empty());
    assert_eq!(found.edit, SceneEdit::nothing(scene.len()));
    assert_eq!(found.edit.applied(&scene), scene);
}
