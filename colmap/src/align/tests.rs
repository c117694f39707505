//! Rooms whose floor is known, in frames that are not upright.

use super::*;
use crate::model::{
    CameraId, ImageId, ModelCamera, ModelImage, ModelPoint, Observations, PointId, Rigid,
};
use eagpt_scene::Lens;
use eagpt_scene::lens::LensModel;
use eagpt_scene::rng::{Purpose, RandomKey, RandomStream};
use std::path::PathBuf;

/// A room of 6 × 4 × 2.6 metres with its floor on z = 0.
struct Room {
    points: Vec<DVec3>,
    world_from_camera: Vec<Rigid>,
    random: RandomStream,
}

const ROOM: DVec3 = DVec3::new(6.0, 4.0, 2.6);
/// Noise of points, metres.
const NOISE: f64 = 0.004;

impl Room {
    fn new() -> Self {
        let mut room = Self {
            points: Vec::new(),
            world_from_camera: Vec::new(),
            random: RandomKey::new(3, Purpose::Initialise, 0).stream(0, 0),
        };
        room.cameras(48);
        let (x, y, z) = (DVec3::X * ROOM.x, DVec3::Y * ROOM.y, DVec3::Z * ROOM.z);
        let corner = DVec3::new(-3.0, -2.0, 0.0);
        room.patch(300, corner, [x, y]);
        room.patch(120, corner + z, [x, y]);
        room.patch(250, corner, [x, z]);
        room.patch(250, corner + y, [x, z]);
        room.patch(160, corner, [y, z]);
        room.patch(160, corner + x, [y, z]);
        // A cupboard, and points that are nowhere.
        room.patch(
            100,
            DVec3::new(-3.0, 1.4, 0.0),
            [DVec3::X * 2.0, DVec3::Z * 0.9],
        );
        for _ in 0..30 {
            let at = room.uniforms();
            room.points.push((at * 2.0 - 0.5) * ROOM + corner);
        }
        room
    }

    fn uniforms(&mut self) -> DVec3 {
        let [a, b, c, _] = self.random.next_uniforms().map(f64::from);
        DVec3::new(a, b, c)
    }

    /// Points on a rectangle.
    fn patch(&mut self, num: usize, corner: DVec3, [u, v]: [DVec3; 2]) {
        for _ in 0..num {
            let at = self.uniforms();
            let noise = (self.uniforms() - 0.5) * (NOISE * 12.0_f64.sqrt());
            self.points.push(corner + u * at.x + v * at.y + noise);
        }
    }

    fn table(&mut self, num: usize) {
        let top = DVec3::new(-0.9, -0.6, 0.75);
        self.patch(num, top, [DVec3::X * 1.8, DVec3::Y * 1.2]);
    }

    /// Cameras at eye level that look around, with a roll of a degree or two.
    fn cameras(&mut self, num: usize) {
        for i in 0..num {
            let at = self.uniforms();
            let turn = self.uniforms();
            let yaw = std::f64::consts::TAU * i as f64 / num as f64;
            let pitch = -0.3 + 0.4 * turn.x;
            let roll = 0.06 * (turn.y - 0.5);
            // OpenCV axes of a camera that looks along y, upright; then roll, pitch, yaw.
            let level = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
            let axes = DMat3::from_rotation_z(yaw)
                * DMat3::from_rotation_x(pitch)
                * level
                * DMat3::from_rotation_z(roll);
            self.world_from_camera.push(Rigid {
                rotation: DQuat::from_mat3(&axes),
                translation: DVec3::new(4.0 * at.x - 2.0, 2.4 * at.y - 1.2, 1.3 + 0.4 * at.z),
            });
        }
    }

    /// Turns every camera about its optical axis, as if it were held another way.
    fn roll(&mut self, angle: f64) {
        for pose in &mut self.world_from_camera {
            pose.rotation *= DQuat::from_rotation_z(angle);
        }
    }

    /// The model in a frame of its own.
    fn model(&self, model_from_room: &Similarity) -> Model {
        let params = [500.0, 320.0, 240.0];
        let images = self
            .world_from_camera
            .iter()
            .enumerate()
            .map(|(i, pose)| ModelImage {
                id: ImageId(i as u32 + 1),
                camera_from_world: pose.inverse(),
                camera: CameraId(1),
                name: format!("{i:04}.jpg"),
                observations: Vec::new(),
            });
        let points = self
            .points
            .iter()
            .enumerate()
            .map(|(i, position)| ModelPoint {
                id: PointId(i as u64 + 1),
                position: *position,
                color_srgb8: [128; 3],
                error_px: 0.5,
                track_length: 5,
                track: Vec::new(),
            });
        let mut model = Model {
            cameras: vec![ModelCamera {
                id: CameraId(1),
                lens: Lens::new(LensModel::SimplePinhole, (640, 480), &params).unwrap(),
            }],
            images: images.collect(),
            points: points.collect(),
            rigs: None,
            frames: None,
        };
        model.transform(model_from_room);
        model
    }
}

fn frame(scale: f64, angles: [f64; 3]) -> Similarity {
    let [a, b, c] = angles;
    Similarity {
        scale,
        rotation: DQuat::from_euler(glam::EulerRot::XYZ, a, b, c),
        translation: DVec3::new(3.0, -7.0, 11.0) * scale,
    }
}

/// How far the aligned room is from the room: tilt and yaw in degrees, floor height in sizes of the room.
fn errors(alignment: &Alignment, model_from_room: &Similarity) -> [f64; 3] {
    let aligned_from_room = |p: DVec3| alignment.aligned_from_model.apply(model_from_room.apply(p));
    let origin = aligned_from_room(DVec3::ZERO);
    let scale = (aligned_from_room(DVec3::Z) - origin).length();
    let up = (aligned_from_room(DVec3::Z) - origin) / scale;
    let along = (aligned_from_room(DVec3::X) - origin) / scale;
    let yaw = along.y.atan2(along.x).to_degrees();
    let quarter = (yaw / 90.0).round() * 90.0;
    let tilt = up.truncate().length().atan2(up.z).to_degrees();
    [
        tilt,
        (yaw - quarter).abs(),
        (origin.z / scale / ROOM.length()).abs(),
    ]
}

#[track_caller]
fn assert_upright(alignment: &Alignment, model_from_room: &Similarity) {
    let [tilt, yaw, height] = errors(alignment, model_from_room);
    // What is asked for: 0.5°, 1° and 0.5 %. 300 points of 4 mm over 4 m let expect 0.02° and 0.01 %.
    assert!(tilt < 0.1, "tilt {tilt}°: {alignment:?}");
    assert!(yaw < 0.3, "yaw {yaw}°: {alignment:?}");
    assert!(height < 1e-3, "height {height}: {alignment:?}");
}

fn aligned(room: &Room, model_from_room: &Similarity) -> Alignment {
    align(&room.model(model_from_room), &AlignOptions::default()).unwrap()
}

#[track_caller]
fn refused(model: &Model, options: &AlignOptions, parts: &[&str]) {
    let message = align(model, options).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    for part in parts {
        assert!(message.contains(part), "no `{part}` in: {message}");
    }
}

#[test]
fn any_frame_and_unit_become_upright() {
    let room = Room::new();
    for model_from_room in [
        frame(1.0, [0.0, 0.0, 0.0]),
        frame(0.01, [1.0, -0.4, 2.0]),
        frame(40.0, [std::f64::consts::PI, 0.3, 0.2]),
        frame(3.0, [std::f64::consts::FRAC_PI_2, 0.0, 1.0]),
    ] {
        let alignment = aligned(&room, &model_from_room);
        assert_upright(&alignment, &model_from_room);
        let floor = alignment.floor.as_ref().unwrap();
        assert!(
            floor.confidence > 0.7 && floor.num_inliers > 250,
            "{floor:?}"
        );
        // x is the longer side.
        let x = model_from_room.rotation * DVec3::X;
        let turned = alignment.aligned_from_model.rotation * x;
        assert!(turned.x.abs() > 0.99, "{turned}");
        let height = alignment.camera_height.unwrap() / model_from_room.scale;
        assert!((1.4..1.6).contains(&height), "{height}");
    }
}

#[test]
fn a_table_is_no_floor() {
    let mut room = Room::new();
    // Three times as many points as the floor.
    room.table(900);
    let model_from_room = frame(0.7, [2.0, 0.4, -1.0]);
    let alignment = aligned(&room, &model_from_room);
    assert_upright(&alignment, &model_from_room);
    assert!(alignment.floor.unwrap().num_planes >= 2);
}

#[test]
fn a_table_without_a_floor_is_refused() {
    let mut room = Room::new();
    room.points.retain(|p| p.z > 0.05);
    room.table(900);
    let model = room.model(&frame(0.7, [2.0, 0.4, -1.0]));
    refused(
        &model,
        &AlignOptions::default(),
        &["no floor to be sure of"],
    );
}

#[test]
fn a_room_without_a_floor_is_refused() {
    let mut room = Room::new();
    room.points.retain(|p| p.z > 0.05);
    let model = room.model(&Similarity::IDENTITY);
    refused(&model, &AlignOptions::default(), &["no floor"]);
    room.points.truncate(20);
    let few = room.model(&Similarity::IDENTITY);
    refused(&few, &AlignOptions::default(), &["20 points", "too few"]);
}

#[test]
fn the_ceiling_in_a_polished_floor_is_no_floor() {
    let mut room = Room::new();
    let above: Vec<DVec3> = room.points.iter().copied().filter(|p| p.z > 0.05).collect();
    // Half of what is above is seen in the floor, and the ceiling whole.
    let seen = above
        .iter()
        .enumerate()
        .filter(|(i, p)| i % 2 == 0 || p.z > 2.55);
    let mirrored = seen.map(|(_, p)| DVec3::new(p.x, p.y, -p.z));
    room.points.extend(mirrored);
    let model_from_room = frame(1.3, [0.3, 2.4, -1.0]);
    let alignment = aligned(&room, &model_from_room);
    assert_upright(&alignment, &model_from_room);
    let floor = alignment.floor.unwrap();
    assert!(floor.num_mirrored > 5 * floor.num_below, "{floor:?}");
}

#[test]
fn cameras_held_sideways_are_understood() {
    for angle in [std::f64::consts::FRAC_PI_2, -std::f64::consts::FRAC_PI_2] {
        let mut room = Room::new();
        room.table(300);
        room.roll(angle);
        let model_from_room = frame(1.0, [-0.8, 0.5, 0.1]);
        let alignment = aligned(&room, &model_from_room);
        assert_upright(&alignment, &model_from_room);
        assert_eq!(alignment.gravity.as_ref().unwrap().held, "sideways");
        assert!(alignment.warnings[0].contains("on their side"));
    }
}

#[test]
fn cameras_upside_down_are_refused_until_told() {
    let mut room = Room::new();
    room.table(2500);
    room.roll(std::f64::consts::PI);
    let model_from_room = frame(1.0, [-0.8, 0.5, 0.1]);
    let model = room.model(&model_from_room);
    refused(
        &model,
        &AlignOptions::default(),
        &["upside down", "is up; say which"],
    );
    let up = model_from_room.rotation * DVec3::new(0.03, -0.04, 1.0);
    let told = AlignOptions {
        manual: Manual {
            up: Some(up.to_array()),
            ..Manual::default()
        },
        ..AlignOptions::default()
    };
    assert_upright(&align(&model, &told).unwrap(), &model_from_room);
}

#[test]
fn the_user_may_say_where_the_floor_is() {
    let room = Room::new();
    let model_from_room = frame(2.0, [0.4, -2.5, 0.9]);
    let model = room.model(&model_from_room);
    let corners = [[-3.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-3.0, 2.0]];
    let positions = corners.map(|[x, y]| model_from_room.apply(DVec3::new(x, y, 0.0)).to_array());
    let with = |manual: Manual| AlignOptions {
        mode: Mode::Manual,
        manual,
        ..AlignOptions::default()
    };
    let four = with(Manual {
        floor_positions: positions.to_vec(),
        ..Manual::default()
    });
    let one = with(Manual {
        up: Some((model_from_room.rotation * DVec3::Z).to_array()),
        floor_positions: vec![positions[0]],
        ..Manual::default()
    });
    let numbered = with(Manual {
        // The first 300 points are the floor's.
        floor_points: (1..=300).map(PointId).collect(),
        ..Manual::default()
    });
    for options in [four, one, numbered] {
        let alignment = align(&model, &options).unwrap();
        assert_upright(&alignment, &model_from_room);
        assert_eq!(alignment.confidence, Some(1.0));
    }
    let line = with(Manual {
        floor_positions: vec![[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]],
        ..Manual::default()
    });
    refused(&model, &line, &["on a line"]);
    refused(&model, &with(Manual::default()), &["three points"]);
    let missing = with(Manual {
        floor_points: vec![PointId(1), PointId(2), PointId(99_999)],
        ..Manual::default()
    });
    refused(&model, &missing, &["no point 99999"]);
}

#[test]
fn a_known_length_makes_metres() {
    let room = Room::new();
    let model_from_room = frame(0.37, [0.4, -2.5, 0.9]);
    let model = room.model(&model_from_room);
    let [a, b] = [0, 7].map(|i: usize| room.world_from_camera[i].translation);
    let distance = Scale::Distance {
        from: "0000.jpg".parse().unwrap(),
        to: "0007.jpg".parse().unwrap(),
        metres: (a - b).length(),
    };
    let heights = room.world_from_camera.iter().map(|pose| pose.translation.z);
    let height = Scale::CameraHeight {
        metres: numeric::median(heights.collect()),
    };
    for scale in [distance, height] {
        let options = AlignOptions {
            scale: Some(scale),
            ..AlignOptions::default()
        };
        let alignment = align(&model, &options).unwrap();
        // The height is as exact as the floor is flat; the distance to rounding.
        let factor = alignment.aligned_from_model.scale * 0.37;
        assert!(
            alignment.is_metric && (factor - 1.0).abs() < 2e-3,
            "{factor}"
        );
        assert_upright(&alignment, &model_from_room);
    }
    let unknown = AlignOptions {
        scale: Some(Scale::Distance {
            from: "0000.jpg".parse().unwrap(),
            to: "point:77777".parse().unwrap(),
            metres: 1.0,
        }),
        ..AlignOptions::default()
    };
    refused(&model, &unknown, &["known_distance", "no point 77777"]);
}

/// The kitchen's COLMAP model, or `None` after saying that the test is skipped.
fn kitchen(test: &str) -> Option<PathBuf> {
    eagpt_testkit::test_data(test, "colmap-kitchen")
}

#[test]
fn known_cameras_bring_their_world_back() {
    let room = Room::new();
    let num = room.world_from_camera.len();
    let model_from_room = frame(3.7, [0.4, -1.1, 2.0]);
    let model = room.model(&model_from_room);
    let known: Vec<KnownCamera> = room
        .world_from_camera
        .iter()
        .enumerate()
        .map(|(i, pose)| KnownCamera {
            name: format!("{i:04}"),
            centre: pose.translation.to_array(),
        })
        .collect();
    let with = |known_cameras: Vec<KnownCamera>| AlignOptions {
        mode: Mode::Reference,
        known_cameras,
        ..AlignOptions::default()
    };
    let found = align(&model, &with(known.clone())).unwrap();
    for point in [DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)] {
        let back = found.aligned_from_model.apply(model_from_room.apply(point));
        // Sums of doubles of a few units.
        assert!((back - point).length() < 1e-9, "{back} for {point}");
    }
    let report = found.reference.unwrap();
    assert_eq!(report.num_cameras, num);
    assert!((report.scale * 3.7 - 1.0).abs() < 1e-9 && report.largest_error < 1e-9);

    let problem = align(&model, &with(known[..2].to_vec()))
        .unwrap_err()
        .to_string();
    assert!(problem.contains("2 images of the model"), "{problem}");
    let mut shuffled = known.clone();
    for (i, camera) in shuffled.iter_mut().enumerate() {
        camera.centre = known[(5 * i + 3) % num].centre;
    }
    let problem = align(&model, &with(shuffled)).unwrap_err().to_string();
    assert!(problem.contains("not the same"), "{problem}");
}

#[test]
fn the_kitchen_becomes_upright() {
    let Some(root) = kitchen("the_kitchen_becomes_upright") else {
        return;
    };
    let model = Model::read(&root.join("sparse"), Observations::Keep).unwrap();
    let sorted = |mut model: Model| {
        model.images.sort_by_key(|image| image.id);
        model.points.sort_by_key(|point| point.id);
        model.frames.as_mut().unwrap().sort_by_key(|frame| frame.id);
        model
    };
    let text = Model::read(&root.join("sparse-txt"), Observations::Keep).unwrap();
    assert!(
        sorted(text) == sorted(model.clone()),
        "text and binary differ"
    );
    let truth: serde_json::Value =
        serde_json::from_slice(&std::fs::read(root.join("true_cameras.json")).unwrap()).unwrap();
    let frames = truth["frames"].as_array().unwrap();
    let (mut own, mut world) = (Vec::new(), Vec::new());
    for image in &model.images {
        let name = image.name.trim_end_matches(".jpg");
        let frame = frames
            .iter()
            .find(|frame| frame["file_name"] == name)
            .unwrap();
        let at = |row: usize| frame["transform_matrix"][row][3].as_f64().unwrap();
        own.push(image.camera_from_world.centre());
        world.push(DVec3::new(at(0), at(1), at(2)));
    }
    let model_from_world = similarity(&world, &own).unwrap();
    let alignment = align(&model, &AlignOptions::default()).unwrap();
    let [tilt, yaw, height] = errors(&alignment, &model_from_world);
    let size = numeric::size(&model.points.iter().map(|p| p.position).collect::<Vec<_>>());
    // `errors` counts in sizes of the other room; walls of the kitchen go along x and y.
    let height = height * ROOM.length() * model_from_world.scale / size;
    assert!(
        tilt <= 0.5 && yaw <= 1.0 && height <= 0.005,
        "{tilt}° {yaw}° {height} {alignment:#?}"
    );
    // Alignment changes nothing else.
    let mut moved = model.clone();
    moved.transform(&alignment.aligned_from_model);
    let centres: Vec<DVec3> = moved
        .images
        .iter()
        .map(|i| i.camera_from_world.centre())
        .collect();
    let back = similarity(&centres, &own).unwrap();
    for (moved, image) in moved.images.iter().zip(&model.images) {
        let again = back.camera_from_new(&moved.camera_from_world);
        let own = &image.camera_from_world;
        assert!((again.centre() - own.centre()).length() < 1e-9);
        assert!(again.rotation.dot(own.rotation).abs() > 1.0 - 1e-12);
    }
    for frame in moved.frames.as_ref().unwrap() {
        let image = frame.data[0].1;
        let image = moved
            .images
            .iter()
            .find(|i| u64::from(i.id.0) == image)
            .unwrap();
        let offset = frame.rig_from_world.centre() - image.camera_from_world.centre();
        assert!(offset.length() < 1e-12);
    }
    println!(
        "kitchen: tilt {tilt:.3}°, yaw {yaw:.3}°, height {:.3} % of the size",
        100.0 * height
    );
}
