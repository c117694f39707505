//! Files of camera paths, and what is refused in them.

use super::super::*;
use super::{dataset, named, path_of, position, shorthand};
use crate::testing::assert_error;
use glam::DVec3;

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
