//! Tests of camera paths: what curves keep, what files say, what is refused.

use super::fly::Fly;
use super::rotation::{RotationSegment, step};
use super::*;
use crate::camera::Camera;
use crate::dataset::{DatasetInfo, TRANSFORMS_FILE, UpAxis, write_transforms};
use crate::testing::assert_error;
use glam::{DAffine3, DQuat, DVec3};

fn camera(position: DVec3, turn: DVec3, fx: f64) -> Camera {
    Camera {
        width: 40,
        height: 30,
        fx,
        fy: 1.1 * fx,
        cx: 19.0,
        cy: 16.0,
        world_from_camera: DAffine3::from_rotation_translation(
            DQuat::from_scaled_axis(turn),
            position,
        ),
    }
}

/// Five views at uneven distances, turned unevenly; the last has other intrinsics.
fn views() -> Vec<Camera> {
    let v = DVec3::new;
    vec![
        camera(v(0.0, 0.0, 1.0), v(0.0, 0.0, 0.0), 35.0),
        camera(v(2.0, 0.3, 1.2), v(0.3, 0.9, -0.2), 35.0),
        camera(v(2.2, 0.9, 1.1), v(0.2, 1.6, 0.1), 35.0),
        camera(v(1.0, 3.0, 1.5), v(-0.4, 2.6, 0.3), 35.0),
        camera(v(-1.5, 2.0, 0.9), v(-0.2, -2.4, 0.4), 60.0),
    ]
}

/// A dataset of cameras alone, in a folder that lives as long as the test.
fn dataset_of(cameras: &[Camera]) -> (tempfile::TempDir, Dataset) {
    let dir = tempfile::tempdir().unwrap();
    let named: Vec<_> = (0..)
        .map(|i| format!("v{i}"))
        .zip(cameras.to_vec())
        .collect();
    let info = DatasetInfo {
        up_axis: Some(UpAxis::Z),
        ..DatasetInfo::default()
    };
    write_transforms(&dir.path().join(TRANSFORMS_FILE), &named, &info).unwrap();
    let dataset = Dataset::open_cameras(dir.path()).unwrap();
    (dir, dataset)
}

fn dataset() -> (tempfile::TempDir, Dataset) {
    dataset_of(&views())
}

fn path_of(text: &str) -> Result<CameraPath> {
    named("path.toml", text)
}

fn named(name: &str, text: &str) -> Result<CameraPath> {
    let (dir, dataset) = dataset();
    let file = dir.path().join(name);
    std::fs::write(&file, text).unwrap();
    CameraPath::read(file.to_str().unwrap(), &dataset, &PathOverrides::default())
}

fn shorthand(argument: &str) -> Result<CameraPath> {
    let (_dir, dataset) = dataset();
    CameraPath::read(argument, &dataset, &PathOverrides::default())
}

fn position(camera: &Camera) -> DVec3 {
    camera.world_from_camera.translation
}

fn turn(camera: &Camera) -> DQuat {
    DQuat::from_mat3(&camera.world_from_camera.matrix3)
}

/// Angle between two rotations, radians.
fn angle(a: &Camera, b: &Camera) -> f64 {
    step(turn(a), turn(b)).length()
}

#[track_caller]
fn assert_same(found: &Camera, wanted: &Camera) {
    assert!(
        position(found).distance(position(wanted)) < 1e-12 && angle(found, wanted) < 1e-7,
        "{found:?}\n{wanted:?}"
    );
    let lens = |c: &Camera| [c.fx, c.fy, c.cx, c.cy];
    for (found, wanted) in lens(found).into_iter().zip(lens(wanted)) {
        assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
    }
}

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

#[test]
fn files_say_what_shorthands_leave_open() {
    let path = path_of(
        "seconds = 0.5\nfps = 30\nsize = [64, 48]\nfov_y = 90\nease = true\n\
         [fly]\nviews = [\"v3\", \"v4\"]\npace = \"views\"\n",
    )
    .unwrap();
    assert_eq!(
        (path.cameras.len(), path.fps, path.size()),
        (15, 30.0, (64, 48))
    );
    assert!(path.file.is_some());
    for camera in &path.cameras {
        // Half of 48 pixels over tan 45°.
        assert!((camera.fy - 24.0).abs() < 1e-12, "{}", camera.fy);
        assert!((camera.fx - 24.0 / 1.1).abs() < 1e-12, "{}", camera.fx);
    }
    let speed = |i: usize| position(&path.cameras[i]).distance(position(&path.cameras[i + 1]));
    assert!(speed(0) < 0.3 * speed(7) && speed(13) < 0.3 * speed(7));
    // Overrides go before the file.
    let (dir, dataset) = dataset();
    let file = dir.path().join("a.toml");
    std::fs::write(&file, "frames = 7\n[turntable]\ncentre = [0, 1, 0]\n").unwrap();
    let overrides = PathOverrides {
        num_frames: Some(3),
        size: Some((10, 20)),
    };
    let path = CameraPath::read(file.to_str().unwrap(), &dataset, &overrides).unwrap();
    assert_eq!((path.cameras.len(), path.size()), (3, (10, 20)));
}

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

#[test]
fn paths_of_nerfstudio_are_read() {
    let frame = |x: f64| {
        format!(
            "{{\"camera_to_world\": [1,0,0,{x}, 0,0,-1,0, 0,1,0,0, 0,0,0,1], \"fov\": 90, \"aspect\": 2}}"
        )
    };
    let text = |frames: &str, more: &str| {
        format!(
            "{{\"camera_type\": \"perspective\", {more} \"fps\": 12, \"seconds\": 1, \"keyframes\": [], \"camera_path\": [{frames}]}}"
        )
    };
    let size = "\"render_width\": 40, \"render_height\": 20.0,";
    let frames = format!("{}, {}", frame(0.0), frame(3.0));
    let path = named("a.json", &text(&frames, size)).unwrap();
    assert_eq!(
        (path.cameras.len(), path.fps, path.size()),
        (2, 12.0, (40, 20))
    );
    let [_, second] = path.cameras[..] else {
        panic!()
    };
    assert_eq!(position(&second), DVec3::X * 3.0);
    // OpenGL axes with y as the world's z: it looks along +y.
    assert!(second.forward().distance(glam::Vec3::Y) < 1e-6);
    assert!((second.fx - 10.0).abs() < 1e-12 && second.cx == 20.0);
    for (text, parts) in [
        (text(&frames, ""), ["render_width", "missing"]),
        (text("", size), ["camera_path", "empty"]),
        (text("3", size), ["camera_path[0]", "not an object"]),
        (
            text(&frame(0.0).replace("90", "180"), size),
            ["camera_path[0].fov", "180"],
        ),
        (
            text(&frame(0.0).replace("0,0,-1,0,", ""), size),
            ["camera_path[0].camera_to_world", "12"],
        ),
        (
            text(&frame(0.0).replace("[1,", "[2,"), size),
            ["camera_path[0].camera_to_world", "not a rotation"],
        ),
        (
            text(&frames, size).replace("perspective", "fisheye"),
            ["camera_type", "fisheye"],
        ),
        ("{".to_owned(), ["JSON", "EOF"]),
    ] {
        assert_error(
            named("a.json", &text),
            &[&["a.json"], parts.as_slice()].concat(),
        );
    }
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    let fly = "[fly]\nviews = [\"v0\", \"v1\"]\n";
    for (text, parts) in [
        (format!("frames = 0\n{fly}"), ["line 1: frames", "0"]),
        (format!("frames = 1.5\n{fly}"), ["line 1: frames", "1.5"]),
        (
            format!("frames = 9\nseconds = 2\n{fly}"),
            ["line 2: seconds", "not both"],
        ),
        (format!("seconds = -1\n{fly}"), ["line 1: seconds", "-1"]),
        (format!("fps = 0\n{fly}"), ["line 1: fps", "0"]),
        (
            format!("size = [64]\n{fly}"),
            ["line 1: size", "1 values, not 2"],
        ),
        (format!("size = [64, 0]\n{fly}"), ["line 1: size[1]", "0"]),
        (format!("fov_y = 180\n{fly}"), ["line 1: fov_y", "180"]),
        (format!("ease = 1\n{fly}"), ["line 1: ease", "integer"]),
        (
            format!("speed = 1\n{fly}"),
            ["line 1: speed", "unknown field"],
        ),
        (
            format!("{fly}loop = true\n"),
            ["line 3: fly.loop", "unknown field"],
        ),
        (
            format!("{fly}pace = \"fast\"\n"),
            ["line 3: fly.pace", "`fast`"],
        ),
        (
            format!("{fly}[turntable]\n"),
            ["line 3: turntable", "one too many"],
        ),
        ("frames = 9\n".to_owned(), ["(top level)", "fly, turntable"]),
        (
            "[fly]\nviews = [\"v0\",\n\"v9\"]\n".to_owned(),
            [
                "line 3: fly.views[1]",
                "`v9`; the 5 views are called like `v0`",
            ],
        ),
        (
            "[fly]\nviews = [\"v0\"]\n".to_owned(),
            ["line 2: fly.views", "2 views or more, not 1"],
        ),
        (
            "[fly]\nviews = [\"v0\", \"v0\"]\n".to_owned(),
            ["line 2: fly.views", "same place"],
        ),
        (
            "[turntable]\nradius = -2\n".to_owned(),
            ["line 2: turntable.radius", "-2"],
        ),
        (
            "[turntable]\nup = \"w\"\n".to_owned(),
            ["line 2: turntable.up", "`w`"],
        ),
        (
            "[turntable]\ncentre = [1, nan, 2]\n".to_owned(),
            ["line 2: turntable.centre[1]", "NaN"],
        ),
        (
            "[turntable]\nradius = 1\ncentre = [0, 0, 0]\nlook_at = [1, 0, 0]\n".to_owned(),
            ["line 1: turntable", "along the axis"],
        ),
        ("frames = = 3\n".to_owned(), ["line 1", "TOML"]),
    ] {
        assert_error(path_of(&text), &[&["path.toml"], parts.as_slice()].concat());
    }
    assert_error(
        shorthand("fly:v0,x"),
        &["transforms.json", "fly:v0,x", "`x`"],
    );
    assert_error(shorthand("fly:"), &["transforms.json", "fly:", "``"]);
    assert_error(shorthand("none.toml"), &["none.toml: no such file"]);
}
