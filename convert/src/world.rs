//! Worlds and poses of sources: up axis, and conventions that differ from `transforms.json`.

use eagpt_scene::dataset::{UpAxis, pose};
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Tolerance of an up vector's perpendicularity to the viewing direction, as a cosine: that of
/// FIPT's own loader.
const MAX_UP_COSINE: f64 = 2e-3;
/// Tolerance of an up vector's length.
const MAX_UP_LENGTH_ERROR: f64 = 1e-2;

/// The world of an imported dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum World {
    /// That of the source, its up axis stored
    #[default]
    Keep,
    /// Turned so that z is up; axes change places
    ///
    /// Coordinates keep their digits.
    ZUp,
}

impl World {
    /// The rotation into this world from one where `up` points up.
    pub(crate) fn new_from_source(self, up: UpAxis) -> DMat3 {
        match self {
            Self::Keep => DMat3::IDENTITY,
            Self::ZUp => z_up_from(up),
        }
    }
}

/// The rotation that exchanges axes so that `up` becomes z; for y up, x y z become z x y, as
/// nerfstudio turns Eyeful Tower.
fn z_up_from(up: UpAxis) -> DMat3 {
    let rows = match up {
        UpAxis::Z => [DVec3::X, DVec3::Y, DVec3::Z],
        UpAxis::NegZ => [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
        UpAxis::Y => [DVec3::Z, DVec3::X, DVec3::Y],
        UpAxis::NegY => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        UpAxis::X => [DVec3::Y, DVec3::Z, DVec3::X],
        UpAxis::NegX => [DVec3::Z, DVec3::Y, DVec3::NEG_X],
    };
    DMat3::from_cols(rows[0], rows[1], rows[2]).transpose()
}

/// A pose in a rotated world.
pub(crate) fn turned(new_from_old: DMat3, old_from_camera: &DAffine3) -> DAffine3 {
    DAffine3 {
        matrix3: new_from_old * old_from_camera.matrix3,
        translation: new_from_old * old_from_camera.translation,
    }
}

/// The pose of a camera at `origin` facing `target` with `up` upwards in the image: columns
/// up × forward, −up, forward.
///
/// `up` is made perpendicular to the viewing direction, which files with few decimals miss by some
/// 1e-3.
///
/// # Errors
/// The problem: origin and target coincide, or `up` is not of unit length or not perpendicular.
pub(crate) fn from_look_at(origin: DVec3, target: DVec3, up: DVec3) -> Result<DAffine3, String> {
    let forward = (target - origin)
        .try_normalize()
        .ok_or_else(|| format!("target equals the origin {origin}"))?;
    let length = up.length();
    if (length - 1.0).abs() > MAX_UP_LENGTH_ERROR {
        return Err(format!("up is {up}, of length {length:.6}, not 1"));
    }
    let cosine = forward.dot(up);
    if cosine.abs() > MAX_UP_COSINE {
        return Err(format!(
            "up is {up}, not perpendicular to the viewing direction {forward}: the cosine is {cosine:.6}, at most {MAX_UP_COSINE} will do"
        ));
    }
    let up = (up - cosine * forward).normalize();
    Ok(DAffine3 {
        // −up × forward, written without the sign.
        matrix3: DMat3::from_cols(forward.cross(up), -up, forward),
        translation: origin,
    })
}

/// The pose of a camera from its column-major 4×4 matrix camera-from-world with OpenCV axes.
///
/// # Errors
/// The problem: the last row, or columns that are not a rotation.
pub(crate) fn from_camera_from_world(columns: &[[f64; 4]; 4]) -> Result<DAffine3, String> {
    let last = columns.map(|column| column[3]);
    if last != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("last row is {last:?}, not [0, 0, 0, 1]"));
    }
    let column = |c: usize| DVec3::new(columns[c][0], columns[c][1], columns[c][2]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    pose::check_rotation(rotation)?;
    // The inverse, not the transpose: a rotation that is off by rounding must lead back to the same
    // camera.
    Ok(DAffine3 {
        matrix3: rotation,
        translation: column(3),
    }
    .inverse())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_up_axis_becomes_z_by_a_rotation() {
        let all = [
            UpAxis::X,
            UpAxis::NegX,
            UpAxis::Y,
            UpAxis::NegY,
            UpAxis::Z,
            UpAxis::NegZ,
        ];
        for up in all {
            let turn = World::ZUp.new_from_source(up);
            assert_eq!(turn * up.vector().as_dvec3(), DVec3::Z, "{up}");
            assert_eq!(turn.determinant(), 1.0, "{up}");
            assert_eq!(World::Keep.new_from_source(up), DMat3::IDENTITY);
        }
    }

    #[test]
    fn a_camera_that_looks_along_x_with_y_up() {
        let pose = from_look_at(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(3.0, 2.0, 3.0),
            DVec3::Y,
        );
        let pose = pose.unwrap();
        // For a camera that looks along +x with y up, right is +z and down is −y.
        let expected = DMat3::from_cols(DVec3::Z, DVec3::NEG_Y, DVec3::X);
        assert_eq!(pose.matrix3, expected);
        assert_eq!(pose.translation, DVec3::new(1.0, 2.0, 3.0));
        let slanted = from_look_at(DVec3::ZERO, DVec3::X, DVec3::new(0.1, 1.0, 0.0));
        assert!(slanted.unwrap_err().contains("perpendicular"));
        assert!(from_look_at(DVec3::X, DVec3::X, DVec3::Y).is_err());
        assert!(from_look_at(DVec3::ZERO, DVec3::X, DVec3::Y * 2.0).is_err());
    }

    #[test]
    fn a_column_major_camera_from_world_is_inverted() {
        // x_camera = y_world, y_camera = z_world, z_camera = x_world − 5.
        let columns = [
            [0.0, 0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, -5.0, 1.0],
        ];
        let pose = from_camera_from_world(&columns).unwrap();
        assert_eq!(pose.translation, DVec3::new(5.0, 0.0, 0.0));
        assert_eq!(pose.matrix3.z_axis, DVec3::X);
        let mut mirrored = columns;
        mirrored[0][2] = -1.0;
        assert!(
            from_camera_from_world(&mirrored)
                .unwrap_err()
                .contains("mirrored")
        );
    }
}
