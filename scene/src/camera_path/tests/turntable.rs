//! Turns about a point.

use super::super::*;
use super::{camera, dataset_of, path_of, position, views};
use crate::camera::Camera;
use crate::dataset::UpAxis;
use crate::testing::assert_error;
use glam::DVec3;

#[test]
fn a_turntable_keeps_its_distance_and_looks_at_its_point() {
    let text = "frames = 36\n[turntable]\ncentre = [1, 2, 0.5]\nradius = 2\nheight = 0.75\n";
    for (more, target) in [
        ("", DVec3::new(1.0, 2.0, 0.5)),
        ("look_at = [1, 2, 1.5]\n", DVec3::new(1.0, 2.0, 1.5)),
    ] {
        let path = path_of(&format!("{text}{more}")).unwrap();
        for camera in &path.cameras {
            let offset = position(camera) - DVec3::new(1.0, 2.0, 0.5);
            assert!((offset.truncate().length() - 2.0).abs() < 1e-12);
            assert!((offset.z - 0.75).abs() < 1e-12);
            // The image of the point is the principal point, and the image of up points up.
            let seen = camera.project(target.as_vec3());
            assert!(
                (seen.x - 19.0).abs() < 1e-4 && (seen.y - 16.0).abs() < 1e-4,
                "{seen}"
            );
            assert!(camera.project((target + DVec3::Z * 0.1).as_vec3()).y < seen.y);
        }
        // The whole turn ends a step before its start; seen from above it goes counter-clockwise.
        let step = position(&path.cameras[0]).distance(position(&path.cameras[1]));
        let seam = position(&path.cameras[35]).distance(position(&path.cameras[0]));
        assert!((step - seam).abs() < 1e-9);
        let [a, b] = [0, 1].map(|i| position(&path.cameras[i]) - DVec3::new(1.0, 2.0, 0.0));
        assert!(a.cross(b).z > 0.0);
    }
    let quarter = path_of(&format!("{text}start = 90\ndegrees = -90\n")).unwrap();
    let last = position(&quarter.cameras[35]) - DVec3::new(1.0, 2.0, 0.5);
    // An arc ends at its end: here at 0 degrees, where the first view is.
    let first_view = position(&views()[0]) - DVec3::new(1.0, 2.0, 0.5);
    assert!(
        last.truncate()
            .normalize()
            .distance(first_view.truncate().normalize())
            < 1e-12
    );
}

#[test]
fn a_turntable_finds_what_the_cameras_look_at() {
    let target = DVec3::new(0.3, -0.2, 0.8);
    let stand = |angle: f64, radius: f64| {
        let table = Turntable {
            centre: target,
            radius,
            height: 0.5,
            look_at: target,
            up: UpAxis::Z,
            zero: DVec3::X,
            start: angle,
            degrees: 0.0,
        };
        table.camera(&camera(DVec3::ZERO, DVec3::ZERO, 35.0), 0.0)
    };
    let found = |cameras: &[Camera]| {
        let (_dir, dataset) = dataset_of(cameras);
        let path = CameraPath::read("turntable", &dataset, &PathOverrides::default()).unwrap();
        let Route::Turntable(table) = path.route else {
            panic!("{:?}", path.route);
        };
        assert!(table.centre.distance(target) < 1e-9, "{table:?}");
        assert!((table.height - 0.5).abs() < 1e-9);
        table.radius
    };
    // At the corners of a square of half-diagonal 2, one of them further out: the circle within has
    // radius √2.
    let square = [(0.0, 2.0), (90.0, 2.0), (180.0, 2.0), (270.0, 3.0)];
    let radius = found(&square.map(|(angle, radius)| stand(angle, radius)));
    assert!((radius - 2.0_f64.sqrt()).abs() < 1e-3, "{radius}");
    // All on one side there is none: their mean distance.
    let cameras = [stand(20.0, 1.0), stand(60.0, 2.0), stand(100.0, 3.0)];
    let radius = found(&cameras);
    assert!((radius - 2.0).abs() < 1e-9, "{radius}");
    let (_dir, parallel) = dataset_of(&[cameras[0], cameras[0]]);
    let outcome = CameraPath::read("turntable", &parallel, &PathOverrides::default());
    assert_error(
        outcome,
        &["transforms.json", "turntable", "`centre` is needed"],
    );
}
