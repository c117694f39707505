//! Gaussians of other programs become a scene: PLY of 3D and of 2D Gaussian Splatting, and SPZ.
//!
//! Ellipsoids become discs of their two longest axes. Display colours become linear light, and what
//! their harmonics say of directions is fitted by ours (`fit`). Nothing in such a file tells lamps
//! from lit surfaces, nor light from material: emission is 0 and albedo one half, both for training
//! to find out.

mod fit;
mod spz;

use crate::error::{ConvertError, Result};
use eagpt_scene::ply::{self, SH_DEGREE_0, Splat, Splats};
use eagpt_scene::{Gaussian, Gaussians, Gloss, color, rotation};
use fit::{Fit, Fitted, NUM_DIRECTIONS};
use glam::{DMat3, DVec3, Quat, Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Shortest axis, in the next longer one, above which a Gaussian is far from flat.
const FLAT: f32 = 1.0 / 3.0;
/// Albedo of what nobody has trained, as training starts with.
const ALBEDO: Vec3 = Vec3::splat(0.5);
/// A quaternion shorter than this has no direction.
const MIN_QUATERNION: f32 = 1e-6;

/// Encoding of the colours of Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum SplatColor {
    /// Display colour, as of photographs that were trained on
    #[default]
    Srgb,
    /// Linear light
    Linear,
}

/// Options of [`import_splats`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SplatOptions {
    /// Encoding of the colours.
    pub color: SplatColor,
    /// Rows of the similarity from the file's world into that of the scene, as `aligned_from_model`
    /// of a dataset; by default the world stays.
    pub scene_from_file: Option<[[f64; 4]; 4]>,
}

/// Findings of an import.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SplatReport {
    /// Layout: `3dgs`, `2dgs` or `spz`.
    pub format: &'static str,
    /// Gaussians of the scene.
    pub num_gaussians: usize,
    /// Gaussians left out, since an axis has no length or no direction.
    pub num_left_out: usize,
    /// Gaussians whose shortest axis is longer than a third of the next; `None` for flat ones.
    pub num_far_from_flat: Option<usize>,
    /// Highest degree of the harmonics in the file.
    pub degree: u32,
    /// Root mean square of the error of linear light over that of the light, over directions and
    /// Gaussians by their area and opacity; of harmonics of degrees 0 to 2.
    pub residual: f64,
    /// The same of light that is the same in all directions.
    pub residual_without_harmonics: f64,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// Reads the Gaussians of another program as a scene.
///
/// # Errors
/// A file of another layout, or with values that cannot be; a similarity that is none; no Gaussian
/// that can be used.
pub fn import_splats(path: &Path, options: &SplatOptions) -> Result<(Gaussians, SplatReport)> {
    let is_spz = spz::is_spz(path)?;
    let splats = match is_spz {
        true => spz::read(path)?,
        false => ply::read_splats(path)?,
    };
    let world = World::new(options)?;
    let fit = Fit::new();
    let converted: Vec<Option<(Gaussian, f32, Fitted)>> = splats
        .list
        .par_iter()
        .map(|splat| converted(splat, splats.degree, options.color, &world, &fit))
        .collect();
    let mut gaussians = Gaussians::with_capacity(splats.list.len());
    let mut errors = Errors::default();
    let mut num_far_from_flat = 0;
    for (gaussian, flatness, fitted) in converted.iter().flatten() {
        gaussians.push(*gaussian);
        let weight = f64::from(gaussian.opacity * gaussian.scale.x * gaussian.scale.y);
        errors.add(weight, fitted);
        num_far_from_flat += usize::from(*flatness > FLAT);
    }
    if gaussians.is_empty() {
        let problem = format!("{}, of which none can be used", splats.list.len());
        return Err(ConvertError::invalid(path, "Gaussians", problem));
    }
    let mut report = SplatReport {
        format: format_name(is_spz, &splats),
        num_gaussians: gaussians.len(),
        num_left_out: splats.list.len() - gaussians.len(),
        num_far_from_flat: splats.is_3d.then_some(num_far_from_flat),
        degree: splats.degree,
        residual: errors.relative(errors.fitted),
        residual_without_harmonics: errors.relative(errors.constant),
        warnings: Vec::new(),
    };
    report.warn();
    Ok((gaussians, report))
}

fn format_name(is_spz: bool, splats: &Splats) -> &'static str {
    match (is_spz, splats.is_3d) {
        (true, _) => "spz",
        (false, true) => "3dgs",
        (false, false) => "2dgs",
    }
}

impl SplatReport {
    fn warn(&mut self) {
        let total = self.num_gaussians;
        if self.num_left_out > 0 {
            self.warnings.push(format!(
                "{} of {} Gaussians are left out: an axis has no length or no direction",
                self.num_left_out,
                total + self.num_left_out
            ));
        }
        if let Some(num @ 1..) = self.num_far_from_flat {
            self.warnings.push(format!(
                "{num} of {total} Gaussians are far from flat, the shortest axis above a third of the next: as discs they show \
                 less from the side"
            ));
        }
        if self.degree > 2 {
            self.warnings.push(format!(
                "harmonics of degree {}: those above 2 are left out",
                self.degree
            ));
        }
    }
}

/// Sums of squares over all Gaussians.
#[derive(Default)]
struct Errors {
    light: f64,
    fitted: f64,
    constant: f64,
}

impl Errors {
    fn add(&mut self, weight: f64, fitted: &Fitted) {
        self.light += weight * fitted.light;
        self.fitted += weight * fitted.error;
        self.constant += weight * fitted.error_of_constant;
    }

    fn relative(&self, squares: f64) -> f64 {
        match self.light > 0.0 {
            true => (squares / self.light).sqrt(),
            false => 0.0,
        }
    }
}

/// A similarity.
struct World {
    scale: f64,
    rotation: Quat,
    matrix: DMat3,
    translation: DVec3,
    is_same: bool,
}

impl World {
    fn new(options: &SplatOptions) -> Result<Self> {
        let Some(rows) = &options.scene_from_file else {
            return Ok(Self {
                scale: 1.0,
                rotation: Quat::IDENTITY,
                matrix: DMat3::IDENTITY,
                translation: DVec3::ZERO,
                is_same: true,
            });
        };
        let matrix = DMat3::from_cols_array_2d(&[0, 1, 2].map(|r| {
            let [x, y, z, _] = rows[r];
            [x, y, z]
        }))
        .transpose();
        let scale = matrix.determinant().cbrt();
        let turn = matrix * scale.recip();
        let off = turn.transpose() * turn - DMat3::IDENTITY;
        let largest = off.to_cols_array().into_iter().map(f64::abs);
        if scale.is_nan() || scale <= 0.0 || largest.fold(0.0, f64::max) > 1e-4 {
            let problem = "the transform is no rotation with one scale";
            return Err(ConvertError::option("scene_from_file", problem));
        }
        Ok(Self {
            scale,
            rotation: glam::DQuat::from_mat3(&turn).normalize().as_quat(),
            matrix,
            translation: DVec3::from([0, 1, 2].map(|r| rows[r][3])),
            is_same: false,
        })
    }

    fn apply(&self, gaussian: &mut Gaussian) {
        if self.is_same {
            return;
        }
        let position = self.matrix * gaussian.position.as_dvec3() + self.translation;
        gaussian.position = position.as_vec3();
        gaussian.scale *= self.scale as f32;
        gaussian.rotation = rotation::unit(self.rotation * gaussian.rotation);
        gaussian.harmonics = gaussian.harmonics.rotated(self.rotation);
    }
}

/// The Gaussian in the scene's world, its shortest axis in the next, and how its light was fitted.
fn converted(
    splat: &Splat,
    degree: u32,
    encoding: SplatColor,
    world: &World,
    fit: &Fit,
) -> Option<(Gaussian, f32, Fitted)> {
    let (scale, turn, flatness) = disc(splat)?;
    let light = light(splat, encoding, fit);
    let fitted = fit.light(&light, degree);
    let mut gaussian = Gaussian {
        position: splat.position,
        scale,
        rotation: turn,
        opacity: splat.opacity,
        radiance: fitted.radiance,
        harmonics: fitted.harmonics,
        gloss: Gloss::NONE,
        emission: 0.0,
        albedo: ALBEDO,
    };
    world.apply(&mut gaussian);
    Some((gaussian, flatness, fitted))
}

/// The two longest axes, the frame with the shortest as its normal, and the ratio of the shortest
/// to the next.
fn disc(splat: &Splat) -> Option<(Vec2, Quat, f32)> {
    let length = rotation::length(splat.rotation);
    if !(MIN_QUATERNION..f32::INFINITY).contains(&length) {
        return None;
    }
    let turn = rotation::unit(splat.rotation);
    let s = splat.scales.to_array();
    let shortest = (0..3).rev().min_by(|&a, &b| s[a].total_cmp(&s[b]))?;
    // The next two in their cyclic order keep the frame right-handed.
    let (u, v) = ((shortest + 1) % 3, (shortest + 2) % 3);
    let is_length = |value: f32| value > 0.0 && value.is_finite();
    if !is_length(s[u]) || !is_length(s[v]) {
        return None;
    }
    let frame = match shortest {
        2 => turn,
        _ => {
            let axes = glam::Mat3::from_quat(turn);
            let axis = |i: usize| axes.col(i);
            let frame = glam::Mat3::from_cols(axis(u), axis(v), axis(shortest));
            rotation::unit(Quat::from_mat3(&frame))
        }
    };
    Some((Vec2::new(s[u], s[v]), frame, s[shortest] / s[u].min(s[v])))
}

/// Linear light towards each direction of the fit, in red, green and blue.
fn light(splat: &Splat, encoding: SplatColor, fit: &Fit) -> [[f64; NUM_DIRECTIONS]; 3] {
    let mut light = [[0.0; NUM_DIRECTIONS]; 3];
    for (channel, values) in light.iter_mut().enumerate() {
        for (value, functions) in values.iter_mut().zip(&fit.functions) {
            let mut sum = 0.5 + SH_DEGREE_0 * splat.colour[0][channel];
            for (coefficient, function) in splat.colour[1..].iter().zip(functions) {
                sum += coefficient[channel] * function;
            }
            let shown = sum.max(0.0);
            *value = f64::from(match encoding {
                SplatColor::Srgb => color::linear_from_srgb(shown),
                SplatColor::Linear => shown,
            });
        }
    }
    light
}

#[cfg(test)]
mod tests;
