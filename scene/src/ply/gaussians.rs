//! Gaussians in the PLY layout of EAG-PT: 17 activated float properties, 24 more where radiance
//! differs with the direction, and four more where surfaces are glossy.
//!
//! Activated means physical: scales in scene units, opacity, emission and albedo in 0 to 1,
//! radiance linear. Splat viewers expect raw parameters instead; [`super::write_preview`] makes
//! files for them.

use super::splats;
use super::values::Vertices;
use crate::error::{Result, SceneError};
use crate::files;
use crate::gaussians::{Gaussian, Gaussians, MAX_ALBEDO};
use crate::gloss::Gloss;
use crate::harmonics::{Harmonics, NUM_COEFFICIENTS};
use glam::{Quat, Vec2, Vec3};
use std::io::Write;
use std::path::Path;
use std::sync::LazyLock;

/// The properties in the order of a written file; the quaternion has w first.
const PROPERTIES: [&str; 17] = [
    "x",
    "y",
    "z",
    "scales_0",
    "scales_1",
    "quaternions_0",
    "quaternions_1",
    "quaternions_2",
    "quaternions_3",
    "opacities",
    "radiances_0",
    "radiances_1",
    "radiances_2",
    "emissives",
    "albedos_0",
    "albedos_1",
    "albedos_2",
];

/// Further properties of a file whose radiance differs with the direction; other programs step over
/// them and see the radiance without.
static HARMONICS: LazyLock<[String; NUM_COEFFICIENTS]> =
    LazyLock::new(|| std::array::from_fn(|k| format!("harmonics_{k}")));

/// Further properties of a file with glossy surfaces: F0 and roughness. Other programs step over
/// them and see the diffuse part.
const GLOSS: [&str; 4] = ["speculars_0", "speculars_1", "speculars_2", "roughnesses"];

/// Tolerance beyond their ranges within which opacity, emission, albedo, F0 and roughness are
/// clamped: rounding in other programs.
const UNIT_TOLERANCE: f32 = 1e-4;
/// Quaternions nearer than this to unit length stay as they are, so that a file is written as it
/// was read; single precision normalises to within 2e-7.
const QUATERNION_TOLERANCE: f32 = 1e-6;
/// A quaternion shorter than this has no direction worth keeping.
const MIN_QUATERNION_LENGTH: f32 = 1e-6;

/// First bytes of a file of SPZ, which is compressed as a whole.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads Gaussians. Values a rounding error outside their ranges are clamped, quaternions off unit
/// length are normalised.
///
/// # Errors
/// [`SceneError`] naming the file and, where it applies, the Gaussian, property and value:
/// unreadable, truncated, a missing property, a value or coefficient that is not finite, a scale
/// not above 0, a negative radiance, an opacity, emission, F0 or roughness outside 0 to 1, an
/// albedo outside 0 to [`MAX_ALBEDO`], a zero quaternion.
pub fn read_gaussians(path: &Path) -> Result<Gaussians> {
    let bytes = files::read(path)?;
    parse(path, &bytes)
}

pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Gaussians> {
    if bytes.starts_with(&GZIP) {
        let problem = "gzip, not a PLY file; `eagpt import` makes a scene of SPZ";
        return Err(SceneError::invalid(path, "header", problem));
    }
    let vertices = Vertices::parse(path, bytes)?;
    if let Some(kind) = splats::kind(&vertices) {
        return Err(SceneError::invalid(
            path,
            "vertex.radiances_0",
            format!("missing: this is {kind}; `eagpt import` makes a scene of such files"),
        ));
    }
    let mut gaussians = Gaussians::with_capacity(vertices.len());
    let columns = vertices.columns(PROPERTIES)?;
    vertices.for_each_row(columns, |index, values| {
        let row = checked(path, index, values.map(|value| value as f32))?;
        gaussians.push(gaussian(row));
        Ok(())
    })?;
    if vertices.find(&HARMONICS[0]).is_some() {
        gaussians.harmonics.reserve(vertices.len());
        let columns = vertices.columns(HARMONICS.each_ref().map(String::as_str))?;
        vertices.for_each_row(columns, |index, values| {
            let values = values.map(|value| value as f32);
            gaussians.harmonics.push(harmonics(path, index, values)?);
            Ok(())
        })?;
    }
    if vertices.find(GLOSS[0]).is_some() {
        gaussians.gloss.reserve(vertices.len());
        let columns = vertices.columns(GLOSS)?;
        vertices.for_each_row(columns, |index, values| {
            let values = values.map(|value| value as f32);
            gaussians.gloss.push(gloss(path, index, values)?);
            Ok(())
        })?;
    }
    Ok(gaussians)
}

/// Checks F0 and roughness.
fn gloss(path: &Path, index: usize, mut values: [f32; 4]) -> Result<Gloss> {
    for (value, name) in values.iter_mut().zip(GLOSS) {
        if !(-UNIT_TOLERANCE..=1.0 + UNIT_TOLERANCE).contains(value) {
            return Err(SceneError::invalid(
                path,
                format!("vertex[{index}].{name}"),
                format!("{value:?} is outside 0 to 1"),
            ));
        }
        *value = value.clamp(0.0, 1.0);
    }
    let [r, g, b, roughness] = values;
    Ok(Gloss {
        specular: Vec3::new(r, g, b),
        roughness,
    })
}

/// Checks coefficients.
fn harmonics(path: &Path, index: usize, values: [f32; NUM_COEFFICIENTS]) -> Result<Harmonics> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(Harmonics(values)),
        Some(k) => Err(SceneError::invalid(
            path,
            format!("vertex[{index}].{}", HARMONICS[k]),
            format!("{:?} is not finite", values[k]),
        )),
    }
}

/// Writes Gaussians, binary little endian, atomic. What [`read_gaussians`] would refuse is refused.
///
/// # Errors
/// [`SceneError::Io`], or [`SceneError::Invalid`] naming the Gaussian, property and value.
pub fn write_gaussians(path: &Path, gaussians: &Gaussians) -> Result<()> {
    files::write_atomic(path, |file| {
        let io = |e| SceneError::io(path, "write", e);
        let mut properties = PROPERTIES.to_vec();
        if !gaussians.harmonics.is_empty() {
            properties.extend(HARMONICS.iter().map(String::as_str));
        }
        if !gaussians.gloss.is_empty() {
            properties.extend(GLOSS);
        }
        file.write_all(header("vertex", gaussians.len(), &properties).as_bytes())
            .map_err(io)?;
        for (index, g) in gaussians.iter().enumerate() {
            let row = checked(path, index, row(&g))?;
            file.write_all(bytemuck::bytes_of(&row.map(f32::to_le_bytes)))
                .map_err(io)?;
            if let Some(coefficients) = gaussians.harmonics.get(index) {
                let values = harmonics(path, index, coefficients.0)?.0;
                file.write_all(bytemuck::bytes_of(&values.map(f32::to_le_bytes)))
                    .map_err(io)?;
            }
            if let Some(material) = gaussians.gloss.get(index) {
                let [r, g, b] = material.specular.to_array();
                gloss(path, index, [r, g, b, material.roughness])?;
                let values = [r, g, b, material.roughness].map(f32::to_le_bytes);
                file.write_all(bytemuck::bytes_of(&values)).map_err(io)?;
            }
        }
        Ok(())
    })
}

/// The header of a little-endian file with one element of float properties.
pub(super) fn header(element: &str, count: usize, properties: &[&str]) -> String {
    let mut text = format!("ply\nformat binary_little_endian 1.0\nelement {element} {count}\n");
    for name in properties {
        text.push_str("property float ");
        text.push_str(name);
        text.push('\n');
    }
    text.push_str("end_header\n");
    text
}

fn row(g: &Gaussian) -> [f32; 17] {
    let (p, s, q, r, a) = (g.position, g.scale, g.rotation, g.radiance, g.albedo);
    [
        p.x, p.y, p.z, s.x, s.y, q.w, q.x, q.y, q.z, g.opacity, r.x, r.y, r.z, g.emission, a.x,
        a.y, a.z,
    ]
}

fn gaussian(row: [f32; 17]) -> Gaussian {
    let vec3 = |at: usize| Vec3::new(row[at], row[at + 1], row[at + 2]);
    Gaussian {
        position: vec3(0),
        scale: Vec2::new(row[3], row[4]),
        rotation: Quat::from_xyzw(row[6], row[7], row[8], row[5]),
        opacity: row[9],
        radiance: vec3(10),
        harmonics: Harmonics::NONE,
        gloss: Gloss::NONE,
        emission: row[13],
        albedo: vec3(14),
    }
}

/// Whether a row can be kept as it is. Says in one pass for nearly all rows what [`checked`] says
/// value by value.
#[inline]
fn is_clean(row: &[f32; 17]) -> bool {
    let up_to = |max: f32, value: f32| (0.0..=max).contains(&value);
    row.iter().all(|value| value.is_finite())
        && row[3] > 0.0
        && row[4] > 0.0
        && (quaternion_length(row) - 1.0).abs() <= QUATERNION_TOLERANCE
        && up_to(1.0, row[9])
        && row[10..13].iter().all(|&radiance| radiance >= 0.0)
        && up_to(1.0, row[13])
        && row[14..].iter().all(|&albedo| up_to(MAX_ALBEDO, albedo))
}

fn quaternion_length(row: &[f32; 17]) -> f32 {
    row[5..9].iter().map(|q| q * q).sum::<f32>().sqrt()
}

/// The row as it is kept: clamped and normalised within the tolerances.
fn checked(path: &Path, index: usize, mut row: [f32; 17]) -> Result<[f32; 17]> {
    if is_clean(&row) {
        return Ok(row);
    }
    let bad = |property: &str, problem: String| {
        Err(SceneError::invalid(
            path,
            format!("vertex[{index}].{property}"),
            problem,
        ))
    };
    for (value, name) in row.iter_mut().zip(PROPERTIES) {
        if !value.is_finite() {
            return bad(name, format!("{value:?} is not finite"));
        }
        match name.as_bytes()[0] {
            b's' if *value <= 0.0 => return bad(name, format!("{value:?} is not above 0")),
            b'r' if *value < 0.0 => return bad(name, format!("{value:?} is negative")),
            kind @ (b'o' | b'e' | b'a') => {
                let max = if kind == b'a' { MAX_ALBEDO } else { 1.0 };
                if !(-UNIT_TOLERANCE..=max + UNIT_TOLERANCE).contains(value) {
                    return bad(name, format!("{value:?} is outside 0 to {max}"));
                }
                *value = value.clamp(0.0, max);
            }
            _ => {}
        }
    }
    let length = quaternion_length(&row);
    // Written so that a length that overflowed to infinity is refused as well.
    if !(MIN_QUATERNION_LENGTH..f32::INFINITY).contains(&length) {
        return bad("quaternions", format!("length {length:?} has no direction"));
    }
    if (length - 1.0).abs() > QUATERNION_TOLERANCE {
        for q in &mut row[5..9] {
            *q /= length;
        }
    }
    Ok(row)
}
