//! Gaussians of other programs: PLY of 3D Gaussian Splatting (Kerbl et al. 2023) and of 2D Gaussian
//! Splatting (Huang et al. 2024).
//!
//! Files hold raw parameters: logit of the opacity, logarithm of the scales, coefficients of
//! spherical harmonics that add up to a display colour. `f_rest` has all coefficients of red first,
//! then those of green and blue.

use super::header::PropertyType;
use super::values::Vertices;
use crate::error::{Result, SceneError};
use crate::files;
use glam::{Quat, Vec3};
use std::path::Path;

/// Coefficients of degrees 0 to 2, the higher ones are left out.
pub const NUM_SPLAT_FUNCTIONS: usize = 9;

/// Value of the spherical harmonic of degree 0: 1 / (2 √π).
pub const SH_DEGREE_0: f32 = 0.282_094_8;

/// A Gaussian of another program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splat {
    /// Centre, in the file's world.
    pub position: Vec3,
    /// Standard deviations along the axes of `rotation`, the file's unit; the third is 0 in a file
    /// of flat Gaussians. May be 0 or not finite, as the file has it.
    pub scales: Vec3,
    /// Quaternion of any length.
    pub rotation: Quat,
    /// Opacity, 0 to 1.
    pub opacity: f32,
    /// Coefficients of the display colour: of function k, in red, green and blue; 0.5 is added to
    /// their sum.
    pub colour: [[f32; 3]; NUM_SPLAT_FUNCTIONS],
}

/// The Gaussians of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Splats {
    /// The Gaussians, in the order of the file.
    pub list: Vec<Splat>,
    /// Whether the file has three scales.
    pub is_3d: bool,
    /// Highest degree of the harmonics in the file.
    pub degree: u32,
}

/// The kind of a PLY that is not a scene of ours, for messages; `None` if it is no splat file.
pub(super) fn kind(vertices: &Vertices<'_>) -> Option<&'static str> {
    let has = |name| vertices.find(name).is_some();
    if has("radiances_0") {
        return None;
    }
    if has("packed_position") {
        return Some("a compressed PLY of SuperSplat");
    }
    match (has("f_dc_0"), has("scale_2")) {
        (true, true) => Some("a file of 3D Gaussian Splatting"),
        (true, false) => Some("a file of 2D Gaussian Splatting"),
        _ => None,
    }
}

/// Reads Gaussians of 3D or 2D Gaussian Splatting.
///
/// # Errors
/// [`SceneError`] naming the file and, where it applies, the Gaussian, property and value:
/// unreadable, truncated, another layout (a compressed PLY among them), a missing property, a
/// number of `f_rest` that is of no degree, a position, opacity, rotation or coefficient that is
/// not finite.
pub fn read_splats(path: &Path) -> Result<Splats> {
    let bytes = files::read(path)?;
    parse(path, &bytes)
}

pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Splats> {
    let vertices = Vertices::parse(path, bytes)?;
    if vertices.find("radiances_0").is_some() {
        let problem = "a scene already, nothing to import";
        return Err(SceneError::invalid(path, "vertex.radiances_0", problem));
    }
    if vertices.find("packed_position").is_some() {
        let problem = "a compressed PLY of SuperSplat; its export as plain PLY or SPZ can be read";
        return Err(SceneError::unsupported(
            path,
            "vertex.packed_position",
            problem,
        ));
    }
    let is_3d = vertices.find("scale_2").is_some();
    let (degree, stride) = degree(path, &vertices)?;
    let mut list = Vec::with_capacity(vertices.len());
    let columns = vertices.columns([
        "x", "y", "z", "opacity", "rot_0", "rot_1", "rot_2", "rot_3", "f_dc_0", "f_dc_1", "f_dc_2",
    ])?;
    vertices.for_each_row(columns, |index, values| {
        let v = values.map(|value| value as f32);
        finite(path, index, &v)?;
        let mut colour = [[0.0; 3]; NUM_SPLAT_FUNCTIONS];
        colour[0] = [v[8], v[9], v[10]];
        list.push(Splat {
            position: Vec3::new(v[0], v[1], v[2]),
            scales: Vec3::ZERO,
            rotation: Quat::from_xyzw(v[5], v[6], v[7], v[4]),
            opacity: 1.0 / (1.0 + (-v[3]).exp()),
            colour,
        });
        Ok(())
    })?;
    // A logarithm of minus infinity is a scale of 0, as exporters of flat Gaussians write it.
    let two = vertices.columns(["scale_0", "scale_1"])?;
    vertices.for_each_row(two, |index, values| {
        let [u, v] = values.map(|value| (value as f32).exp());
        list[index].scales = Vec3::new(u, v, 0.0);
        Ok(())
    })?;
    if is_3d {
        let third = vertices.columns(["scale_2"])?;
        vertices.for_each_row(third, |index, [value]| {
            list[index].scales.z = (value as f32).exp();
            Ok(())
        })?;
    }
    for function in 1..NUM_SPLAT_FUNCTIONS.min(stride + 1) {
        let names = [0, 1, 2].map(|channel| format!("f_rest_{}", channel * stride + function - 1));
        let columns = vertices.columns(names.each_ref().map(String::as_str))?;
        vertices.for_each_row(columns, |index, values| {
            let values = values.map(|value| value as f32);
            finite(path, index, &values)?;
            list[index].colour[function] = values;
            Ok(())
        })?;
    }
    Ok(Splats {
        list,
        is_3d,
        degree,
    })
}

/// The degree of the harmonics, and the number of coefficients that a channel has beside the first.
fn degree(path: &Path, vertices: &Vertices<'_>) -> Result<(u32, usize)> {
    let properties = vertices.properties().iter();
    let num = properties
        .filter(|p| p.name.starts_with("f_rest_") && matches!(p.kind, PropertyType::Single(_)))
        .count();
    let of = (0..=4).find(|degree: &usize| 3 * degree * (degree + 2) == num);
    match of {
        Some(degree) => Ok((degree as u32, num / 3)),
        None => Err(SceneError::invalid(
            path,
            "vertex.f_rest",
            format!("{num} properties, which is of no degree: 0, 9, 24, 45 or 72"),
        )),
    }
}

fn finite(path: &Path, index: usize, values: &[f32]) -> Result<()> {
    match values.iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) => Err(SceneError::invalid(
            path,
            format!("vertex[{index}]"),
            format!("{value:?} is not finite"),
        )),
    }
}
