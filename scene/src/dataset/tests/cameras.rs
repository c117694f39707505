//! Poses and intrinsics: every spelling that is understood, and what is refused.

use super::*;
use crate::testing::assert_error;

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
