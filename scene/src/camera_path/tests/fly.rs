//! Flights along views.

use super::super::fly::Fly;
use super::super::rotation::{RotationSegment, step};
use super::super::*;
use super::{angle, assert_same, position, shorthand, views};
use crate::camera::Camera;
use glam::{DQuat, DVec3};

#[test]
fn a_flight_passes_through_its_views() {
    let views = views();
    for closed in [false, true] {
        let fly = Fly::new(&views, closed, Pace::Views).unwrap();
        let num_legs = views.len() - usize::from(!closed);
        for (i, view) in views.iter().enumerate() {
            assert_same(&fly.camera(i as f64 / num_legs as f64), view);
        }
        assert_same(&fly.camera(1.0), &views[if closed { 0 } else { 4 }]);
        // At a constant speed the times are others, the places are the same.
        let even = Fly::new(&views, closed, Pace::Even).unwrap();
        for view in &views {
            let nearest = (0..=20_000)
                .map(|i| position(&even.camera(f64::from(i) / 20_000.0)).distance(position(view)))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-3, "{nearest}");
        }
    }
}

#[test]
fn an_even_pace_is_even_and_both_paces_are_smooth() {
    const NUM: usize = 2000;
    for (pace, closed) in [
        (Pace::Even, false),
        (Pace::Even, true),
        (Pace::Views, false),
        (Pace::Views, true),
    ] {
        let fly = Fly::new(&views(), closed, pace).unwrap();
        let frames: Vec<Camera> = (0..=NUM)
            .map(|i| fly.camera(i as f64 / NUM as f64))
            .collect();
        let steps: Vec<DVec3> = frames
            .windows(2)
            .map(|w| position(&w[1]) - position(&w[0]))
            .collect();
        let mean = steps.iter().map(|step| step.length()).sum::<f64>() / NUM as f64;
        let turns: Vec<f64> = frames.windows(2).map(|w| angle(&w[0], &w[1])).collect();
        let mean_turn = turns.iter().sum::<f64>() / NUM as f64;
        for (pair, turn) in steps.windows(2).zip(turns.windows(2)) {
            if pace == Pace::Even {
                // Chords against arcs, and uneven speed within a chord of the table.
                let ratio = pair[0].length() / mean;
                assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
            }
            // No step differs from the last by more than a curve of this tightness makes it; a kink
            // would by a good part of 1.
            assert!(pair[0].distance(pair[1]) < 0.1 * mean, "{pace:?} {closed}");
            assert!(
                (turn[0] - turn[1]).abs() < 0.1 * mean_turn,
                "{pace:?} {closed}"
            );
        }
        if closed {
            let seam = steps[NUM - 1].distance(steps[0]);
            assert!(seam < 0.1 * mean, "{seam} {mean}");
        }
    }
}

#[test]
fn rotations_are_unit_and_take_the_shorter_way() {
    let ends = [DQuat::from_rotation_z(3.0), DQuat::from_rotation_z(-3.0)];
    // From 172 to −172 degrees: 16 degrees over the back, not 344 over the front; whatever the sign
    // of the quaternion.
    let short = std::f64::consts::TAU - 6.0;
    for end in [ends[1], -ends[1]] {
        let across = step(ends[0], end);
        assert!((across - DVec3::Z * short).length() < 1e-12, "{across}");
        let segment = RotationSegment::new([ends[0], end], [across; 2]);
        for i in 0..=100 {
            let s = f64::from(i) / 100.0;
            let rotation = segment.at(s);
            assert!((rotation.length() - 1.0).abs() < 1e-12);
            let turned = step(ends[0], rotation);
            assert!((turned - across * s).length() < 1e-12, "{turned} at {s}");
        }
    }
    let fly = Fly::new(&views(), true, Pace::Even).unwrap();
    for i in 0..500 {
        let m = fly.camera(f64::from(i) / 500.0).world_from_camera.matrix3;
        let off = (m.transpose() * m - glam::DMat3::IDENTITY).to_cols_array();
        assert!(off.iter().all(|v| v.abs() < 1e-12) && m.determinant() > 0.0);
    }
}

#[test]
fn a_camera_may_turn_in_place_if_every_leg_takes_its_time() {
    let mut views = views();
    views[1].world_from_camera.translation = position(&views[0]);
    let problem = Fly::new(&views, false, Pace::Even).unwrap_err();
    assert!(problem.contains("views[0] and views[1]"), "{problem}");
    let fly = Fly::new(&views, false, Pace::Views).unwrap();
    let [quarter, half] = [0.125, 0.25].map(|time| fly.camera(time));
    assert!(position(&quarter).distance(position(&views[0])) < 0.02);
    assert!(angle(&views[0], &quarter) > 0.2 && angle(&quarter, &half) > 0.2);
}

#[test]
fn a_closed_path_ends_one_step_before_its_start() {
    let open = shorthand("fly:v0,v1,v2").unwrap();
    let (views, num) = (views(), open.cameras.len());
    assert_eq!((num, open.fps, open.size()), (120, 24.0, (40, 30)));
    assert_same(&open.cameras[0], &views[0]);
    assert_same(&open.cameras[num - 1], &views[2]);
    let closed = shorthand("fly:v0,v1,v2,v0").unwrap();
    assert!(matches!(&closed.route, Route::Fly { views, closed: true, .. } if views.len() == 3));
    let first = position(&closed.cameras[0]).distance(position(&closed.cameras[1]));
    let last = position(&closed.cameras[num - 1]).distance(position(&closed.cameras[0]));
    assert_same(&closed.cameras[0], &views[0]);
    assert!((first - last).abs() < 0.01 * first, "{first} {last}");
}
