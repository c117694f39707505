//! nerfstudio's `transforms.json`.
//!
//! `applied_transform` is the identity: the world of the file is that of the dataset. It is written
//! because nerfstudio assumes another one beside a COLMAP model. `up_axis` and similar keys are
//! ours; other programs ignore them.

use super::IMAGES_DIR;
use crate::error::Result;
use eagpt_scene::dataset::{TRANSFORMS_FILE, UpAxis, pose};
use eagpt_scene::ply::{self, PointCloud};
use eagpt_scene::{Camera, Dataset, files};
use serde_json::{Map, Value, json};
use std::path::Path;

/// The point cloud, by nerfstudio's own name.
pub(super) const POINTS_FILE: &str = "sparse_pc.ply";

pub(super) fn write(dataset: &Dataset, points: Option<&PointCloud>, out: &Path) -> Result<()> {
    if let Some(points) = points {
        ply::write_points(&out.join(POINTS_FILE), points)?;
    }
    let mut top = Map::new();
    top.insert("camera_model".to_owned(), json!("PINHOLE"));
    let cameras = || dataset.frames().iter().map(|frame| &frame.camera);
    let first = &dataset.frames()[0].camera;
    let shared = cameras().all(|camera| intrinsics(camera) == intrinsics(first));
    if shared {
        top.extend(intrinsics(first));
    }
    let identity = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ];
    top.insert("applied_transform".to_owned(), json!(identity));
    let info = dataset.info();
    if let Some(axis) = info.up_axis {
        top.insert("up_axis".to_owned(), json!(axis.name()));
        if axis != UpAxis::Z {
            // Otherwise nerfstudio would take z for up when told not to estimate it.
            top.insert("orientation_override".to_owned(), json!("up"));
        }
    }
    if let Some(metres) = info.metres_per_unit {
        top.insert("metres_per_unit".to_owned(), json!(metres));
    }
    if let Some(rows) = info.aligned_from_model {
        top.insert("aligned_from_model".to_owned(), json!(rows));
    }
    if points.is_some() {
        top.insert("ply_file_path".to_owned(), json!(POINTS_FILE));
    }
    for (key, names) in [
        ("train_filenames", info.train_names.as_ref()),
        ("test_filenames", info.test_names.as_ref()),
        // nerfstudio evaluates on this list while it trains.
        (
            "val_filenames",
            info.validation_names.as_ref().or(info.test_names.as_ref()),
        ),
    ] {
        if let Some(names) = names {
            let paths: Vec<String> = names.iter().map(|name| image_path(name)).collect();
            top.insert(key.to_owned(), json!(paths));
        }
    }
    let frames = dataset.frames().iter().map(|frame| {
        let mut object = Map::new();
        object.insert("file_path".to_owned(), json!(image_path(&frame.name)));
        if !shared {
            object.extend(intrinsics(&frame.camera));
        }
        let matrix = pose::to_json(&frame.camera.world_from_camera);
        object.insert("transform_matrix".to_owned(), matrix);
        Value::Object(object)
    });
    let frames = frames.collect();
    top.insert("frames".to_owned(), Value::Array(frames));
    let path = out.join(TRANSFORMS_FILE);
    Ok(files::write_json(&path, &top)?)
}

fn image_path(name: &str) -> String {
    format!("{IMAGES_DIR}/{name}.exr")
}

fn intrinsics(camera: &Camera) -> Map<String, Value> {
    let entries = [
        ("fl_x", json!(camera.fx)),
        ("fl_y", json!(camera.fy)),
        ("cx", json!(camera.cx)),
        ("cy", json!(camera.cy)),
        ("w", json!(camera.width)),
        ("h", json!(camera.height)),
    ];
    let entries = entries.into_iter();
    entries
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
}
