use super::*;
use crate::testing::assert_error;
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use eagpt_testkit::test_data;

#[test]
fn frames_without_a_usable_name_or_image_are_named() {
    let folder = folder_with(&["a"]);
    let frame = |name: &str| json!({"file_name": name, "transform_matrix": identity()});
    let cases = [
        (json!([]), "transforms.json: frames: empty"),
        (json!(7), "transforms.json: frames: 7 is not a list"),
        (json!([1]), "transforms.json: frames[0]: 1 is not an object"),
        (
            json!([{}]),
            "frames[0].file_name: missing, and so is file_path",
        ),
        (json!([frame("a"), {}]), "frames[1].file_name: missing"),
        (
            json!([frame("a"), frame("b")]),
            "frames[1].file_name: no image ",
        ),
        (
            json!([frame("a"), frame("a")]),
            "frames[1].file_name: `a` is also frames[0]",
        ),
        (
            json!([frame("../a")]),
            "frames[0].file_name: `../a` is not a relative name",
        ),
        (json!([frame("/a")]), "`/a` is not a relative name"),
        (json!([frame("")]), "`` is not a relative name"),
        (json!([frame("a\nb")]), "`a\\nb` is not a relative name"),
    ];
    for (frames, wanted) in cases {
        folder.transforms(&json!({"fx": 3, "frames": frames}));
        assert_error(folder.open(), &["transforms.json: ", wanted]);
    }
    folder.transforms(&json!({"fx": 3}));
    assert_error(folder.open(), &["transforms.json: frames: missing"]);
    folder.transforms(&json!([]));
    assert_error(folder.open(), &["transforms.json: JSON: not an object"]);
    std::fs::remove_file(folder.root().join(TRANSFORMS_FILE)).unwrap();
    assert_error(folder.open(), &["transforms.json: missing: not a dataset"]);
}

#[test]
fn an_image_that_is_none_is_found_when_opening() {
    let folder = folder_with(&["a", "b"]);
    std::fs::write(folder.root().join("Radiance-exr/b.exr"), b"no image").unwrap();
    assert_error(folder.open(), &["Radiance-exr/b.exr: content: "]);
}

#[test]
fn nerfstudio_files_open() {
    let folder = Folder::new();
    for name in ["images/10/a.exr", "images/11/a.exr", "images/11/b.EXR"] {
        folder.image(name);
    }
    folder.image("Emissive-exr/11/a.exr");
    let cloud = PointCloud {
        positions: vec![glam::Vec3::ONE],
        colors_srgb8: vec![[1, 2, 3]],
    };
    crate::ply::write_points(&folder.root().join("sparse.ply"), &cloud).unwrap();
    let frame = |path: &str| json!({"file_path": path, "transform_matrix": identity(), "mask_path": "m.png"});
    let top = json!({
        "fl_x": 3.0, "fl_y": 4.0, "cx": 2.5, "cy": 1.0, "w": 4, "h": 2, "camera_model": "PINHOLE", "k1": 0.0,
        "ply_file_path": "sparse.ply",
        "train_filenames": ["images/11/b.EXR", "images/10/a"], "val_filenames": ["./images/11/a.exr"],
        "frames": [frame("images/10/a"), frame("./images/11/a.exr"), frame("images/11/b.EXR")]
    });
    folder.transforms(&top);
    let dataset = folder.open().unwrap();
    let names: Vec<&str> = dataset.frames().iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["10/a", "11/a", "11/b"]);
    let camera = dataset.frames()[1].camera;
    assert_eq!(
        (camera.fx, camera.fy, camera.cx, camera.cy),
        (3.0, 4.0, 2.5, 1.0)
    );
    assert!(dataset.frames()[0].files.emission.is_none());
    assert!(dataset.frames()[1].files.emission.is_some());
    assert_eq!(dataset.points().unwrap(), Some(cloud));
    let split = dataset.split(SplitRule::Listed).unwrap();
    assert_eq!((split.train, split.test), (vec![2, 0], vec![1]));
    // The file itself instead of its folder, and under another name.
    let other = folder.root().join("other.json");
    std::fs::rename(dataset.transforms(), &other).unwrap();
    assert_eq!(Dataset::open(&other).unwrap().frames(), dataset.frames());

    let refused = |key: &str, value: Value, wanted: &str| {
        let mut top = top.clone();
        top[key] = value;
        folder.transforms(&top);
        assert_error(folder.open(), &["transforms.json: ", wanted]);
    };
    let jpeg = json!([frame("images/10/a.jpg")]);
    refused(
        "frames",
        jpeg,
        "frames[0].file_path: not supported: `images/10/a.jpg`: linear EXR is needed",
    );
    refused(
        "frames",
        json!([frame("images/10/c.exr")]),
        "frames[0].file_path: no image ",
    );
    refused(
        "frames",
        json!([frame("..")]),
        "frames[0].file_path: `..` names no file",
    );
    refused("frames", json!([frame("images/é/..")]), "names no file");
    refused(
        "ply_file_path",
        json!("none.ply"),
        "ply_file_path: no file ",
    );
    refused(
        "test_filenames",
        json!(["x"]),
        "test_filenames[0]: \"x\" is not the name of a frame",
    );
    refused("fl_x", json!(null), "frames[0].fl_x: missing");
}

#[test]
fn up_axis_and_scale_are_kept_and_checked() {
    let folder = folder_with(&["a"]);
    let dataset = folder.open().unwrap();
    assert_eq!((dataset.up_axis(), dataset.up()), (None, UpAxis::Z));
    assert_eq!(dataset.metres_per_unit(), None);
    let frames = json!([{"file_name": "a", "transform_matrix": identity()}]);
    folder.transforms(&json!({"fx": 3, "up_axis": "-y", "metres_per_unit": 0.5, "frames": frames}));
    let dataset = folder.open().unwrap();
    assert_eq!(
        (dataset.up_axis(), dataset.up()),
        (Some(UpAxis::NegY), UpAxis::NegY)
    );
    assert_eq!(dataset.metres_per_unit(), Some(0.5));
    folder.transforms(&json!({"fx": 3, "up_axis": "up", "frames": frames}));
    assert_error(
        folder.open(),
        &["transforms.json: up_axis: `up` is none of x, -x,"],
    );
    folder.transforms(&json!({"fx": 3, "metres_per_unit": -1, "frames": frames}));
    assert_error(
        folder.open(),
        &["transforms.json: metres_per_unit: -1.0 is not above 0"],
    );
}

#[test]
fn truncated_and_damaged_transforms_are_errors_or_datasets() {
    let folder = folder_with(&["a"]);
    let path = folder.root().join(TRANSFORMS_FILE);
    let bytes = std::fs::read(&path).unwrap();
    for_each_truncation(&bytes, 200, |prefix| {
        std::fs::write(&path, prefix).unwrap();
        assert_error(folder.open(), &["transforms.json: "]);
    });
    let mut num_refused = 0;
    for_each_damage(&bytes, 0..500, |damaged| {
        std::fs::write(&path, damaged).unwrap();
        num_refused += u32::from(folder.open().is_err());
    });
    assert!(num_refused > 250, "{num_refused}");
}

#[test]
fn kitchen_opens() {
    let Some(root) = test_data("kitchen_opens", "kitchen") else {
        return;
    };
    let dataset = Dataset::open(&root).unwrap();
    assert_eq!(dataset.len(), 96);
    // 75° across 270 pixels: 135 / tan 37.5°.
    let camera = dataset.frames()[0].camera;
    assert!((camera.fx - 135.0 / 37.5_f64.to_radians().tan()).abs() < 1e-9);
    let split = dataset.split(SplitRule::Every8th).unwrap();
    assert_eq!((split.train.len(), split.test.len()), (84, 12));
    // Axes and units: where the depth of one view puts its points, the point cloud has points.
    let cloud = dataset.points().unwrap().unwrap();
    let view = dataset.load_view(1).unwrap();
    let depth = view.depth.as_ref().unwrap();
    let frame = view.camera.ray_frame();
    let mut distances = Vec::new();
    for (x, y) in (0..180)
        .step_by(20)
        .flat_map(|y| (0..270).step_by(20).map(move |x| (x, y)))
    {
        let depth = depth.get(x, y)[0];
        if depth > 0.0 {
            let ray =
                frame.base + frame.step_x * (x as f32 + 0.5) + frame.step_y * (y as f32 + 0.5);
            let point = frame.origin + ray * depth;
            let distance = cloud
                .positions
                .iter()
                .map(|p| p.distance(point))
                .fold(f32::MAX, f32::min);
            distances.push(distance);
        }
    }
    distances.sort_by(f32::total_cmp);
    assert!(distances.len() > 100);
    let median = distances[distances.len() / 2];
    // The cloud has 58,800 points on some 100 square metres: a point every 4 cm.
    assert!(median < 0.04, "{median}");
}

#[test]
fn a_survey_tells_of_every_bad_frame_and_goes_on() {
    let folder = folder_with(&["a", "b", "c"]);
    let mirrored = json!([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);
    folder.transforms(
        &json!({"fx": 3.0, "train_filenames": ["a", "b"], "test_filenames": ["c", "d"], "frames": [
            {"file_name": "a", "transform_matrix": identity()},
            {"file_name": "b", "transform_matrix": mirrored},
            {"file_name": "c", "transform_matrix": identity()},
            {"file_name": "d", "transform_matrix": identity()},
        ]}),
    );
    let (dataset, bad) = Dataset::survey(folder.root()).unwrap();
    let names: Vec<&str> = dataset.frames().iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["a", "c"]);
    let bad: Vec<String> = bad
        .iter()
        .map(|b| format!("{}: {}", b.name, b.error))
        .collect();
    assert!(
        bad[0].starts_with("b: ") && bad[0].contains("mirrored"),
        "{bad:?}"
    );
    assert!(
        bad[1].starts_with("d: ") && bad[1].contains("no image"),
        "{bad:?}"
    );
    // The lists lose the bad frames, and no more.
    let split = dataset.split(SplitRule::Listed).unwrap();
    assert_eq!((split.train, split.test), (vec![0], vec![1]));
    assert!(folder.open().is_err());
}
