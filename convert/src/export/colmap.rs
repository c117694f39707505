//! A COLMAP project: a binary model with pinhole cameras, images and points but no rigs and frames:
//! the form that every version reads.

use crate::error::Result;
use eagpt_colmap::Model;
use eagpt_colmap::model::{
    CameraId, Form, ImageId, ModelCamera, ModelImage, ModelPoint, Part, PointId, Rigid,
};
use eagpt_scene::lens::LensModel;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::{Camera, Dataset, Lens, SceneError};
use glam::DQuat;
use std::path::{Path, PathBuf};

/// Folder in which programs expect the model.
const MODEL_DIR: &str = "sparse/0";

pub(super) fn model_files() -> Vec<PathBuf> {
    let dir = Path::new(MODEL_DIR);
    Part::NEEDED.map(|part| part.path(dir, Form::Binary)).into()
}

pub(super) fn write(dataset: &Dataset, points: Option<&PointCloud>, out: &Path) -> Result<()> {
    let model = model(dataset, points)?;
    Ok(model.write(&out.join(MODEL_DIR), Form::Binary)?)
}

fn model(dataset: &Dataset, points: Option<&PointCloud>) -> Result<Model> {
    let mut model = Model::default();
    for (index, frame) in dataset.frames().iter().enumerate() {
        let lens = lens(&frame.camera).map_err(|problem| {
            SceneError::invalid(dataset.transforms(), frame.name.as_str(), problem)
        })?;
        // Many pictures share few lenses.
        let camera = match model.cameras.iter().find(|camera| camera.lens == lens) {
            Some(camera) => camera.id,
            None => {
                let id = CameraId(model.cameras.len() as u32 + 1);
                model.cameras.push(ModelCamera { id, lens });
                id
            }
        };
        model.images.push(ModelImage {
            id: ImageId(index as u32 + 1),
            camera_from_world: camera_from_world(&frame.camera),
            camera,
            name: format!("{}.exr", frame.name),
            observations: Vec::new(),
        });
    }
    let points = points.into_iter().flat_map(|points| {
        let both = points.positions.iter().zip(&points.colors_srgb8);
        both.enumerate()
    });
    model.points = points
        .map(|(index, (position, color))| ModelPoint {
            id: PointId(index as u64 + 1),
            position: position.as_dvec3(),
            color_srgb8: *color,
            error_px: -1.0,
            track_length: 0,
            track: Vec::new(),
        })
        .collect();
    Ok(model)
}

fn lens(camera: &Camera) -> std::result::Result<Lens, String> {
    let params = [camera.fx, camera.fy, camera.cx, camera.cy];
    Lens::new(LensModel::Pinhole, (camera.width, camera.height), &params)
}

fn camera_from_world(camera: &Camera) -> Rigid {
    let pose = &camera.world_from_camera;
    let rotation = DQuat::from_mat3(&pose.matrix3).normalize().inverse();
    Rigid {
        rotation,
        translation: -(rotation * pose.translation),
    }
}
