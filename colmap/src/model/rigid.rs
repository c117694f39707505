//! Poses and similarities.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde::Serialize;

/// A rotation and a translation: `x_target = rotation · x_source + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rigid {
    /// Unit quaternion.
    pub rotation: DQuat,
    /// In units of both spaces.
    pub translation: DVec3,
}

impl Rigid {
    /// The transform of a point.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The inverse transform.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// As an affine transform, the rotation as a matrix.
    pub fn affine(&self) -> DAffine3 {
        DAffine3 {
            matrix3: DMat3::from_quat(self.rotation),
            translation: self.translation,
        }
    }

    /// The origin of the target in the source: for a camera from world, the camera's centre.
    pub fn centre(&self) -> DVec3 {
        self.inverse().translation
    }
}

/// A rotation, a scale and a translation: `x_new = scale · rotation · x_old + translation`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Similarity {
    /// Above 0.
    pub scale: f64,
    /// Unit quaternion.
    #[serde(serialize_with = "w_first")]
    pub rotation: DQuat,
    /// In new units.
    pub translation: DVec3,
}

fn w_first<S: serde::Serializer>(rotation: &DQuat, serializer: S) -> Result<S::Ok, S::Error> {
    [rotation.w, rotation.x, rotation.y, rotation.z].serialize(serializer)
}

impl Similarity {
    /// The identity.
    pub const IDENTITY: Self = Self {
        scale: 1.0,
        rotation: DQuat::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// The transform of a point.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.scale * (self.rotation * point) + self.translation
    }

    /// The pose of a camera in the new world, from that in the old one. The camera's own space is
    /// scaled along.
    pub(crate) fn camera_from_new(&self, camera_from_old: &Rigid) -> Rigid {
        let rotation = (camera_from_old.rotation * self.rotation.inverse()).normalize();
        Rigid {
            rotation,
            translation: self.scale * camera_from_old.translation - rotation * self.translation,
        }
    }

    /// Rows of the 4×4 matrix.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        let matrix = DMat3::from_quat(self.rotation) * self.scale;
        let row = |r: usize| {
            let row = matrix.row(r);
            [row.x, row.y, row.z, self.translation[r]]
        };
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_camera_sees_the_same_in_new_units() {
        let new_from_old = Similarity {
            scale: 2.5,
            rotation: DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.0),
            translation: DVec3::new(1.0, -4.0, 0.5),
        };
        let camera = Rigid {
            rotation: DQuat::from_euler(glam::EulerRot::XYZ, -0.7, 0.1, 0.4),
            translation: DVec3::new(0.2, 3.0, -1.0),
        };
        let point = DVec3::new(4.0, -2.0, 7.0);
        let moved = new_from_old.camera_from_new(&camera);
        let error = moved.apply(new_from_old.apply(point)) - 2.5 * camera.apply(point);
        assert!(error.length() < 1e-13);
        assert!((moved.centre() - new_from_old.apply(camera.centre())).length() < 1e-13);
        let rows = new_from_old.rows();
        let by_rows = DVec3::from_array(
            [0, 1, 2]
                .map(|r| rows[r][3] + point.dot(DVec3::new(rows[r][0], rows[r][1], rows[r][2]))),
        );
        assert!((by_rows - new_from_old.apply(point)).length() < 1e-13);
    }
}
