//! Models in both forms: round trips, and corrupt files.

use super::records::Record;
use super::write::to_bytes;
use super::*;
use eagpt_scene::lens::LensModel;
use eagpt_testkit::damage::for_each_damage;
use glam::DQuat;

/// A model with every model of camera, images with and without features, and a rig of two cameras.
pub(crate) fn small_model() -> Model {
    let cameras: Vec<ModelCamera> = LensModel::all()
        .enumerate()
        .map(|(at, model)| {
            let value = |name: &&str| match *name {
                "f" | "fx" | "fy" => 321.5 + at as f64,
                "cx" | "w" => 320.0,
                "cy" | "h" => 239.75,
                "alpha" | "omega" => 0.6,
                "beta" => 1.1,
                _ => 0.1 / 3.0,
            };
            let params: Vec<f64> = model.param_names().iter().map(value).collect();
            ModelCamera {
                id: CameraId(at as u32 + 1),
                lens: Lens::new(model, (640, 480), &params).unwrap(),
            }
        })
        .collect();
    let pose = |i: u32| Rigid {
        rotation: DQuat::from_euler(glam::EulerRot::XYZ, 0.1 * f64::from(i), -0.7, 1.3).normalize(),
        translation: DVec3::new(1.0 / 3.0, f64::from(i), -2e-7),
    };
    let images: Vec<ModelImage> = (1..=5)
        .map(|i| ModelImage {
            id: ImageId(i),
            camera_from_world: pose(i),
            camera: CameraId(i),
            name: format!("left/IMG {i}.jpg"),
            observations: (0..3 * (i - 1))
                .map(|k| Observation {
                    at: DVec2::new(0.1 + f64::from(k), 200.0 / 7.0),
                    point: (k % 3 == 0).then_some(PointId(u64::from(k) + 7)),
                })
                .collect(),
        })
        .collect();
    let points = (0..4_u32)
        .map(|i| ModelPoint {
            id: PointId(u64::from(3 * i) + 7),
            position: DVec3::new(0.3, -1.0 / 7.0, 1e5 * f64::from(i)),
            color_srgb8: [0, i as u8, 255],
            error_px: 0.7,
            track_length: i + 1,
            track: (0..=i)
                .map(|k| TrackElement {
                    image: ImageId(k.min(2) + 3),
                    observation: k,
                })
                .collect(),
        })
        .collect();
    let sensor = |number| SensorId {
        kind: SensorType::Camera,
        number,
    };
    let imu = SensorId {
        kind: SensorType::Imu,
        number: 1,
    };
    Model {
        cameras,
        images,
        points,
        rigs: Some(vec![
            Rig {
                id: RigId(1),
                reference: Some(sensor(1)),
                others: vec![(sensor(2), Some(pose(9))), (imu, None)],
            },
            Rig {
                id: RigId(2),
                reference: None,
                others: Vec::new(),
            },
        ]),
        frames: Some(vec![RigFrame {
            id: FrameId(1),
            rig: RigId(1),
            rig_from_world: pose(1),
            data: vec![(sensor(1), 1), (sensor(2), 2)],
        }]),
    }
}

#[test]
fn a_model_survives_both_forms_to_the_bit() {
    let dir = tempfile::tempdir().unwrap();
    let model = small_model();
    for form in [Form::Binary, Form::Text] {
        let path = dir.path().join(format!("{form:?}"));
        model.write(&path, form).unwrap();
        assert_eq!(Form::of(&path), Some(form));
        assert_eq!(Model::read(&path, Observations::Keep).unwrap(), model);
        let poses = Model::read(&path, Observations::Skip).unwrap();
        assert!(
            poses
                .images
                .iter()
                .all(|image| image.observations.is_empty())
        );
        let lengths: Vec<_> = poses
            .points
            .iter()
            .map(|point| point.track_length)
            .collect();
        assert_eq!(lengths, [1, 2, 3, 4]);
        let message = poses.write(&path, form).unwrap_err().to_string();
        assert!(message.contains("cannot be written"), "{message}");
    }
    // Stale poses must not stay beside new ones.
    let old = Model {
        rigs: None,
        frames: None,
        ..model
    };
    let path = dir.path().join("Binary");
    old.write(&path, Form::Binary).unwrap();
    assert_eq!(Model::read(&path, Observations::Keep).unwrap(), old);
}

#[test]
fn text_is_read_as_colmap_writes_it() {
    let text = "# Image list\n#   second comment\n\n1 1 0 0 0 0.5 -1 2e0 3 a b.jpg\r\n1.5 2.5 -1 3 4 9\r\n2 2 0 0 0 0 0 0 3 c.jpg\n\n3 1 0 0 0 0 0 0 3 d.jpg\n";
    let model = read_part(
        Part::Images,
        Form::Text,
        Path::new("images.txt"),
        text.as_bytes(),
    );
    let images = model.unwrap().images;
    let names: Vec<_> = images.iter().map(|image| image.name.as_str()).collect();
    assert_eq!(names, ["a b.jpg", "c.jpg", "d.jpg"]);
    let points: Vec<_> = images[0].observations.iter().map(|o| o.point).collect();
    assert_eq!(points, [None, Some(PointId(9))]);
    // Normalised.
    assert_eq!(images[1].camera_from_world.rotation, DQuat::IDENTITY);
    let rigs = "1 3 CAMERA 1 CAMERA 2 1 1 0 0 0 0 0 0 IMU 4 0\n";
    let rigs = read_part(
        Part::Rigs,
        Form::Text,
        Path::new("rigs.txt"),
        rigs.as_bytes(),
    )
    .unwrap();
    assert_eq!(rigs.rigs.unwrap()[0].others.len(), 2);
}

#[track_caller]
fn refused(part: Part, form: Form, bytes: &[u8], parts: &[&str]) {
    let path = part.path(Path::new("m"), form);
    let message = read_part(part, form, &path, bytes).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    for part in parts.iter().chain([&path.to_str().unwrap()]) {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}

#[test]
fn lies_are_told_with_their_place() {
    let cameras =
        |text: &str, parts: &[&str]| refused(Part::Cameras, Form::Text, text.as_bytes(), parts);
    cameras("1 PINHOLE 9 9 1 1 4\n", &["line 1", "cy is missing"]);
    cameras("# x\n1 PINHOL 9 9 1 1 4 4\n", &["line 2", "`PINHOL`"]);
    cameras(
        "1 PINHOLE 9 9 1 1 4 4 4\n",
        &["line 1", "1 fields too many"],
    );
    cameras("1 PINHOLE 9 9 1 nan 4 4\n", &["line 1", "fy is NaN"]);
    cameras("1 PINHOLE 9 99999999999 1 1 4 4\n", &["line 1", "pixels"]);
    cameras("1 PINHOLE 9 9 1 x 4 4\n", &["line 1", "fy is `x`"]);
    cameras(
        "1 PINHOLE 9 9 1 1 4 4\n1 PINHOLE 9 9 1 1 4 4\n",
        &["line 2", "camera 1 is there twice"],
    );
    let images =
        |text: &str, parts: &[&str]| refused(Part::Images, Form::Text, text.as_bytes(), parts);
    images("1 0 0 0 0 1 1 1 1 a\n\n", &["quaternion", "no direction"]);
    images("1 1 0 0 0 inf 1 1 1 a\n\n", &["tx is inf"]);
    images(
        "1 1 0 0 0 1 1 1 1\n\n",
        &["the name of an image is missing"],
    );
    images(
        "1 1 0 0 0 1 1 1 1 a\n1 2\n",
        &["line 2", "2 fields, not 3 each"],
    );
    images("1 1 0 0 0 1 1 1 1 a\n1 2 -7\n", &["line 2", "`-7`"]);
    let rigs = |text: &str, parts: &[&str]| refused(Part::Rigs, Form::Text, text.as_bytes(), parts);
    rigs("1 4000000000 CAMERA 1\n", &["4000000000 sensors"]);
    rigs("1 2 CAMERA 1 CAMERA 2 7\n", &["has a pose is 7"]);
    rigs("1 1 LIDAR 1\n", &["`LIDAR`"]);

    let bin = |part: Part, bytes: &[u8], parts: &[&str]| refused(part, Form::Binary, bytes, parts);
    let huge = (1_u64 << 60).to_le_bytes();
    for part in Part::ALL {
        bin(part, &huge, &["byte 8", "1152921504606846976 records"]);
        bin(
            part,
            &[1, 0, 0],
            &["byte 0", "ends within the number of records"],
        );
        bin(
            part,
            &[0, 0, 0, 0, 0, 0, 0, 0, 7],
            &["1 bytes after the last record"],
        );
    }
    let model = small_model();
    let mut bytes = to_bytes(Form::Binary, &model.points);
    // The track of the first point: after 8 for the count, 8 + 24 + 3 + 8.
    bytes[51..59].copy_from_slice(&huge);
    bin(
        Part::Points,
        &bytes,
        &["byte 59", "observations", "holds at most"],
    );
    let mut bytes = to_bytes(Form::Binary, &model.cameras);
    bytes[12..16].copy_from_slice(&99_i32.to_le_bytes());
    bin(
        Part::Cameras,
        &bytes,
        &["byte 16", "99 is not a camera model"],
    );
    let pose = [1.0_f64, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0].map(f64::to_le_bytes);
    let start = [
        &1_u64.to_le_bytes()[..],
        &[1, 0, 0, 0],
        pose.as_flattened(),
        &[1, 0, 0, 0],
    ];
    let endless = [&start.concat()[..], &[b'a'; 9000]].concat();
    bin(Part::Images, &endless, &["longer than 4096 bytes"]);
}

#[test]
fn files_that_do_not_fit_each_other_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut Model), parts: &[&str]| {
        let mut model = small_model();
        change(&mut model);
        model.write(dir.path(), Form::Binary).unwrap();
        let message = Model::read(dir.path(), Observations::Keep)
            .unwrap_err()
            .to_string();
        for part in parts {
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    };
    refused(
        |m| m.images[1].camera = CameraId(77),
        &["images.bin", "image 2 has camera 77"],
    );
    refused(
        |m| m.images[1].name = m.images[0].name.clone(),
        &["`left/IMG 1.jpg` is there twice"],
    );
    refused(
        |m| m.points[0].track[0].observation = 99,
        &["points3D.bin", "point 7 is observation 99 of image 3"],
    );
    refused(
        |m| m.frames.as_mut().unwrap()[0].rig = RigId(5),
        &["frames.bin", "rig 5"],
    );
    let empty = tempfile::tempdir().unwrap();
    let message = Model::read(empty.path(), Observations::Keep)
        .unwrap_err()
        .to_string();
    assert!(message.contains("no model"), "{message}");
    small_model()
        .write(&empty.path().join("sparse/0"), Form::Text)
        .unwrap();
    let message = Model::read(empty.path(), Observations::Keep)
        .unwrap_err()
        .to_string();
    assert!(message.contains("sparse/0"), "{message}");
}

fn part_bytes(model: &Model, part: Part, form: Form) -> Vec<u8> {
    fn all<T: Record>(form: Form, records: &[T]) -> Vec<u8> {
        to_bytes(form, records)
    }
    match part {
        Part::Cameras => all(form, &model.cameras),
        Part::Images => all(form, &model.images),
        Part::Points => all(form, &model.points),
        Part::Rigs => all(form, model.rigs.as_ref().unwrap()),
        Part::Frames => all(form, model.frames.as_ref().unwrap()),
    }
}

/// Reads damaged copies of every file. The result is a model or an error of one line.
fn damage(copies: std::ops::Range<u32>) {
    let model = small_model();
    for part in Part::ALL {
        for form in [Form::Binary, Form::Text] {
            let bytes = part_bytes(&model, part, form);
            let path = part.path(Path::new("m"), form);
            for_each_damage(&bytes, copies.clone(), |damaged| {
                if let Err(error) = read_part(part, form, &path, damaged) {
                    assert!(!error.to_string().contains('\n'), "{error}");
                }
            });
            for length in 0..bytes.len().min(400) {
                let outcome = read_part(part, form, &path, &bytes[..length]);
                assert!(
                    outcome.is_err() || form == Form::Text,
                    "{part:?} of {length} bytes"
                );
            }
        }
    }
}

#[test]
fn damaged_files_are_read_or_refused() {
    damage(0..2000);
}

/// Ten minutes of damage: `cargo test --release -p eagpt-colmap -- --ignored damaged`.
#[test]
#[ignore = "takes ten minutes"]
fn damaged_files_are_read_or_refused_for_ten_minutes() {
    let start = std::time::Instant::now();
    let mut first = 2000;
    while start.elapsed().as_secs() < 600 {
        damage(first..first + 10_000);
        first += 10_000;
    }
}

#[test]
fn moving_the_world_moves_cameras_frames_and_rigs() {
    let mut model = small_model();
    let new_from_old = Similarity {
        scale: 2.0,
        rotation: DQuat::from_euler(glam::EulerRot::XYZ, 1.0, 0.2, -0.4),
        translation: DVec3::new(3.0, 2.0, 1.0),
    };
    let old = model.clone();
    model.transform(&new_from_old);
    for (new, earlier) in model.images.iter().zip(&old.images) {
        let centre = new_from_old.apply(earlier.camera_from_world.centre());
        // Double precision of numbers up to 10.
        assert!((new.camera_from_world.centre() - centre).length() < 1e-13);
        for (new_point, old_point) in model.points.iter().zip(&old.points) {
            let seen = new.camera_from_world.apply(new_point.position).normalize();
            let before = earlier
                .camera_from_world
                .apply(old_point.position)
                .normalize();
            assert!((seen - before).length() < 1e-11);
        }
    }
    // The second camera of the rig through frame and rig.
    let through = |model: &Model| {
        let frame = model.frames.as_ref().unwrap()[0].rig_from_world;
        let sensor = model.rigs.as_ref().unwrap()[0].others[0].1.unwrap();
        frame.inverse().apply(sensor.inverse().translation)
    };
    let moved = new_from_old.apply(through(&old));
    assert!((through(&model) - moved).length() < 1e-13);
}
