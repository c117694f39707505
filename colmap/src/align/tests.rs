//! Rooms whose floor is known, in frames that are not upright.

mod kitchen;
mod room;

use super::*;
use crate::model::PointId;
use room::{ROOM, Room, frame};

/// Errors of the aligned room: tilt and yaw in degrees, floor height in sizes of the
/// room.
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
    // Required: 0.5°, 1° and 0.5 %. 300 points of 4 mm over 4 m let expect 0.02° and 0.01
    // %.
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
