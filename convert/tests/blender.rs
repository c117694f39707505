//! Blender scenes as NeRF has them: a file of cameras and a folder of pictures for each subset.
//!
//! Cameras are those of a turntable, written down here; pictures have one colour each.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use eagpt_convert::import::{ImportOptions, Ldr};
use eagpt_convert::{SourceDataset, SourceFormat, import};
use eagpt_scene::Dataset;
use eagpt_scene::dataset::SplitRule;
use glam::DVec3;
use image::{Rgba, RgbaImage};
use serde_json::{Value, json};
use std::path::Path;

const SIZE: u32 = 8;

/// A camera at `angle`, two units from the z axis, that looks at it. Columns are right, up and
/// back.
fn pose(angle: f64) -> Value {
    let (sin, cos) = angle.sin_cos();
    json!([
        [-sin, 0.0, cos, 2.0 * cos],
        [cos, 0.0, sin, 2.0 * sin],
        [0.0, 1.0, 0.0, 0.5],
        [0.0, 0.0, 0.0, 1.0]
    ])
}

fn write_json(path: &Path, value: &Value) {
    std::fs::write(path, serde_json::to_vec_pretty(value).unwrap()).unwrap();
}

/// A subset of `num` views, whose pictures are `grey` and half of them covered.
fn subset(root: &Path, name: &str, num: usize, grey: u8) {
    std::fs::create_dir_all(root.join(name)).unwrap();
    let mut frames = Vec::new();
    for index in 0..num {
        let picture = RgbaImage::from_fn(SIZE, SIZE, |x, _| {
            Rgba([grey, grey, grey, if x < SIZE / 2 { 255 } else { 0 }])
        });
        let path = format!("./{name}/r_{index}");
        picture.save(root.join(format!("{path}.png"))).unwrap();
        frames.push(json!({
            "file_path": path,
            "rotation": 0.0125,
            "transform_matrix": pose(index as f64 + f64::from(grey)),
        }));
    }
    let file = json!({"camera_angle_x": 0.6911112070083618, "frames": frames});
    write_json(&root.join(format!("transforms_{name}.json")), &file);
}

fn lego(root: &Path) {
    subset(root, "train", 3, 100);
    subset(root, "val", 1, 150);
    subset(root, "test", 2, 200);
}

fn options() -> ImportOptions {
    ImportOptions {
        ldr: Ldr::Srgb,
        ..ImportOptions::default()
    }
}

fn open(root: &Path) -> SourceDataset {
    SourceDataset::open(root, None, &options()).unwrap()
}

#[test]
fn all_three_subsets_come_in_under_names_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    lego(dir.path());
    let source = open(dir.path());
    assert_eq!(source.format, SourceFormat::InstantNgp);
    assert_eq!(source.camera_files().count(), 3);
    let out = dir.path().join("out");
    import(&source, &out, &options(), &mut |_| ()).unwrap();
    let dataset = Dataset::open(&out).unwrap();
    let names: Vec<&str> = dataset.frames().iter().map(|f| f.name.as_str()).collect();
    let wanted = [
        "train/r_0",
        "train/r_1",
        "train/r_2",
        "val/r_0",
        "test/r_0",
        "test/r_1",
    ];
    assert_eq!(names, wanted);
    let info = dataset.info();
    assert_eq!(info.train_names.unwrap(), wanted[..3]);
    assert_eq!(info.validation_names.unwrap(), wanted[3..4]);
    assert_eq!(info.test_names.unwrap(), wanted[4..]);
    let split = dataset.split(SplitRule::Listed).unwrap();
    assert_eq!((split.train, split.test), (vec![0, 1, 2], vec![4, 5]));
    for (index, (grey, angle)) in [(100, 100.0), (100, 101.0), (100, 102.0), (150, 150.0)]
        .into_iter()
        .enumerate()
    {
        let view = dataset.load_view(index).unwrap();
        let light = ((f64::from(grey) / 255.0 + 0.055) / 1.055_f64).powf(2.4);
        assert!((f64::from(view.radiance.get(0, 0)[0]) - light).abs() < 1e-6);
        // Light is premultiplied by opacity.
        assert_eq!(view.radiance.get(7, 0), [0.0; 3]);
        let alpha = view.alpha.unwrap();
        assert_eq!((alpha.get(0, 0), alpha.get(7, 0)), ([1.0], [0.0]));
        let eye = view.camera.world_from_camera.translation;
        let (sin, cos) = f64::sin_cos(angle);
        assert!((eye - DVec3::new(2.0 * cos, 2.0 * sin, 0.5)).length() < 1e-12);
        // 0.5 · 8 / tan(0.6911112 / 2), as everybody's loader of these scenes has it.
        assert!((view.camera.fx - 11.111_111).abs() < 1e-5);
    }
}

#[test]
fn a_validation_list_alone_is_what_is_tested() {
    let dir = tempfile::tempdir().unwrap();
    subset(dir.path(), "train", 2, 100);
    subset(dir.path(), "val", 1, 150);
    // A subset without views is no subset.
    let none = json!({"camera_angle_x": 0.7, "frames": []});
    write_json(&dir.path().join("transforms_test.json"), &none);
    let source = open(dir.path());
    assert!(source.warnings[0].contains("transforms_test.json: frames: none"));
    let out = dir.path().join("out");
    import(&source, &out, &options(), &mut |_| ()).unwrap();
    let dataset = Dataset::open(&out).unwrap();
    assert_eq!(dataset.info().test_names, None);
    assert_eq!(dataset.split(SplitRule::Listed).unwrap().test, [2]);
}

#[test]
fn views_of_two_subsets_are_one_frame() {
    let dir = tempfile::tempdir().unwrap();
    subset(dir.path(), "train", 2, 100);
    let same = dir.path().join("transforms_train.json");
    std::fs::copy(same, dir.path().join("transforms_test.json")).unwrap();
    let source = open(dir.path());
    assert_eq!(source.frames.len(), 2);
    let is_told = |text: &String| text.contains("2 frames are listed twice");
    assert!(source.notes.iter().any(is_told), "{:?}", source.notes);
    assert_eq!(source.info.train_names, source.info.test_names);
    // With another pose it is not: which of them is meant cannot be told.
    let frame = json!({"file_path": "./train/r_0", "transform_matrix": pose(0.3)});
    let other = json!({"camera_angle_x": 0.6911112070083618, "frames": [frame]});
    write_json(&dir.path().join("transforms_test.json"), &other);
    let error = SourceDataset::open(dir.path(), None, &options()).unwrap_err();
    assert!(error.to_string().contains("two frames are called `r_0`"));
}

#[test]
fn a_focal_length_beats_an_angle_that_contradicts_it() {
    let dir = tempfile::tempdir().unwrap();
    subset(dir.path(), "train", 2, 100);
    let path = dir.path().join("transforms_train.json");
    let mut top: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    top["fl_x"] = json!(10.0);
    write_json(&path, &top);
    let source = open(dir.path());
    let wanted = "0.6911112070083618 rad is a focal length of 11.11, but fl_x is 10.0: fl_x is \
                  taken, for 2 frames";
    assert!(
        source.warnings.iter().any(|text| text.contains(wanted)),
        "{:?}",
        source.warnings
    );
    let params = source.frames[0].lens.params();
    assert_eq!(params[..2], [10.0, 10.0]);
}
