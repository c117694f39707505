//! A lamp that one view shows is in the surface around it, if it may be; one that few show is where
//! their lines of sight meet.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

mod rig;

use eagpt_lamps::Kinds;
use eagpt_lamps::shape::{Flat, Shape};
use eagpt_scene::lamps::{Lamp, LampShape};
use eagpt_scene::{Camera, Gaussians, rotation};
use glam::{DVec3, Vec3};
use rig::{RADIANCE, cameras, find_in, heap, patch, photograph_all, room};

const CENTRE: Vec3 = Vec3::new(0.3, 0.1, 2.49);
const EYES: [DVec3; 2] = [DVec3::new(-1.2, -0.4, 1.0), DVec3::new(0.4, -1.5, 1.2)];

fn looking(eye: DVec3, target: DVec3) -> Camera {
    let pose = Camera::level_pose(eye, (target - eye).normalize());
    Camera::centred([120, 80], 1.3, pose)
}

/// Lamps of a room with `lamp`, which training has `trained`; cameras at `eyes` look at it, others
/// at the floor.
fn found(lamp: &Shape, trained: &Shape, eyes: &[DVec3]) -> Vec<Lamp> {
    let centre = lamp.centre().as_dvec3();
    let up: Vec<Camera> = eyes.iter().map(|eye| looking(*eye, centre)).collect();
    found_by(lamp, trained, &up)
}

/// As [`found`], with the cameras that see the lamp.
fn found_by(lamp: &Shape, trained: &Shape, up: &[Camera]) -> Vec<Lamp> {
    let scene: Gaussians = room().iter().chain(heap(trained, RADIANCE)).collect();
    found_in(&scene, &[*lamp], up)
}

/// Lamps of a trained `scene` of which photographs show `lamps`.
fn found_in(scene: &Gaussians, lamps: &[Shape], up: &[Camera]) -> Vec<Lamp> {
    found_behind(scene, lamps, &[], up)
}

/// As [`found_in`], with what `hides` the lamps.
fn found_behind(scene: &Gaussians, lamps: &[Shape], hides: &[Shape], up: &[Camera]) -> Vec<Lamp> {
    let lamps: Vec<(Shape, Vec3)> = lamps.iter().map(|lamp| (*lamp, RADIANCE)).collect();
    let down = cameras().into_iter().map(|camera| {
        let eye = camera.origin().as_dvec3();
        looking(eye, DVec3::new(-0.5 * eye.x, -0.5 * eye.y, 0.0))
    });
    let all = up.iter().copied().chain(down).enumerate();
    let photographs = all.map(|(i, camera)| photograph_all(i, camera, &lamps, hides));
    find_in(scene, Kinds::All, photographs).lamps.lamps
}

#[test]
fn a_panel_that_one_view_shows_is_flush_with_the_ceiling() {
    let size = [0.2, 0.15];
    let panel = Shape::Rectangle(Flat {
        centre: CENTRE,
        rotation: rotation::from_z_to(Vec3::NEG_Z),
        size,
    });
    let found = found(&panel, &panel, &EYES[..1]);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Panel);
    assert_eq!(lamp.views.len(), 1);
    assert!((lamp.world_from_lamp() * Vec3::Z).dot(Vec3::NEG_Z) > 0.99);
    assert!(lamp.centre().distance(CENTRE) < 0.02, "{lamp:?}");
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * size[0] * size[1]);
    assert!((share - 1.0).abs() < 0.05, "{share}");
}

fn ball(centre: Vec3) -> Shape {
    let radius = 0.08;
    Shape::Ball { centre, radius }
}

#[test]
fn a_ball_that_one_view_shows_may_be_anywhere() {
    // It hangs before the wall that the view has around it.
    let ball = ball(Vec3::new(0.3, 0.1, 1.6));
    let found = found(&ball, &ball, &EYES[..1]);
    assert!(found.iter().all(|lamp| lamp.shape == LampShape::Other));
}

/// Two views show one of the same size and radiance: it is as far away as it looks small.
#[test]
fn a_ball_that_one_view_shows_may_be_of_the_make_of_another() {
    let known = Vec3::new(0.3, 0.1, 1.6);
    let alone = Vec3::new(-1.7, 0.6, 1.7);
    let [a, b] = EYES.map(|eye| looking(eye, known.as_dvec3()));
    let eye = DVec3::new(-1.2, -0.6, 1.1);
    let up = [a, b, looking(eye, alone.as_dvec3())];
    // Training has it on the wall behind it.
    let trained = ball(Vec3::new(-1.96, 1.23, 2.02));
    let heaps = [ball(known), trained].map(|ball| heap(&ball, RADIANCE));
    let scene: Gaussians = room().iter().chain(heaps.concat()).collect();
    let found = found_in(&scene, &[ball(known), ball(alone)], &up);
    let balls = found.iter().filter(|lamp| lamp.shape == LampShape::Ball);
    let balls: Vec<&Lamp> = balls.collect();
    assert_eq!(balls.len(), 2, "{balls:#?}");
    for centre in [known, alone] {
        let is_there = |lamp: &&Lamp| lamp.centre().distance(centre) < 0.04;
        assert!(balls.iter().any(is_there), "{balls:#?}");
    }
}

#[test]
fn a_ball_that_two_views_show_is_where_their_lines_of_sight_meet() {
    let centre = Vec3::new(0.3, 0.1, 1.6);
    // Training has it too far away for both.
    let trained = ball(centre + Vec3::new(0.05, 0.2, 0.06));
    let found = found(&ball(centre), &trained, &EYES);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Ball);
    assert!(lamp.centre().distance(centre) < 0.01, "{lamp:?}");
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * ball(centre).area());
    assert!((share - 1.0).abs() < 0.05, "{share}");
}

#[test]
fn a_ball_that_the_edge_of_a_picture_cuts_has_its_middle_in_line() {
    let centre = Vec3::new(0.3, 0.1, 1.6);
    let trained = ball(centre + Vec3::new(0.05, 0.2, 0.06));
    let whole = looking(EYES[0], centre.as_dvec3());
    // Two thirds of its height are below the upper edge, 26° above the middle.
    let away = centre.as_dvec3() - EYES[1];
    let level = DVec3::new(away.x, away.y, 0.0);
    let down = away.z.atan2(level.length()) - 0.456;
    let cut = looking(
        EYES[1],
        EYES[1] + level + DVec3::Z * (level.length() * down.tan()),
    );
    let found = found_by(&ball(centre), &trained, &[whole, cut]);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Ball);
    assert_eq!(lamp.views.len(), 2);
    assert!(lamp.centre().distance(centre) < 0.02, "{lamp:?}");
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * ball(centre).area());
    assert!((share - 1.0).abs() < 0.08, "{share}");
}

/// Training lacks three balls in a row, and has in one place of the walls behind them what views
/// have of different ones.
#[test]
fn balls_are_told_apart_that_views_have_in_one_place_of_a_wall() {
    let radius = 0.035;
    let centres = [0.54, 0.84, 1.14].map(|x| Vec3::new(x, -1.27, 1.4));
    let balls = centres.map(|centre| Shape::Ball { centre, radius });
    let eyes = [
        DVec3::new(0.22, -0.08, 1.2),
        DVec3::new(-0.2, -0.11, 1.2),
        DVec3::new(-0.39, -0.18, 1.32),
        DVec3::new(-0.59, -0.42, 1.32),
    ];
    let up = eyes.map(|eye| looking(eye, DVec3::new(0.84, -1.27, 1.4)));
    let found = found_in(&room(), &balls, &up);
    assert_eq!(found.len(), 3, "{found:?}");
    for centre in centres {
        let is_there =
            |lamp: &Lamp| lamp.shape == LampShape::Ball && lamp.centre().distance(centre) < 0.02;
        assert!(found.iter().any(is_there), "{found:?}");
    }
}

/// Lines of sight to what a mirror shows meet behind it.
#[test]
fn a_ball_behind_a_wall_is_no_lamp() {
    let centre = Vec3::new(4.5, 0.2, 1.3);
    let radius = 0.15;
    let eyes = [
        DVec3::new(-1.2, -0.4, 1.0),
        DVec3::new(-0.9, 1.2, 1.2),
        DVec3::new(-0.5, -1.3, 1.4),
        DVec3::new(-1.3, 0.5, 1.1),
    ];
    let up = eyes.map(|eye| looking(eye, centre.as_dvec3()));
    let found = found_in(&room(), &[Shape::Ball { centre, radius }], &up);
    let clean = found.iter().filter(|lamp| lamp.shape != LampShape::Other);
    assert_eq!(clean.count(), 0, "{found:?}");
}

/// Cameras near a window show parts of it, and have its middle far beside their axes.
#[test]
fn a_wide_panel_may_be_seen_from_beside_it() {
    let size = [1.8, 1.0];
    let panel = Shape::Rectangle(Flat {
        centre: Vec3::new(0.0, 1.98, 1.2),
        rotation: rotation::from_z_to(Vec3::NEG_Y),
        size,
    });
    let near = [-1.0, 1.0].iter().flat_map(|side| {
        [0.3, 0.25, 0.35].map(|x| {
            let eye = DVec3::new(side * x, 1.2, 1.2);
            looking(eye, eye + DVec3::new(side * 0.8, 0.6, 0.0))
        })
    });
    let far = [DVec3::new(-0.8, -1.2, 1.1), DVec3::new(0.7, -1.0, 1.3)];
    let far = far.map(|eye| looking(eye, DVec3::new(0.0, 1.98, 1.2)));
    let up: Vec<Camera> = near.chain(far).collect();
    let found = found_by(&panel, &panel, &up);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Panel);
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * size[0] * size[1]);
    assert!((share - 1.0).abs() < 0.05, "{share}");
}

/// A panel in the ceiling of which one view shows the left end and others the right one, where
/// training has it a little lower.
#[test]
fn pieces_of_a_panel_that_pictures_cut_are_one_lamp() {
    let at = |x: f32, z: f32, width: f32| {
        Shape::Rectangle(Flat {
            centre: Vec3::new(x, 0.1, z),
            rotation: rotation::from_z_to(Vec3::NEG_Z),
            size: [width, 0.6],
        })
    };
    let panel = at(0.0, 2.49, 1.2);
    let heaps = [at(-0.3, 2.49, 0.6), at(0.3, 2.43, 0.6)];
    let heaps = heaps.map(|piece| heap(&piece, RADIANCE)).concat();
    let scene: Gaussians = room().iter().chain(heaps).collect();
    let looking_at = |eye: [f64; 3], target: [f64; 3]| looking(eye.into(), target.into());
    let up = [
        looking_at([-0.5, -1.2, 1.0], [-1.2, 0.2, 1.9]),
        looking_at([0.5, -1.2, 1.0], [1.2, 0.2, 1.9]),
        looking_at([0.6, 1.3, 1.2], [1.3, 0.1, 2.0]),
    ];
    let found = found_in(&scene, &[panel], &up);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.views.len(), 3);
    assert!((lamp.size[0] / 1.2 - 1.0).abs() < 0.02, "{lamp:?}");
    // The scene is nearer than the panel where it has the right end.
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * panel.area());
    assert!((0.87..1.02).contains(&share), "{share}");
}

/// The half of a ball that stands out of a wall, whose discs bulge over its edge.
#[test]
fn a_dome_is_the_ball_that_its_wall_hides_half_of() {
    let dome = Shape::Ball {
        centre: Vec3::new(0.1, 2.0, 1.4),
        radius: 0.13,
    };
    let eyes = [
        DVec3::new(-1.2, 0.4, 1.1),
        DVec3::new(0.2, -0.8, 1.3),
        DVec3::new(1.6, 1.4, 1.2),
        DVec3::new(-1.5, 1.5, 1.5),
    ];
    let up = eyes.map(|eye| looking(eye, DVec3::new(0.1, 2.0, 1.4)));
    let centre = Vec3::new(0.1, 1.98, 1.4);
    let bulge = patch(
        centre - Vec3::new(0.2, 0.0, 0.2),
        [Vec3::X * 0.4, Vec3::Z * 0.4],
        None,
    );
    let lamp = heap(&dome, RADIANCE).into_iter().chain(bulge.iter());
    let scene: Gaussians = room().iter().chain(lamp).collect();
    let wall = Shape::Rectangle(Flat {
        centre: Vec3::new(0.0, 2.0, 1.25),
        rotation: rotation::from_z_to(Vec3::NEG_Y),
        size: [4.0, 4.0],
    });
    let found = found_behind(&scene, &[dome], &[wall], &up);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Ball, "{lamp:?}");
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * dome.area());
    assert!((share - 1.0).abs() < 0.08, "{share}");
}

/// A drum as flat as a dome, about the normal of its wall.
#[test]
fn a_flat_drum_on_a_wall_is_no_ball() {
    let drum = Shape::Tube {
        centre: Vec3::new(0.1, 1.96, 1.4),
        rotation: rotation::from_z_to(Vec3::NEG_Y),
        radius: 0.13,
        length: 0.07,
        taper: 0.0,
        is_open: false,
    };
    let eyes = [
        DVec3::new(-1.2, 0.4, 1.1),
        DVec3::new(0.2, -0.8, 1.3),
        DVec3::new(1.4, 0.9, 1.2),
        DVec3::new(0.9, -0.2, 1.5),
    ];
    let found = found(&drum, &drum, &eyes);
    let [lamp] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert_eq!(lamp.shape, LampShape::Tube, "{lamp:?}");
    let share = lamp.power[0] / (RADIANCE.x * std::f32::consts::PI * drum.area());
    assert!((share - 1.0).abs() < 0.1, "{share}");
}
