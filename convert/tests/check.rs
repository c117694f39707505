//! Findings about the room, whole and broken.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use eagpt_convert::check::{ImageKind, check};
use eagpt_scene::dataset::{SplitRule, UpAxis};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Image, files};
use eagpt_testkit::room::{self, RoomOptions};
use serde_json::Value;
use std::path::Path;

fn room(root: &Path) {
    let options = RoomOptions {
        num_views: 9,
        width: 36,
        height: 24,
        num_samples: 1,
        num_points: 500,
        seed: 3,
    };
    room::write(root, &options, |_| ()).unwrap();
}

fn edit(root: &Path, edit: impl FnOnce(&mut Value)) {
    let path = root.join("transforms.json");
    let mut value: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    edit(&mut value);
    std::fs::write(&path, value.to_string()).unwrap();
}

#[test]
fn a_sound_dataset() {
    let dir = tempfile::tempdir().unwrap();
    room(dir.path());
    let report = check(dir.path(), &mut |_| ()).unwrap();
    assert!(
        report.is_sound() && report.warnings.is_empty(),
        "{}",
        report.text()
    );
    let kind = |kind| report.kinds.iter().find(|k| k.kind == kind).unwrap();
    assert_eq!(kind(ImageKind::Normal).num_present, 9);
    assert_eq!(kind(ImageKind::Normal).coverage, Some(1.0));
    assert_eq!(kind(ImageKind::Alpha).num_present, 0);
    let radiance = kind(ImageKind::Radiance).values.unwrap();
    // The light of the room is 12, 11, 9.
    assert_eq!((radiance.max, radiance.min >= 0.0), (12.0, true));
    assert!(report.cameras.up_angle_deg.unwrap() < 30.0);
    assert_eq!(report.points.as_ref().unwrap().num, 500);
    let ratio = report.depth_over_points.unwrap();
    // Pixels a twentieth of a metre wide on walls that are seen aslant.
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    for view in &report.views {
        assert_eq!(view.normals_facing, Some(1.0), "{}", view.name);
        // Half-precision depths, and edges that look smooth.
        assert!(view.normal_from_depth_deg.unwrap() < 2.0, "{view:?}");
    }
    let every_8th = report.splits.iter().find(|s| s.rule == SplitRule::Every8th);
    let every_8th = every_8th.unwrap();
    assert_eq!(
        (
            every_8th.num_train,
            every_8th.num_test,
            every_8th.num_shared
        ),
        (7, 2, 0)
    );
    let text = report.text();
    assert!(
        text.contains("9 views; up axis z; scene unit 1 m"),
        "{text}"
    );
    assert!(text.contains("no errors, 0 warnings"), "{text}");
}

#[test]
fn everything_broken_is_told_at_once() {
    let dir = tempfile::tempdir().unwrap();
    room(dir.path());
    let image = |name: &str| dir.path().join(name);
    let mut bad = exr::read_rgb(&image("Radiance-exr/001.exr")).unwrap();
    bad.pixels_mut()[40] = [f32::NAN, -1.0, 0.0];
    bad.pixels_mut()[41] = [0.0, -2.0, 0.0];
    exr::write_rgb(&image("Radiance-exr/001.exr"), &bad, Precision::Float).unwrap();
    files::remove_if_there(&image("Radiance-exr/002.exr")).unwrap();
    std::fs::write(image("Emissive-exr/003.exr"), b"no image").unwrap();
    let small = Image::filled(3, 2, [1.0]);
    exr::write_single(&image("Depth-exr/004.exr"), &small, Precision::Half).unwrap();
    files::remove_if_there(&image("Normal-exr/005.exr")).unwrap();
    edit(dir.path(), |value| {
        value["frames"][6]["transform_matrix"][0][0] = 5.into();
        value["frames"][8]["transform_matrix"] = value["frames"][7]["transform_matrix"].clone();
        value["up_axis"] = "y".into();
        // Test views that are trained on.
        value["train_filenames"] = serde_json::json!(["000", "003"]);
        value["test_filenames"] = serde_json::json!(["003"]);
    });
    let report = check(dir.path(), &mut |_| ()).unwrap();
    assert!(!report.is_sound());
    let found = |view: &str, part: &str| {
        report
            .problems
            .iter()
            .any(|p| p.view == view && p.problem.contains(part))
    };
    for (view, part) in [
        ("001", "pixel (4, 1) channel R: NaN is not finite; 1 of 864"),
        ("001", "pixel (4, 1) channel G: -1.0 is negative; 2 of 864"),
        ("002", "no image"),
        ("003", "Emissive-exr"),
        ("004", "3x2, but the radiance is 36x24"),
        ("006", "not a rotation"),
    ] {
        assert!(found(view, part), "{view} {part}: {:?}", report.problems);
    }
    assert_eq!(report.problems.len(), 6, "{:?}", report.problems);
    for part in [
        "up may be z",
        "1 pairs of views have one pose, 007 and 008",
        "1 of 7 views have no normal",
        "split listed: 1 of 1 test views are trained on",
    ] {
        let told = report.warnings.iter().any(|text| text.contains(part));
        assert!(told, "no `{part}` in {:?}", report.warnings);
    }
    assert_eq!(report.cameras.most_upright, Some(UpAxis::Z));
    assert_eq!(report.views[1].num_negative, 2);
}

#[test]
fn units_and_axes_that_do_not_fit_are_warned_of() {
    let dir = tempfile::tempdir().unwrap();
    room(dir.path());
    for index in 0..9 {
        let depth = dir.path().join(format!("Depth-exr/{index:03}.exr"));
        let millimetres = exr::read_single(&depth).unwrap().map(|[d]| [1000.0 * d]);
        exr::write_single(&depth, &millimetres, Precision::Float).unwrap();
        let normal = dir.path().join(format!("Normal-exr/{index:03}.exr"));
        let flipped = exr::read_rgb(&normal)
            .unwrap()
            .map(|[x, y, z]| [-x, -y, -z]);
        exr::write_rgb(&normal, &flipped, Precision::Half).unwrap();
    }
    let report = check(dir.path(), &mut |_| ()).unwrap();
    assert!(report.is_sound());
    for part in ["another unit", "turned away", "do not fit the depths"] {
        let told = report.warnings.iter().any(|text| text.contains(part));
        assert!(told, "no `{part}` in {:?}", report.warnings);
    }
}
