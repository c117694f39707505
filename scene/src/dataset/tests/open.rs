use super::*;
use crate::testing::assert_error;
use eagpt_testkit::damage::{for_each_damage, for_each_truncation};
use eagpt_testkit::test_data;

#[test]
fn poses_are_turned_from_opengl_to_opencv_axes() {
    let folder = folder_with(&["a"]);
    folder.transforms(
        &json!({"fx": 3.0, "frames": [{"file_name": "a", "transform_matrix": [
            [0, 0, 1, 7], [1, 0, 0, 8], [0, 1, 0, 9], [0, 0, 0, 1]
        ]}]}),
    );
    let camera = folder.open().unwrap().frames()[0].camera;
    // On disk: right +y, up +z, backwards +x. In memory: right +y, down −z, forward −x.
    let pose = camera.world_from_camera;
    assert_eq!(pose.matrix3.x_axis, DVec3::Y);
    assert_eq!(pose.matrix3.y_axis, DVec3::NEG_Z);
    assert_eq!(pose.matrix3.z_axis, DVec3::NEG_X);
    assert_eq!(pose.translation, DVec3::new(7.0, 8.0, 9.0));
}

#[test]
fn intrinsics_are_found_in_every_spelling() {
    let (near, right) = (std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_3);
    // Images are 4x2. Half of 4 over tan 45° is 2; half of 2 over tan 30° is √3.
    let cases = [
        (
            json!({"camera_angle_x": near}),
            json!({}),
            [2.0, 2.0, 2.0, 1.0],
        ),
        (
            json!({"camera_angle_x": near, "camera_angle_y": right}),
            json!({}),
            [2.0, 3.0_f64.sqrt(), 2.0, 1.0],
        ),
        (json!({"fx": 3, "fy": 4}), json!({}), [3.0, 4.0, 2.0, 1.0]),
        (json!({"fx": 3}), json!({}), [3.0, 3.0, 2.0, 1.0]),
        (
            json!({"fx": 3, "fy": 4, "cx": 1.5, "cy": 0.5, "w": 4, "h": 2}),
            json!({}),
            [3.0, 4.0, 1.5, 0.5],
        ),
        (
            json!({}),
            json!({"fx": 5, "fy": 6, "cx": 1.75, "cy": 0.25}),
            [5.0, 6.0, 1.75, 0.25],
        ),
        // Both, in agreement.
        (
            json!({"camera_angle_x": near, "fx": 2.0001}),
            json!({"fx": 2.0001}),
            [2.0001, 2.0001, 2.0, 1.0],
        ),
        // In contradiction, the angle at the top or in the frame: the focal length counts.
        (
            json!({"camera_angle_x": 1.0, "fx": 9}),
            json!({}),
            [9.0, 9.0, 2.0, 1.0],
        ),
        (
            json!({"fx": 9, "fy": 8}),
            json!({"camera_angle_y": 1.0}),
            [9.0, 8.0, 2.0, 1.0],
        ),
    ];
    for (mut top, mut frame, wanted) in cases {
        let folder = folder_with(&["a"]);
        frame["file_name"] = json!("a");
        frame["transform_matrix"] = identity();
        top["frames"] = json!([frame]);
        folder.transforms(&top);
        let c = folder.open().unwrap().frames()[0].camera;
        let got = [c.fx, c.fy, c.cx, c.cy];
        let close = got.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close, "{top}: {got:?}, not {wanted:?}");
        assert_eq!((c.width, c.height), (4, 2));
    }
}

#[test]
fn contradicting_or_missing_intrinsics_are_named() {
    let cases = [
        (
            json!({}),
            json!({}),
            "frames[0].fx: missing, and so is camera_angle_x",
        ),
        (
            json!({"fx": 0}),
            json!({}),
            "transforms.json: fx: 0.0 is not above 0",
        ),
        (
            json!({"fx": "3"}),
            json!({}),
            "transforms.json: fx: \"3\" is not a finite number",
        ),
        (
            json!({"fx": 3}),
            json!({"fx": 4}),
            "frames[0].fx: 4.0, but 3.0 at the top level",
        ),
        (
            json!({"camera_angle_x": 3.2}),
            json!({}),
            "camera_angle_x: 3.2 rad is not between 0 and pi",
        ),
        (
            json!({"fx": 3, "w": 8}),
            json!({}),
            "transforms.json: w: 8.0, but the image is 4x2",
        ),
        (
            json!({"fx": 3}),
            json!({"h": 4}),
            "frames[0].h: 4.0, but the image is 4x2",
        ),
    ];
    for (mut top, mut frame, wanted) in cases {
        let folder = folder_with(&["a"]);
        frame["file_name"] = json!("a");
        frame["transform_matrix"] = identity();
        top["frames"] = json!([frame]);
        folder.transforms(&top);
        assert_error(folder.open(), &["transforms.json: ", wanted]);
    }
}

#[test]
fn distorted_cameras_are_refused_by_key() {
    let cases = [
        (
            "k1",
            json!(-0.1),
            "transforms.json: k1: not supported: distortion -0.1",
        ),
        ("p2", json!(1e-9), "p2: not supported: distortion 1e-9"),
        (
            "distortion_params",
            json!([0, 0.25]),
            "distortion_params: not supported: distortion 0.25",
        ),
        (
            "camera_model",
            json!("OPENCV_FISHEYE"),
            "camera_model: not supported: \"OPENCV_FISHEYE\"",
        ),
        (
            "camera_model",
            json!("EQUIRECTANGULAR"),
            "camera_model: not supported",
        ),
        ("is_fisheye", json!(true), "is_fisheye: not supported: true"),
    ];
    for (key, value, wanted) in cases {
        let folder = folder_with(&["a"]);
        let mut top =
            json!({"fx": 3, "frames": [{"file_name": "a", "transform_matrix": identity()}]});
        top[key] = value;
        folder.transforms(&top);
        assert_error(folder.open(), &[wanted, "undistort"]);
    }
    let folder = folder_with(&["a"]);
    folder.transforms(&json!({
        "fx": 3, "k1": 0, "k2": 0.0, "distortion_params": [0, 0, 0, 0], "camera_model": "OPENCV", "is_fisheye": false,
        "frames": [{"file_name": "a", "transform_matrix": identity()}]
    }));
    assert!(folder.open().is_ok());
}

#[test]
fn poses_that_are_no_rigid_transforms_are_named() {
    let cases = [
        (json!(null), "frames[1].transform_matrix: missing"),
        (
            json!([[1, 0, 0, 0], [0, 1, 0, 0]]),
            "transform_matrix: 2 rows, not 4",
        ),
        (
            json!([[1, 0, 0, 0], [0, 1, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
            "row 1 is [0,1,0], not 4 numbers",
        ),
        (
            json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, "x", 0], [0, 0, 0, 1]]),
            "row 2 column 2: \"x\" is not a finite number",
        ),
        (
            json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]),
            "last row is [0.0, 0.0, 0.0, 2.0]",
        ),
        (
            json!([[1, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]),
            "singular: the determinant is 0",
        ),
        (
            json!([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]),
            "singular",
        ),
        (
            json!([[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]),
            "not a rotation: off by 3.00e0, its columns have lengths 2.000000",
        ),
        (
            json!([[1, 0.002, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
            "not a rotation: off by 2.00e-3",
        ),
        (
            json!([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
            "mirrored: the determinant is -1",
        ),
        (
            json!([
                [1e200, 0, 0, 0],
                [0, 1e200, 0, 0],
                [0, 0, 1e200, 0],
                [0, 0, 0, 1]
            ]),
            "transform_matrix: ",
        ),
    ];
    let folder = folder_with(&["a", "b"]);
    for (matrix, wanted) in cases {
        folder.transforms(&json!({"fx": 3, "frames": [
            {"file_name": "a", "transform_matrix": identity()},
            {"file_name": "b", "transform_matrix": matrix},
        ]}));
        assert_error(
            folder.open(),
            &["transforms.json: frames[1].transform_matrix: ", wanted],
        );
    }
    // Python writes NaN, which is not JSON.
    let text = r#"{"fx": 3, "frames": [{"file_name": "a", "transform_matrix": [[NaN,0,0,0]]}]}"#;
    std::fs::write(folder.root().join(TRANSFORMS_FILE), text).unwrap();
    assert_error(
        folder.open(),
        &["transforms.json: JSON: ", "line 1 column 63"],
    );
}

#[test]
fn a_rotation_off_by_rounding_stays_as_it_is() {
    let folder = folder_with(&["a"]);
    folder.transforms(
        &json!({"fx": 3, "frames": [{"file_name": "a", "transform_matrix":
        [[0.99995, 0, 0, 0], [0, 1, 0.0001, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]}),
    );
    let m = folder.open().unwrap().frames()[0]
        .camera
        .world_from_camera
        .matrix3;
    assert_eq!((m.x_axis.x, m.z_axis.y), (0.99995, -0.0001));
}

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
