//! A model of another's making.

use super::super::*;
use super::errors;
use super::room::ROOM;
use crate::model::Observations;
use eagpt_testkit::test_data;

#[test]
fn the_kitchen_becomes_upright() {
    let Some(root) = test_data("the_kitchen_becomes_upright", "colmap-kitchen") else {
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
