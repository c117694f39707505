//! Quantities of the camera rays beside their light (arbitrary output variables).

use anyhow::Result;
use clap::ValueEnum;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Camera, Image, png};
use eagpt_trace::GBuffer;
use serde::Serialize;
use std::path::Path;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Aov {
    /// Unit normals, world space, turned to the camera; zero where nothing was hit
    Normal,
    /// Depth along the optical axis, scene units; zero where nothing was hit
    Depth,
    /// Blended diffuse albedo, linear
    Albedo,
    /// Blended emission, 0 to 1
    Emission,
    /// Opacity, 0 to 1
    Alpha,
}

impl Aov {
    /// Name of its folder.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::Albedo => "albedo",
            Self::Emission => "emission",
            Self::Alpha => "alpha",
        }
    }

    /// Returns whether a PNG is written beside the EXR.
    pub(super) fn has_picture(self) -> bool {
        matches!(self, Self::Normal | Self::Albedo | Self::Emission)
    }

    /// Writes the quantity and, where there is one, its picture.
    pub(super) fn write(
        self,
        camera: &Camera,
        features: &GBuffer,
        exr_path: &Path,
        png_path: &Path,
    ) -> Result<()> {
        match self {
            Self::Normal => {
                let image = features.extract(|s| s.unit_normal().to_array());
                exr::write_rgb(exr_path, &image, Precision::Half)?;
                write_signed(png_path, &image)?;
            }
            // Half precision has steps of millimetres at a few metres: too coarse for a depth.
            Self::Depth => exr::write_single(exr_path, &features.depth(camera), Precision::Float)?,
            Self::Albedo => {
                let image = features.extract(|s| s.albedo().to_array());
                exr::write_rgb(exr_path, &image, Precision::Half)?;
                png::write_srgb8(png_path, &image)?;
            }
            Self::Emission => {
                let image = features.extract(|s| [s.emission()]);
                exr::write_single(exr_path, &image, Precision::Half)?;
                // A score, not light: shown as it is, black 0 and white 1.
                write_bytes(png_path, &image.map(|[e]| [*e; 3]))?;
            }
            Self::Alpha => {
                let image = features.extract(|s| [s.alpha()]);
                exr::write_single(exr_path, &image, Precision::Half)?;
            }
        }
        Ok(())
    }
}

/// Shows −1 to 1 as black to white.
fn write_signed(path: &Path, image: &Image<3>) -> Result<()> {
    write_bytes(path, &image.map(|vector| vector.map(|v| 0.5 * v + 0.5)))
}

/// Shows 0 to 1 as black to white, without a display encoding.
fn write_bytes(path: &Path, image: &Image<3>) -> Result<()> {
    let bytes: Vec<u8> = image
        .values()
        .iter()
        .map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8)
        .collect();
    png::write_rgb8(path, image.width(), image.height(), &bytes)?;
    Ok(())
}
