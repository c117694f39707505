//! Drums, cans and lampshades are tubes, closed or open.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::Shape;
use eagpt_scene::lamps::LampShape;
use eagpt_scene::{Camera, rotation};
use glam::{DVec3, Quat, Vec3};
use rig::found::{check, check_found, found_by};

/// A fifth as thick as it is wide, two pixels.
#[test]
fn a_flat_drum_is_no_panel() {
    let drum = Shape::Tube {
        centre: Vec3::new(0.1, 0.1, 2.2),
        rotation: Quat::IDENTITY,
        radius: 0.14,
        length: 0.056,
        taper: 0.0,
        is_open: false,
    };
    let found = check(&[(drum, Vec3::new(16.0, 14.0, 11.0))], 0.1);
    assert_eq!(found[0].shape, LampShape::Tube, "{found:#?}");
}

#[test]
fn a_can_at_the_ceiling_does_not_lie_on_its_side() {
    let can = Shape::Tube {
        centre: Vec3::new(0.1, 0.1, 2.46),
        rotation: Quat::IDENTITY,
        radius: 0.16,
        length: 0.07,
        taper: 0.0,
        is_open: false,
    };
    let found = check(&[(can, Vec3::new(17.0, 16.0, 14.5))], 0.06);
    assert_eq!(found[0].shape, LampShape::Tube, "{found:#?}");
}

/// A lampshade without ends, as views from above show: with them it would send half as much again.
#[test]
fn a_shade_that_is_dark_inside_is_an_open_tube() {
    let shade = Shape::Tube {
        centre: Vec3::new(0.1, 0.3, 0.95),
        rotation: Quat::IDENTITY,
        radius: 0.11,
        length: 0.17,
        taper: -0.18,
        is_open: true,
    };
    let views = [-0.9, -0.5, 0.1, 0.6, 1.1, 0.3].map(|x: f64| {
        let eye = DVec3::new(x, -0.9 + 0.3 * x.abs(), 1.5 + 0.2 * x);
        let ahead = (DVec3::new(0.1, 0.3, 0.95) - eye).normalize();
        Camera::centred([240, 160], 1.3, Camera::level_pose(eye, ahead))
    });
    let lamps = [(shade, Vec3::new(4.5, 3.6, 2.5))];
    let found = check_found(&lamps, found_by(&views, &lamps, &lamps), 0.06);
    assert_eq!(found[0].shape, LampShape::Tube, "{found:#?}");
    assert!(
        (found[0].area / shade.area() - 1.0).abs() < 0.06,
        "{found:#?}"
    );
}

/// A ring of light, flat on a wall and two pixels wide: an open tube of hardly any length.
fn ring(centre: Vec3, towards: Vec3, [inner, outer]: [f32; 2]) -> Shape {
    let radius = 0.5 * (inner + outer);
    Shape::Tube {
        centre,
        rotation: rotation::from_z_to(-towards),
        radius,
        length: 1e-3,
        taper: outer / radius - 1.0,
        is_open: true,
    }
}

#[test]
fn a_ring_on_a_wall_is_hollow() {
    let views = [-1.0, -0.4, 0.1, 0.7, 1.2].map(|x: f64| {
        let eye = DVec3::new(x, -0.4 + 0.4 * x.abs(), 1.2 + 0.3 * x);
        let ahead = (DVec3::new(0.2 + 0.3 * x, 2.0, 1.6) - eye).normalize();
        Camera::centred([240, 160], 1.3, Camera::level_pose(eye, ahead))
    });
    let lamps = [(
        ring(Vec3::new(0.2, 1.98, 1.6), Vec3::NEG_Y, [0.2, 0.225]),
        Vec3::new(14.0, 14.5, 15.0),
    )];
    check_found(&lamps, found_by(&views, &lamps, &lamps), 0.05);
}
