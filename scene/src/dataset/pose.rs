//! Camera poses: OpenGL axes and row-major matrices on disk, OpenCV axes and [`DAffine3`] in
//! memory. The one place that turns one into the other.

use super::json::{Object, excerpt};
use crate::error::Result;
use glam::{DAffine3, DMat3, DVec3};
use serde_json::{Value, json};

const KEY: &str = "transform_matrix";
/// Tolerance for columns of a rotation that are not orthonormal: files hold single precision or a
/// few decimals.
const MAX_ROTATION_ERROR: f64 = 1e-3;
/// Tolerance for a last row other than 0 0 0 1.
const MAX_LAST_ROW_ERROR: f64 = 1e-6;
/// Below this determinant, relative to the lengths of the columns, the columns lie in a plane.
const MIN_DETERMINANT: f64 = 1e-6;

/// Reads `transform_matrix`, camera-to-world with OpenGL axes (x right, y up, looking along −z),
/// 4×4 or 3×4.
///
/// A rotation that is off by rounding is kept as it is.
///
/// # Errors
/// [`crate::SceneError::Invalid`] naming the frame and the offending number.
pub fn read(frame: &Object<'_>) -> Result<DAffine3> {
    let rows = frame.need(KEY, frame.array(KEY)?)?;
    if !(3..=4).contains(&rows.len()) {
        return Err(frame.invalid(KEY, format!("{} rows, not 4", rows.len())));
    }
    let mut matrix = [
        [0.0, 0.0, 0.0, 0.0],
        [0.0; 4],
        [0.0; 4],
        [0.0, 0.0, 0.0, 1.0],
    ];
    for (r, row) in rows.iter().enumerate() {
        let cells = row.as_array().filter(|cells| cells.len() == 4);
        let cells = cells.ok_or_else(|| {
            frame.invalid(KEY, format!("row {r} is {}, not 4 numbers", excerpt(row)))
        })?;
        for (c, cell) in cells.iter().enumerate() {
            let number = cell.as_f64().filter(|number| number.is_finite());
            matrix[r][c] = number.ok_or_else(|| {
                let text = excerpt(cell);
                frame.invalid(
                    KEY,
                    format!("row {r} column {c}: {text} is not a finite number"),
                )
            })?;
        }
    }
    from_rows(&matrix).map_err(|problem| frame.invalid(KEY, problem))
}

/// The pose with OpenCV axes of a row-major camera-to-world matrix with OpenGL axes.
///
/// # Errors
/// The problem with it, if any: a last row other than 0 0 0 1, or columns that are no rotation.
pub fn from_rows(matrix: &[[f64; 4]; 4]) -> std::result::Result<DAffine3, String> {
    let last = matrix[3];
    if last
        .iter()
        .zip([0.0, 0.0, 0.0, 1.0])
        .any(|(value, wanted)| (value - wanted).abs() > MAX_LAST_ROW_ERROR)
    {
        return Err(format!("last row is {last:?}, not [0, 0, 0, 1]"));
    }
    let column = |c: usize| DVec3::new(matrix[0][c], matrix[1][c], matrix[2][c]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    check_rotation(rotation)?;
    Ok(DAffine3 {
        matrix3: flip_axes(rotation),
        translation: column(3),
    })
}

/// The 4×4 row-major matrix with OpenGL axes of a pose with OpenCV axes.
pub fn to_json(world_from_camera: &DAffine3) -> Value {
    let rotation = flip_axes(world_from_camera.matrix3).transpose();
    let row = |axis: DVec3, offset: f64| json!([axis.x, axis.y, axis.z, offset]);
    let t = world_from_camera.translation;
    json!([
        row(rotation.x_axis, t.x),
        row(rotation.y_axis, t.y),
        row(rotation.z_axis, t.z),
        [0.0, 0.0, 0.0, 1.0]
    ])
}

/// Between OpenGL and OpenCV camera axes, either way: y and z point the other way.
fn flip_axes(world_from_camera: DMat3) -> DMat3 {
    let m = world_from_camera;
    DMat3::from_cols(m.x_axis, -m.y_axis, -m.z_axis)
}

/// Whether columns are a rotation up to rounding.
///
/// # Errors
/// The problem, if any: singular, mirrored, or not orthonormal.
pub fn check_rotation(m: DMat3) -> std::result::Result<(), String> {
    let lengths = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    let determinant = m.determinant();
    let smallest = MIN_DETERMINANT * lengths.element_product();
    if determinant == 0.0 || determinant.abs() < smallest {
        return Err(format!("singular: the determinant is {determinant:?}"));
    }
    let gram = m.transpose() * m - DMat3::IDENTITY;
    let errors = gram.to_cols_array().map(f64::abs);
    let error = errors.into_iter().fold(0.0, f64::max);
    // Entries so large that their squares overflow give infinities and NaN, of which the maximum
    // takes no notice.
    if !gram.is_finite() || error > MAX_ROTATION_ERROR {
        let [x, y, z] = lengths.to_array();
        return Err(format!(
            "not a rotation: off by {error:.2e}, its columns have lengths {x:.6}, {y:.6}, {z:.6}"
        ));
    }
    if determinant < 0.0 {
        return Err(format!("mirrored: the determinant is {determinant:.6}"));
    }
    Ok(())
}
