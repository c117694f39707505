//! `eagpt colmap`: poses in, datasets out.

use crate::support::Workplace;
use eagpt_colmap::model::{
    CameraId, Form, ImageId, Model, ModelCamera, ModelImage, ModelPoint, Observation, Observations,
    PointId, Rigid, Similarity, TrackElement,
};
use eagpt_scene::lens::{Lens, LensModel};
use eagpt_scene::{Dataset, exr};
use glam::{DQuat, DVec2, DVec3};

/// The room's cameras and points as a COLMAP model in `place/sparse`, in a frame and a unit of its
/// own. The last view is not registered.
fn room_model(place: &Workplace) -> Similarity {
    let dataset = Dataset::open(&place.path("room")).unwrap();
    let first = dataset.frames()[0].camera;
    let params = [first.fx, first.fy, first.cx, first.cy];
    let points = dataset.points().unwrap().unwrap();
    let registered = &dataset.frames()[..dataset.len() - 1];
    let observation = |point: usize| Observation {
        at: DVec2::new(1.5, 2.5),
        point: Some(PointId(point as u64)),
    };
    let images = registered.iter().enumerate().map(|(i, frame)| {
        let world = frame.camera.world_from_camera;
        let pose = Rigid {
            rotation: DQuat::from_mat3(&world.matrix3).normalize(),
            translation: world.translation,
        };
        let num_seen = if i < 3 { points.len() } else { 0 };
        ModelImage {
            id: ImageId(i as u32 + 1),
            camera_from_world: pose.inverse(),
            camera: CameraId(1),
            name: format!("{}.png", frame.name),
            observations: (0..num_seen).map(observation).collect(),
        }
    });
    let model_points = (0..points.len()).map(|i| ModelPoint {
        id: PointId(i as u64),
        position: points.positions[i].as_dvec3(),
        color_srgb8: points.colors_srgb8[i],
        error_px: if i < 10 { 9.0 } else { 0.4 },
        track_length: 3,
        track: (1..=3)
            .map(|image| TrackElement {
                image: ImageId(image),
                observation: i as u32,
            })
            .collect(),
    });
    let mut model = Model {
        cameras: vec![ModelCamera {
            id: CameraId(1),
            lens: Lens::new(LensModel::Pinhole, (first.width, first.height), &params).unwrap(),
        }],
        images: images.collect(),
        points: model_points.collect(),
        rigs: None,
        frames: None,
    };
    let model_from_room = Similarity {
        scale: 0.31,
        rotation: DQuat::from_euler(glam::EulerRot::XYZ, 2.0, 0.4, -1.3),
        translation: DVec3::new(5.0, 1.0, -2.0),
    };
    model.transform(&model_from_room);
    model.write(&place.path("sparse"), Form::Binary).unwrap();
    model_from_room
}

/// Metres between the first two cameras.
fn known_distance(place: &Workplace) -> f64 {
    let room = Dataset::open(&place.path("room")).unwrap();
    let at = |i: usize| room.frames()[i].camera.world_from_camera.translation;
    (at(0) - at(1)).length()
}

#[test]
fn a_model_becomes_an_upright_metric_dataset() {
    let place = Workplace::new();
    room_model(&place);
    let import = format!(
        "colmap import sparse --images room --out ds --write-model --known-distance 000.png,001.png,{}",
        known_distance(&place)
    );
    place.succeeds(&import);
    let room = Dataset::open(&place.path("room")).unwrap();
    let imported = Dataset::open(&place.path("ds")).unwrap();
    assert_eq!(imported.len(), room.len() - 1);
    assert_eq!(imported.metres_per_unit(), Some(1.0));
    for (new, old) in imported.frames().iter().zip(room.frames()) {
        assert_eq!(new.name, old.name);
        let height = |frame: &eagpt_scene::Frame| frame.camera.world_from_camera.translation.z;
        // The floor is found in 1,500 points with noise of centimetres.
        assert!(
            (height(new) - height(old)).abs() < 0.03,
            "{} {}",
            height(new),
            height(old)
        );
        // The lens is a pinhole: the light keeps its bits.
        let light = |frame: &eagpt_scene::Frame| exr::read_rgb(&frame.files.radiance).unwrap();
        assert_eq!(light(new), light(old));
        assert_eq!(new.files.emission.is_some(), old.files.emission.is_some());
    }
    let points = imported.points().unwrap().unwrap();
    assert_eq!(points.len(), room.points().unwrap().unwrap().len() - 10);
    let report = place.json("ds/import.json");
    let unregistered = report["conditions"][0]["unregistered"].as_array().unwrap();
    assert_eq!(unregistered[0], room.frames().last().unwrap().name.as_str());
    let transforms = place.json("ds/transforms.json");
    assert_eq!(
        transforms["aligned_from_model"],
        report["aligned_from_model"]
    );
    // The aligned model has the dataset's poses.
    let model = Model::read(&place.path("ds/colmap"), Observations::Keep).unwrap();
    for (image, frame) in model.images.iter().zip(imported.frames()) {
        let offset = image.camera_from_world.centre() - frame.camera.world_from_camera.translation;
        assert!(offset.length() < 1e-9);
    }
    let record = place.json("ds/record.json");
    assert_eq!(record["command"], "colmap import");
    place.succeeds("train ds --out run --preset draft --iterations 50 --stage radiance");
    place.fails_cleanly(&import, &["ds", "--force"]);
    place.succeeds(&format!("{import} --force"));
}

#[test]
fn what_is_wrong_is_told_before_anything_is_written() {
    let place = Workplace::new();
    room_model(&place);
    let import = "colmap import sparse --out ds --images";
    place.fails_cleanly(
        "colmap import nowhere --out ds",
        &["nowhere", "no such folder"],
    );
    place.fails_cleanly(&format!("{import} nowhere"), &["nowhere"]);
    place.fails_cleanly(&format!("{import} sparse"), &["sparse", "no images"]);
    let refused = format!("{import} room --align manual");
    place.fails_cleanly(&refused, &["manual alignment needs three points"]);
    let refused = format!("{import} room --known-distance a.png,001.png,2");
    place.fails_cleanly(&refused, &["known_distance", "no image `a.png`"]);
    let refused = format!("{import} room --out room --force");
    place.fails_cleanly(&refused.replacen("--out ds ", "", 1), &["an input"]);
    std::fs::remove_file(place.path("room/Radiance-exr/002.exr")).unwrap();
    place.fails_cleanly(
        &format!("{import} room"),
        &["1 of 11 registered images", "--skip-missing", "002"],
    );
    place.write("room/Radiance-exr/002.jpg", "");
    place.fails_cleanly(
        &format!("{import} room"),
        &["1 PNG or JPEG, for --ldr srgb to decode: 002"],
    );
    std::fs::remove_file(place.path("room/Radiance-exr/002.jpg")).unwrap();
    let points = place.bytes("sparse/points3D.bin");
    std::fs::remove_file(place.path("sparse/points3D.bin")).unwrap();
    place.fails_cleanly(
        &format!("{import} room"),
        &["sparse: an incomplete model: no points3D.bin"],
    );
    place.write(
        "sparse/points3D.bin",
        "version https://git-lfs.github.com/spec/v1\noid 1\n",
    );
    place.fails_cleanly(
        &format!("{import} room"),
        &["points3D.bin", "pointer of Git LFS", "`git lfs pull`"],
    );
    // A model without enough points: what is in it is told all the same.
    place.write("sparse/points3D.bin", 0_u64.to_le_bytes());
    let output = place.run(&format!("{import} room --skip-missing --dry-run"));
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{told}");
    for part in [
        "11 registered images",
        "0 points",
        "camera 1: ",
        "up: ",
        "floor: none",
        "--align none",
        "--floor-points",
    ] {
        assert!(told.contains(part), "no `{part}` in: {told}");
    }
    place.write("sparse/points3D.bin", points);
    let bytes = place.bytes("sparse/images.bin");
    place.write("sparse/images.bin", &bytes[..bytes.len() - 5]);
    place.fails_cleanly(
        &format!("{import} room"),
        &["images.bin", "byte", "ends within"],
    );
    // Nothing is written either where only the floor is asked for.
    place.write("sparse/images.bin", bytes);
    let before = place.contents("");
    place.succeeds(&format!("{import} room --skip-missing --dry-run"));
    assert_eq!(place.contents(""), before);
}

#[test]
fn conditions_share_their_poses() {
    let place = Workplace::new();
    room_model(&place);
    for condition in ["day", "night"] {
        let to = place.path(&format!("capture/{condition}/Radiance-exr"));
        std::fs::create_dir_all(&to).unwrap();
        for frame in Dataset::open(&place.path("room")).unwrap().frames() {
            std::fs::copy(
                &frame.files.radiance,
                to.join(format!("{}.exr", frame.name)),
            )
            .unwrap();
        }
    }
    place.succeeds("colmap import sparse --images capture --conditions day,night --out ds");
    assert_eq!(
        place.bytes("ds/day/transforms.json"),
        place.bytes("ds/night/transforms.json")
    );
    assert_eq!(Dataset::open(&place.path("ds/night")).unwrap().len(), 11);
    let refused = "colmap import sparse --images capture --conditions day,noon --out other";
    place.fails_cleanly(refused, &["noon"]);
}

/// A program that says what COLMAP says and leaves the model in `sparse`.
#[cfg(unix)]
fn fake_colmap(place: &Workplace, mapper: &str) {
    use std::os::unix::fs::PermissionsExt;
    let script = format!(
        r#"#!/bin/sh
case "$1 $2" in
help*) echo "COLMAP 9.9 -- Structure-from-Motion"; exit 0;;
"feature_extractor --help") echo "--database_path arg --image_path arg --ImageReader.camera_model arg --ImageReader.single_camera arg
  --ImageReader.single_camera_per_folder arg --FeatureExtraction.use_gpu arg (=1)"; exit 0;;
"exhaustive_matcher --help") echo "--database_path arg --SiftMatching.use_gpu arg"; exit 0;;
"mapper --help") echo "--database_path arg --image_path arg --output_path arg"; exit 0;;
esac
echo "$@" >> calls
case "$1" in
feature_extractor) echo "Processed file [1/2]"; echo "Processed file [2/2]" >&2;;
exhaustive_matcher) echo "Matching block [1/1, 1/1] in 0.1s";;
mapper) {mapper};;
esac
"#
    );
    place.write("colmap", script);
    let permissions = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(place.path("colmap"), permissions).unwrap();
}

#[cfg(unix)]
#[test]
fn colmap_is_driven_and_its_losses_are_named() {
    let place = Workplace::new();
    room_model(&place);
    std::fs::create_dir(place.path("pictures")).unwrap();
    for frame in Dataset::open(&place.path("room")).unwrap().frames() {
        place.write(&format!("pictures/{}.png", frame.name), "");
    }
    fake_colmap(
        &place,
        r#"echo "Registering image #3 (2)"; mkdir model/work/sparse/0 model/work/sparse/1
           cp sparse/*.bin model/work/sparse/1"#,
    );
    let run = "colmap run pictures --out model --colmap ./colmap";
    place.succeeds(run);
    let model = Model::read(&place.path("model"), Observations::Keep).unwrap();
    assert_eq!(model.images.len(), 11);
    let report = place.json("model/run.json");
    assert_eq!(report["version"], "COLMAP 9.9");
    assert_eq!(report["registered"].as_array().unwrap().len(), 11);
    assert_eq!(report["lost"][0], "011.png");
    let calls = String::from_utf8(place.bytes("calls")).unwrap();
    // The newer name, where the program has it.
    assert!(calls.contains("--FeatureExtraction.use_gpu 0"), "{calls}");
    assert!(calls.contains("--SiftMatching.use_gpu 0"), "{calls}");
    assert!(!place.path("model/work").exists());
    place.fails_cleanly(run, &["model", "--force"]);
    place.succeeds(&format!("{run} --force"));

    fake_colmap(&place, "echo 'no good initial pair' >&2; exit 3");
    place.fails(
        &format!("{run} --force"),
        &[
            "mapper ended with",
            "3",
            "no good initial pair",
            "colmap.log",
        ],
    );
    let missing = "colmap run pictures --out other --colmap ./nowhere";
    place.fails(missing, &["./nowhere", "apt-get install colmap"]);
    place.fails(
        "colmap run room --out other --colmap ./colmap",
        &["EXR images"],
    );
}
