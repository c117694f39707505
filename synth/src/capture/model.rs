//! The COLMAP model that a reconstruction of the capture would have given: in a frame of its own, a
//! little off.

use super::Simulation;
use super::shot::position_name;
use crate::error::{Result, SynthError};
use crate::photograph::Photograph;
use crate::room::LIFT;
use eagpt_colmap::model::{
    CameraId, Form, ImageId, Model, ModelCamera, ModelImage, ModelPoint, Observation, PointId,
    Rigid, Similarity, TrackElement,
};
use eagpt_scene::Camera;
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::lens::Lens;
use eagpt_scene::rng::{Purpose, RandomKey, RandomStream};
use glam::{DQuat, DVec2, DVec3, Vec3};
use std::path::PathBuf;

/// Points that are begun in each view.
const POINTS_OF_VIEW: u32 = 500;
/// Standard deviation of a feature's place, pixels of the sensor.
const FEATURE_NOISE_PX: f64 = 0.4;
/// Standard deviation of a point along each axis, in pixels of the sensor at its distance.
const POINT_NOISE_PX: f64 = 1.0;
/// Standard deviation of a camera's centre, metres, and of its rotation, radians.
const POSE_NOISE: [f64; 2] = [0.001, 2e-4];
/// Standard deviation of focal lengths, relative, and of distortion.
const LENS_NOISE: [f64; 2] = [2e-4, 2e-4];
/// Share of points that are nowhere near a surface.
const OUTLIERS: f32 = 0.01;

/// Folder of the model.
pub(super) const MODEL_DIR: &str = "colmap/sparse/0";

/// Its files, relative to the capture.
pub(super) fn files() -> [PathBuf; 3] {
    ["cameras.bin", "images.bin", "points3D.bin"].map(|file| PathBuf::from(MODEL_DIR).join(file))
}

/// Points seen so far.
pub(super) struct ModelSource {
    key: RandomKey,
    lens: Lens,
    images: Vec<ModelImage>,
    points: Vec<ModelPoint>,
}

impl ModelSource {
    pub(super) fn new(job: &Simulation<'_>, lens: Lens) -> Self {
        let key = RandomKey::new(job.options.seed, Purpose::Capture, u32::MAX - 1);
        let images = (0..).zip(&job.cameras).map(|(index, camera)| {
            let mut random = key.stream(index, 1);
            let pose = camera.world_from_camera;
            let turn = normals(&mut random) * POSE_NOISE[1];
            let centre = pose.translation + normals(&mut random) * POSE_NOISE[0];
            let world_from_camera = Rigid {
                rotation: DQuat::from_scaled_axis(turn) * DQuat::from_mat3(&pose.matrix3),
                translation: centre,
            };
            ModelImage {
                id: ImageId(index + 1),
                camera_from_world: world_from_camera.inverse(),
                camera: CameraId(1),
                name: format!("{}.png", position_name(index as usize)),
                observations: Vec::new(),
            }
        });
        Self {
            key,
            lens,
            images: images.collect(),
            points: Vec::new(),
        }
    }

    /// Begins points at features of a view and looks for them in all others.
    pub(super) fn look(&mut self, job: &Simulation<'_>, index: usize, photograph: &Photograph) {
        let camera = &job.cameras[index];
        let picture = photograph.fine(0);
        for point in 0..POINTS_OF_VIEW {
            let mut random = self.key.stream(index as u32, 2 + point);
            let [word, ..] = random.next_words();
            let pixel = word as usize % photograph.centres().len();
            let Some(hit) = photograph.centres()[pixel] else {
                continue;
            };
            let num_cells = job.script.rig.oversampling;
            let width = picture.width() / num_cells;
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            let color = picture
                .get(x * num_cells, y * num_cells)
                .map(srgb8_from_linear);
            let lifted = hit.position + hit.normal * LIFT;
            let seen = (0..).zip(&job.cameras).filter_map(|(image, other)| {
                let at = self.feature(other, hit.position)?;
                let faces = hit.normal.dot(other.origin() - hit.position) > 0.0;
                (faces && job.lighting.room.is_free(lifted, other.origin())).then_some((image, at))
            });
            let seen: Vec<(usize, DVec2)> = seen.collect();
            // A point takes two views.
            if seen.len() < 2 {
                continue;
            }
            let distance = f64::from(camera.origin().distance(hit.position));
            let spread = POINT_NOISE_PX * distance / self.lens.focal().x;
            let mut position = hit.position.as_dvec3() + normals(&mut random) * spread;
            let [chance, ..] = random.next_uniforms();
            if chance < OUTLIERS {
                position += normals(&mut random) * (0.3 * distance);
            }
            self.add(position, color, &seen, &mut random);
        }
    }

    /// Projection of a point of the room into a camera.
    fn feature(&self, camera: &Camera, position: Vec3) -> Option<DVec2> {
        let at = camera
            .world_from_camera
            .inverse()
            .transform_point3(position.as_dvec3());
        let pixel = self.lens.project(at).filter(|_| at.z > 0.0)?;
        self.lens.contains(pixel).then_some(pixel)
    }

    fn add(
        &mut self,
        position: DVec3,
        color_srgb8: [u8; 3],
        seen: &[(usize, DVec2)],
        random: &mut RandomStream,
    ) {
        let id = PointId(self.points.len() as u64 + 1);
        let (mut track, mut error_px) = (Vec::with_capacity(seen.len()), 0.0);
        for &(image, at) in seen {
            let image = &mut self.images[image];
            let at = at + normals(random).truncate() * FEATURE_NOISE_PX;
            let from_model = image.camera_from_world.apply(position);
            error_px += self
                .lens
                .project(from_model)
                .map_or(0.0, |p| p.distance(at));
            track.push(TrackElement {
                image: image.id,
                observation: image.observations.len() as u32,
            });
            image.observations.push(Observation {
                at,
                point: Some(id),
            });
        }
        self.points.push(ModelPoint {
            id,
            position,
            color_srgb8,
            error_px: error_px / seen.len() as f64,
            track_length: seen.len() as u32,
            track,
        });
    }

    /// Writes the model in its own frame, and returns the transform that takes it there.
    pub(super) fn write(self, job: &Simulation<'_>) -> Result<Similarity> {
        let mut random = self.key.stream(0, 0);
        let mut params = self.lens.params().to_vec();
        let [a, b, c] = normals(&mut random).to_array();
        params[0] *= 1.0 + LENS_NOISE[0] * a;
        params[1] *= 1.0 + LENS_NOISE[0] * a;
        params[4] += LENS_NOISE[1] * b;
        params[5] += LENS_NOISE[1] * c;
        let lens = Lens::new(self.lens.model(), self.lens.size(), &params);
        let [u, v, w, s] = random.next_uniforms().map(f64::from);
        let model_from_world = Similarity {
            scale: 0.25 * 8.0_f64.powf(s),
            rotation: uniform_rotation([u, v, w]),
            translation: normals(&mut random) * 2.0,
        };
        let mut model = Model {
            cameras: vec![ModelCamera {
                id: CameraId(1),
                lens: lens.unwrap_or(self.lens),
            }],
            images: self.images,
            points: self.points,
            rigs: None,
            frames: None,
        };
        model.transform(&model_from_world);
        model
            .write(&job.out.join(MODEL_DIR), Form::Binary)
            .map_err(SynthError::from)?;
        Ok(model_from_world)
    }
}

/// Three standard normal numbers (Box and Muller 1958).
fn normals(random: &mut RandomStream) -> DVec3 {
    let [a, b, c, d] = random.next_uniforms().map(f64::from);
    let radius = |u: f64| (-2.0 * (1.0 - u).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * b).sin_cos();
    let third = (std::f64::consts::TAU * d).cos();
    DVec3::new(radius(a) * cos, radius(a) * sin, radius(c) * third)
}

/// A rotation, all equally likely, for three uniform numbers (Shoemake 1992).
fn uniform_rotation([u, v, w]: [f64; 3]) -> DQuat {
    let turn = std::f64::consts::TAU;
    let (low, high) = ((1.0 - u).sqrt(), u.sqrt());
    DQuat::from_xyzw(
        low * (turn * v).sin(),
        low * (turn * v).cos(),
        high * (turn * w).sin(),
        high * (turn * w).cos(),
    )
}
