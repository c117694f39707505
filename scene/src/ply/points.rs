//! Coloured point clouds: what training starts from.

use super::header::Scalar;
use super::values::{Column, Vertices};
use crate::error::{Result, SceneError};
use crate::files;
use glam::Vec3;
use std::io::Write;
use std::path::Path;

/// Points with the display colours they were photographed in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    /// Positions, `[n]`, world space, scene units.
    pub positions: Vec<Vec3>,
    /// 8-bit sRGB colours, `[n]`.
    pub colors_srgb8: Vec<[u8; 3]>,
}

impl PointCloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}

/// Reads a point cloud: `x y z` of any type and `red green blue`, unsigned integers or floats from
/// 0 to 1.
///
/// # Errors
/// [`SceneError`] naming the file and, where it applies, the point, property and value: unreadable,
/// truncated, a missing property, a position that is not finite, a colour outside its range.
pub fn read_points(path: &Path) -> Result<PointCloud> {
    let bytes = files::read(path)?;
    parse(path, &bytes)
}

pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<PointCloud> {
    const NAMES: [&str; 6] = ["x", "y", "z", "red", "green", "blue"];
    let vertices = Vertices::parse(path, bytes)?;
    let columns = vertices.columns(NAMES)?;
    let full = columns.map(full_scale);
    let mut cloud = PointCloud {
        positions: Vec::with_capacity(vertices.len()),
        colors_srgb8: Vec::with_capacity(vertices.len()),
    };
    vertices.for_each_row(columns, |index, values| {
        let bad = |property: usize, problem: &str| {
            SceneError::invalid(
                path,
                format!("vertex[{index}].{}", NAMES[property]),
                format!("{:?} {problem}", values[property]),
            )
        };
        let mut position = [0.0; 3];
        for (axis, slot) in position.iter_mut().enumerate() {
            *slot = values[axis] as f32;
            if !slot.is_finite() {
                return Err(bad(axis, "is not finite"));
            }
        }
        let mut color = [0; 3];
        for (channel, slot) in color.iter_mut().enumerate() {
            let property = 3 + channel;
            let fraction = values[property] / full[property];
            if !(0.0..=1.0).contains(&fraction) {
                return Err(bad(
                    property,
                    &format!("is outside 0 to {}", full[property]),
                ));
            }
            *slot = (fraction * 255.0).round() as u8;
        }
        cloud.positions.push(Vec3::from_array(position));
        cloud.colors_srgb8.push(color);
        Ok(())
    })?;
    Ok(cloud)
}

/// The value that stands for full intensity: the largest of an unsigned type, 255 for the signed
/// ones (some programs declare bytes as `int`), 1 for floats.
fn full_scale(column: Column) -> f64 {
    match column.scalar {
        Scalar::F32 | Scalar::F64 => 1.0,
        Scalar::U8 | Scalar::I8 | Scalar::I16 | Scalar::I32 | Scalar::U32 => 255.0,
        Scalar::U16 => 65_535.0,
    }
}

/// Writes a point cloud: `float x y z`, `uchar red green blue`, binary little endian, atomic.
///
/// # Errors
/// [`SceneError::Io`], or [`SceneError::Invalid`] if the arrays differ in length or a position is
/// not finite.
pub fn write_points(path: &Path, cloud: &PointCloud) -> Result<()> {
    let (num_points, num_colors) = (cloud.len(), cloud.colors_srgb8.len());
    if num_points != num_colors {
        return Err(SceneError::invalid(
            path,
            "vertex",
            format!("{num_points} positions but {num_colors} colours"),
        ));
    }
    files::write_atomic(path, |file| {
        let io = |e| SceneError::io(path, "write", e);
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\nelement vertex {num_points}\n\
             property float x\nproperty float y\nproperty float z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
        )
        .map_err(io)?;
        for (index, (position, color)) in
            cloud.positions.iter().zip(&cloud.colors_srgb8).enumerate()
        {
            if !position.is_finite() {
                return Err(SceneError::invalid(
                    path,
                    format!("vertex[{index}]"),
                    format!("{position} is not finite"),
                ));
            }
            let bytes = position.to_array().map(f32::to_le_bytes);
            file.write_all(bytes.as_flattened()).map_err(io)?;
            file.write_all(color).map_err(io)?;
        }
        Ok(())
    })
}
