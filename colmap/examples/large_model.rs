//! Writes a binary model of a large room, to measure the time of an import: a million points, 2,000
//! images, ten million observations.
//!
//!     cargo run --release -p eagpt-colmap --example large_model -- out/large
//!     time eagpt colmap import out/large --out out/dataset

#![allow(clippy::print_stdout, reason = "an example tells what it did")]

use eagpt_colmap::model::{
    CameraId, Form, ImageId, Model, ModelCamera, ModelImage, ModelPoint, Observation, Observations,
    PointId, Rigid, TrackElement,
};
use eagpt_scene::Lens;
use eagpt_scene::lens::LensModel;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::path::PathBuf;
use std::time::Instant;

const NUM_POINTS: u32 = 1_000_000;
const NUM_IMAGES: u32 = 2_000;
const TRACK_LENGTH: u32 = 10;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::env::args_os().nth(1).map(PathBuf::from);
    let out = out.ok_or("name a folder for the model")?;
    model()?.write(&out, Form::Binary)?;
    for observations in [Observations::Keep, Observations::Skip] {
        let start = Instant::now();
        let model = Model::read(&out, observations)?;
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{observations:?}: {} points read in {seconds:.2} s",
            model.points.len()
        );
    }
    Ok(())
}

/// A room of 12 × 8 × 3 units, z down.
fn model() -> Result<Model, String> {
    let params = [1800.0, 1800.0, 1200.0, 800.0, -0.1, 0.02, 0.0, 0.0];
    let key = RandomKey::new(1, Purpose::Initialise, 0);
    let mut images: Vec<ModelImage> = (0..NUM_IMAGES)
        .map(|i| {
            let [x, y, z, _] = key.stream(i, 0).next_uniforms().map(f64::from);
            let yaw = DMat3::from_rotation_z(0.37 * f64::from(i));
            // Camera axes as columns: right, down, forward, in a world whose z points down.
            let level = DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y);
            let world_from_camera = Rigid {
                rotation: DQuat::from_mat3(&(yaw * level)),
                translation: DVec3::new(10.0 * x - 5.0, 6.0 * y - 3.0, -1.4 - 0.3 * z),
            };
            ModelImage {
                id: ImageId(i + 1),
                camera_from_world: world_from_camera.inverse(),
                camera: CameraId(1),
                name: format!("{i:05}.jpg"),
                observations: Vec::new(),
            }
        })
        .collect();
    let mut points = Vec::with_capacity(NUM_POINTS as usize);
    for i in 0..NUM_POINTS {
        let [u, v, w, _] = key.stream(i, 1).next_uniforms().map(f64::from);
        let (u, v) = (12.0 * u - 6.0, 8.0 * v - 4.0);
        let position = match i % 4 {
            0 => DVec3::new(u, v, 0.004 * (w - 0.5)),
            1 => DVec3::new(u, 4.0_f64.copysign(v), -3.0 * w),
            2 => DVec3::new(6.0_f64.copysign(u), v, -3.0 * w),
            _ => DVec3::new(u, v, -3.0),
        };
        let id = PointId(u64::from(i));
        let mut track = Vec::with_capacity(TRACK_LENGTH as usize);
        for k in 0..TRACK_LENGTH {
            let index = (i.wrapping_mul(7) + 131 * k) % NUM_IMAGES;
            let image = &mut images[index as usize];
            track.push(TrackElement {
                image: image.id,
                observation: u32::try_from(image.observations.len()).map_err(|e| e.to_string())?,
            });
            image.observations.push(Observation {
                at: DVec2::new(100.0, 200.0),
                point: Some(id),
            });
        }
        points.push(ModelPoint {
            id,
            position,
            color_srgb8: [120, 110, 100],
            error_px: 0.6,
            track_length: TRACK_LENGTH,
            track,
        });
    }
    Ok(Model {
        cameras: vec![ModelCamera {
            id: CameraId(1),
            lens: Lens::new(LensModel::OpenCv, (2400, 1600), &params)?,
        }],
        images,
        points,
        rigs: None,
        frames: None,
    })
}
