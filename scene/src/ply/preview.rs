//! Previews: Gaussians as splat viewers expect them.
//!
//! The layout of 3D Gaussian Splatting (Kerbl et al. 2023) and 2D Gaussian Splatting (Huang et al.
//! 2024): raw parameters (logit of the opacity, logarithm of the scales), display colour as the
//! first spherical harmonic, no higher harmonics, no comments in the header since some loaders stop
//! at them. Colour is clipped at display white, and emission and albedo are lost: a preview is for
//! looking.

use super::gaussians::header;
use super::splats::SH_DEGREE_0;
use crate::color::srgb_from_linear;
use crate::error::{Result, SceneError};
use crate::files;
use crate::gaussians::{Gaussian, Gaussians};
use glam::Vec3;
use std::io::Write;
use std::path::Path;

/// Opacities are kept this far from 0 and 1, where the logit is infinite.
const OPACITY_MARGIN: f32 = 1e-6;
/// Thickness given to a flat Gaussian for viewers of 3D ones. Its logarithm is stored, and must be
/// finite.
const FLAT_SCALE: f32 = 1e-6;

/// For which kind of viewer a preview is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Preview {
    /// Viewers of 2D Gaussians: two scales.
    #[serde(rename = "2dgs")]
    TwoD,
    /// Viewers of 3D Gaussians: a third scale of nearly 0.
    #[serde(rename = "3dgs")]
    ThreeD,
}

/// Writes a preview, binary little endian, atomic.
///
/// # Errors
/// [`SceneError::Io`], or [`SceneError::Invalid`] naming the Gaussian and property if a value is
/// not finite, as that of a scale of 0.
pub fn write_preview(path: &Path, gaussians: &Gaussians, preview: Preview) -> Result<()> {
    let properties = properties(preview);
    files::write_atomic(path, |file| {
        let io = |e| SceneError::io(path, "write", e);
        file.write_all(header("vertex", gaussians.len(), &properties).as_bytes())
            .map_err(io)?;
        for (index, gaussian) in gaussians.iter().enumerate() {
            let row = row(&gaussian, preview);
            for (value, name) in row.iter().zip(&properties) {
                if !value.is_finite() {
                    return Err(SceneError::invalid(
                        path,
                        format!("vertex[{index}].{name}"),
                        format!("{value:?} is not finite"),
                    ));
                }
                file.write_all(&value.to_le_bytes()).map_err(io)?;
            }
        }
        Ok(())
    })
}

fn properties(preview: Preview) -> Vec<&'static str> {
    let mut names = vec![
        "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
        "scale_1",
    ];
    if preview == Preview::ThreeD {
        names.push("scale_2");
    }
    names.extend(["rot_0", "rot_1", "rot_2", "rot_3"]);
    names
}

fn row(g: &Gaussian, preview: Preview) -> Vec<f32> {
    let normal = g.rotation * Vec3::Z;
    let color = g
        .radiance
        .to_array()
        .map(|linear| (srgb_from_linear(linear.min(1.0)) - 0.5) / SH_DEGREE_0);
    let opacity = g.opacity.clamp(OPACITY_MARGIN, 1.0 - OPACITY_MARGIN);
    let mut row = Vec::with_capacity(17);
    row.extend(g.position.to_array());
    row.extend(normal.to_array());
    row.extend(color);
    row.push((opacity / (1.0 - opacity)).ln());
    row.extend([g.scale.x.ln(), g.scale.y.ln()]);
    if preview == Preview::ThreeD {
        row.push(FLAT_SCALE.ln());
    }
    let q = g.rotation;
    row.extend([q.w, q.x, q.y, q.z]);
    row
}
