//! A room with a table, photographed all around, as COLMAP would know it.

use super::super::*;
use crate::model::{CameraId, ImageId, ModelCamera, ModelImage, ModelPoint, PointId, Rigid};
use eagpt_scene::Lens;
use eagpt_scene::lens::LensModel;
use eagpt_scene::rng::{Purpose, RandomKey, RandomStream};

/// A room of 6 × 4 × 2.6 metres with its floor on z = 0.
pub(super) struct Room {
    pub(super) points: Vec<DVec3>,
    pub(super) world_from_camera: Vec<Rigid>,
    pub(super) random: RandomStream,
}

pub(super) const ROOM: DVec3 = DVec3::new(6.0, 4.0, 2.6);
/// Noise of points, metres.
const NOISE: f64 = 0.004;

impl Room {
    pub(super) fn new() -> Self {
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

    pub(super) fn uniforms(&mut self) -> DVec3 {
        let [a, b, c, _] = self.random.next_uniforms().map(f64::from);
        DVec3::new(a, b, c)
    }

    /// Points on a rectangle.
    pub(super) fn patch(&mut self, num: usize, corner: DVec3, [u, v]: [DVec3; 2]) {
        for _ in 0..num {
            let at = self.uniforms();
            let noise = (self.uniforms() - 0.5) * (NOISE * 12.0_f64.sqrt());
            self.points.push(corner + u * at.x + v * at.y + noise);
        }
    }

    pub(super) fn table(&mut self, num: usize) {
        let top = DVec3::new(-0.9, -0.6, 0.75);
        self.patch(num, top, [DVec3::X * 1.8, DVec3::Y * 1.2]);
    }

    /// Cameras at eye level that look around, with a roll of a degree or two.
    pub(super) fn cameras(&mut self, num: usize) {
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
    pub(super) fn roll(&mut self, angle: f64) {
        for pose in &mut self.world_from_camera {
            pose.rotation *= DQuat::from_rotation_z(angle);
        }
    }

    /// The model in a frame of its own.
    pub(super) fn model(&self, model_from_room: &Similarity) -> Model {
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

pub(super) fn frame(scale: f64, angles: [f64; 3]) -> Similarity {
    let [a, b, c] = angles;
    Similarity {
        scale,
        rotation: DQuat::from_euler(glam::EulerRot::XYZ, a, b, c),
        translation: DVec3::new(3.0, -7.0, 11.0) * scale,
    }
}
