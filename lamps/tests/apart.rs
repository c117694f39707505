//! Lamps that run into each other in photographs are found one by one, each with its power.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::shape::{Flat, Shape};
use eagpt_scene::lamps::LampShape;
use eagpt_scene::{Camera, View, rotation};
use glam::{DVec3, Quat, Vec3};
use rig::found::{check, check_found, found, found_by, found_lit};

fn panel(x: f32, size: [f32; 2], radiance: Vec3) -> (Shape, Vec3) {
    let flat = Flat {
        centre: Vec3::new(x, 0.1, 2.49),
        rotation: rotation::from_z_to(Vec3::NEG_Z),
        size,
    };
    (Shape::Rectangle(flat), radiance)
}

fn bulb(centre: [f32; 3], radius: f32) -> (Shape, Vec3) {
    let centre = centre.into();
    (
        Shape::Ball { centre, radius },
        Vec3::new(260.0, 200.0, 120.0),
    )
}

#[test]
fn bulbs_before_a_panel_take_nothing_of_it() {
    let panel = panel(0.1, [1.2, 0.6], Vec3::new(9.0, 9.0, 10.0));
    let bulbs = [[-0.2, 0.0, 2.1], [0.4, 0.1, 2.1]].map(|at| bulb(at, 0.035));
    check(&[panel, bulbs[0], bulbs[1]], 0.1);
}

#[test]
fn panels_of_two_colours_side_by_side_are_two() {
    let warm = panel(-0.1, [0.4, 0.4], Vec3::new(15.0, 8.0, 4.0));
    let cool = panel(0.3, [0.4, 0.4], Vec3::new(6.0, 10.0, 16.0));
    check(&[warm, cool], 0.06);
}

/// Training has the pixels of bulbs on what is behind these, elsewhere in each view.
#[test]
fn bulbs_that_training_lacks_are_where_lines_of_sight_meet() {
    let panel = panel(0.1, [1.2, 0.6], Vec3::new(9.0, 9.0, 10.0));
    let bulbs = [[-0.2, 0.0, 2.1], [0.4, 0.1, 2.1]].map(|at| bulb(at, 0.035));
    let lamps = [panel, bulbs[0], bulbs[1]];
    check_found(&lamps, found(&lamps, &[panel]), 0.1);
}

/// Flat lamps of one to six pixels that hang below the ceiling. A flat drum would shine upwards, too.
#[test]
fn small_flat_lamps_are_no_drums() {
    for (x, y, z, size) in [
        (0.7, -0.4, 2.4, 0.06),
        (-1.0, 0.8, 2.4, 0.08),
        (0.7, -0.4, 2.4, 0.2),
    ] {
        let flat = Flat {
            centre: Vec3::new(x, y, z),
            rotation: rotation::from_z_to(Vec3::NEG_Z),
            size: [size; 2],
        };
        for shape in [Shape::Ellipse(flat), Shape::Rectangle(flat)] {
            let found = check(&[(shape, Vec3::new(160.0, 140.0, 110.0))], 0.15);
            assert_eq!(found[0].shape, LampShape::Panel, "{found:#?}");
        }
    }
}

/// A bar that is as wide as three pixels and a cube: a tube sends another part of their light up.
#[test]
fn lamps_with_edges_are_boxes() {
    let radiance = Vec3::new(34.0, 31.0, 26.0);
    let bar = |size: Vec3, turn: f32| Shape::Box {
        centre: Vec3::new(0.1, 0.1, 2.1),
        rotation: Quat::from_rotation_z(turn),
        size,
    };
    for size in [Vec3::new(0.9, 0.1, 0.1), Vec3::splat(0.2)] {
        let shape = bar(size, 0.4);
        let found = check(&[(shape, radiance)], 0.05);
        assert_eq!(found[0].shape, LampShape::Box, "{found:#?}");
    }
}

/// Cameras that are all on one side of a bar see the same of it as of a tilted panel, nearly.
#[test]
fn a_bar_before_a_wall_is_no_tilted_panel() {
    let bar = Shape::Box {
        centre: Vec3::new(0.1, 1.9, 2.1),
        rotation: Quat::IDENTITY,
        size: Vec3::new(0.8, 0.07, 0.06),
    };
    let eyes = [-1.2, -0.7, -0.2, 0.3, 0.8, 1.3].map(|x: f64| DVec3::new(x, 0.4 - x.abs(), 1.1));
    let views = eyes.map(|eye| {
        let target = bar.centre().as_dvec3() - DVec3::Z * 0.2;
        Camera::centred(
            [120, 80],
            1.3,
            Camera::level_pose(eye, (target - eye).normalize()),
        )
    });
    let lamps = [(bar, Vec3::new(52.0, 48.0, 42.0))];
    let found = check_found(&lamps, found_by(&views, &lamps, &lamps), 0.08);
    assert_ne!(found[0].shape, LampShape::Panel, "{found:#?}");
}

/// Views from a narrow range of angles cannot tell a tube before a wall from a strip on it, but for
/// the wall that the tube lights.
#[test]
fn a_tube_lights_the_wall_that_it_hangs_before() {
    const GAP: f32 = 0.022;
    let tube = Shape::Tube {
        centre: Vec3::new(0.1, 2.0 - GAP, 1.6),
        rotation: rotation::from_z_to(Vec3::X),
        radius: 0.015,
        length: 0.7,
        taper: 0.0,
        is_open: false,
    };
    let eyes = [-0.5, -0.3, 0.0, 0.2, 0.5].map(|x: f64| DVec3::new(x, 0.1, 1.4 + 0.3 * x));
    let views = eyes.map(|eye| {
        let ahead = (tube.centre().as_dvec3() - eye).normalize();
        Camera::centred([160, 120], 1.1, Camera::level_pose(eye, ahead))
    });
    let lamps = [(tube, Vec3::new(30.0, 28.0, 24.0))];
    let lit = |view: &mut View| {
        let (frame, width) = (view.camera.ray_frame(), view.camera.width);
        for (i, pixel) in (0..).zip(view.radiance.pixels_mut()) {
            let direction = frame.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let place = frame.origin + direction * ((2.0 - frame.origin.y) / direction.y);
            let away = place - tube.centre();
            if away.x.abs() < 0.35 && pixel[0] < 1.0 {
                // Of a long thin lamp, by the cosine at the wall.
                let light = 1.0 + 8.0 * GAP * GAP / (GAP * GAP + away.z * away.z);
                *pixel = pixel.map(|dark| dark * light);
            }
        }
    };
    let found = found_lit(&views, &lamps, &lamps, lit);
    assert_ne!(found[0].shape, LampShape::Panel, "{found:#?}");
    check_found(&lamps, found, 0.25);
}

/// Two flames one behind the other in the view that shows them largest, apart in others.
#[test]
fn lamps_that_some_views_show_apart_are_two() {
    let flame = |x: f32, length: f32| {
        let shape = Shape::Tube {
            centre: Vec3::new(x, 0.6, 1.0 + 0.5 * length),
            rotation: Quat::IDENTITY,
            radius: 0.035,
            length,
            taper: -0.4,
            is_open: false,
        };
        (shape, Vec3::new(70.0, 30.0, 7.0))
    };
    let lamps = [flame(-0.13, 0.6), flame(0.13, 0.45)];
    let eyes = [
        [1.1, 0.5, 1.2],
        [-0.5, -1.3, 1.3],
        [0.0, -1.4, 1.4],
        [0.5, -1.2, 1.3],
    ];
    let views = eyes.map(|eye: [f64; 3]| {
        let eye = DVec3::from(eye);
        let ahead = (DVec3::new(0.0, 0.6, 1.25) - eye).normalize();
        Camera::centred([120, 80], 1.3, Camera::level_pose(eye, ahead))
    });
    check_found(&lamps, found_by(&views, &lamps, &lamps), 0.15);
}

/// A bar that views show few pixels thick, and from one side alone, at `y`.
fn thin_bar(depth: f32, height: f32, y: f32) -> (Shape, Vec3) {
    let shape = Shape::Box {
        centre: Vec3::new(0.1, y, 2.1),
        rotation: Quat::IDENTITY,
        size: Vec3::new(0.9, depth, height),
    };
    (shape, Vec3::new(36.0, 34.0, 30.0))
}

/// Views of a thin bar.
fn from_one_side() -> [Camera; 4] {
    let offsets = [
        [-0.64, -1.58, -0.48],
        [-0.53, -2.13, -0.38],
        [-0.27, -2.32, -0.38],
        [0.13, -2.13, -0.48],
    ];
    offsets.map(|[x, y, z]: [f64; 3]| {
        let eye = DVec3::new(0.1, 1.8, 2.1) + DVec3::new(x, y, z);
        let ahead = DVec3::new(-0.6 * x, -y, 0.2).normalize();
        Camera::centred([240, 160], 1.3, Camera::level_pose(eye, ahead))
    })
}

/// Silhouettes say little of its depth, but views have to agree on its flux.
#[test]
fn a_thin_bar_has_the_depth_that_views_agree_on() {
    let lamps = [thin_bar(0.045, 0.015, 1.8)];
    check_found(&lamps, found_by(&from_one_side(), &lamps, &lamps), 0.06);
}

/// Silhouettes are nearly the same farther away, and those of a bar that is deeper and tilted.
#[test]
fn a_thin_bar_that_training_has_nearer_has_its_power() {
    let lamps = [thin_bar(0.05, 0.03, 1.8)];
    for trained in [1.74, 1.68].map(|y| [thin_bar(0.05, 0.03, y)]) {
        check_found(&lamps, found_by(&from_one_side(), &lamps, &trained), 0.12);
    }
}

/// A long bar has many pixels, and yet few across it.
#[test]
fn a_long_bar_that_views_show_from_above_is_no_tube() {
    let shape = Shape::Box {
        centre: Vec3::new(0.0, 1.3, 1.0),
        rotation: Quat::IDENTITY,
        size: Vec3::new(2.4, 0.02, 0.02),
    };
    let lamps = [(shape, Vec3::new(30.0, 22.0, 13.0))];
    let views = [-0.9, -0.4, 0.0, 0.5, 0.9].map(|x: f64| {
        let eye = DVec3::new(x, 0.2 - 0.2 * x.abs(), 1.7);
        let ahead = (DVec3::new(0.5 * x, 1.3, 1.0) - eye).normalize();
        Camera::centred([240, 160], 1.3, Camera::level_pose(eye, ahead))
    });
    let found = check_found(&lamps, found_by(&views, &lamps, &lamps), 0.08);
    assert_eq!(found[0].shape, LampShape::Box, "{found:#?}");
}

#[test]
fn bulbs_that_touch_in_photographs_are_as_many_as_there_are() {
    let at = [[0.0, 0.1, 2.1], [0.11, 0.1, 2.06], [0.05, 0.2, 2.12]];
    let bulbs = at.map(|at| bulb(at, 0.05));
    check(&bulbs[..2], 0.1);
    check(&bulbs, 0.1);
}

/// A bar of `length` along `axis` from `from`, 5 cm thick.
fn bar(from: [f32; 3], axis: Vec3, length: f32) -> (Shape, Vec3) {
    let shape = Shape::Tube {
        centre: Vec3::from(from) + axis * (0.5 * length),
        rotation: rotation::from_z_to(axis),
        radius: 0.025,
        length,
        taper: 0.0,
        is_open: false,
    };
    (shape, Vec3::new(30.0, 3.0, 12.0))
}

#[test]
fn a_bent_tube_is_its_pieces() {
    let long = bar([-0.3, 0.1, 2.1], Vec3::X, 0.8);
    let down = bar([0.5, 0.1, 2.1], Vec3::NEG_Z, 0.45);
    check(&[long, down], 0.1);
    let back = bar([-0.3, 0.1, 2.1], Vec3::Y, 0.5);
    check(&[long, down, back], 0.1);
}

#[test]
fn a_frame_is_four_bars() {
    let top = bar([-0.3, 0.1, 2.3], Vec3::X, 0.8);
    let low = bar([-0.3, 0.1, 1.8], Vec3::X, 0.8);
    let left = bar([-0.3, 0.1, 1.8], Vec3::Z, 0.5);
    let right = bar([0.5, 0.1, 1.8], Vec3::Z, 0.5);
    // The depth of a bar that is two pixels thick is not known well.
    check(&[top, low, left, right], 0.15);
}

/// A bulb right before a ceiling, of which masks show what it lights: as bright as a nearly white
/// ceiling is in its light, or three times as bright.
#[test]
fn a_surface_that_a_lamp_lights_is_no_lamp_of_its_own() {
    // The bulb sends a quarter of its 7.4 to the square: white would be 15.
    let bulb = bulb([0.1, 0.1, 2.43], 0.03);
    for (radiance, shape) in [(12.0, LampShape::Other), (40.0, LampShape::Panel)] {
        let lit = panel(0.1, [0.2, 0.2], Vec3::splat(radiance));
        let lamps = [bulb, lit];
        let found = found(&lamps, &lamps);
        let spot = found.iter().find(|lamp| lamp.radiance[0] < 100.0);
        assert_eq!(spot.map(|lamp| lamp.shape), Some(shape), "{found:#?}");
        assert_eq!(found.len(), 2, "{found:#?}");
    }
}
