//! Quantities of the camera rays beside their light (arbitrary output variables).

use anyhow::Result;
use clap::ValueEnum;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Camera, Gloss, Image, png};
use eagpt_trace::{GBuffer, Tracer};
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
    /// Blended specular reflectance at normal incidence (F0), linear; black where nothing is glossy
    Specular,
    /// Perceptual roughness of what is glossy, 0 to 1
    Roughness,
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
            Self::Specular => "specular",
            Self::Roughness => "roughness",
        }
    }

    /// Returns whether a PNG is written beside the EXR.
    pub(super) fn has_picture(self) -> bool {
        !matches!(self, Self::Depth | Self::Alpha)
    }

    /// Whether it is a quantity of [`Seen::gloss`].
    pub(super) fn is_of_gloss(self) -> bool {
        matches!(self, Self::Specular | Self::Roughness)
    }

    /// Writes the quantity and, where there is one, its picture.
    pub(super) fn write(
        self,
        camera: &Camera,
        seen: &Seen<'_>,
        exr_path: &Path,
        png_path: &Path,
    ) -> Result<()> {
        let features = seen.features;
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
            Self::Specular => {
                let image = seen.gloss.map(|&[r, g, b, _]| [r, g, b]);
                exr::write_rgb(exr_path, &image, Precision::Half)?;
                png::write_srgb8(png_path, &image)?;
            }
            Self::Roughness => {
                let image = seen.gloss.map(|&[r, g, b, weighted]| {
                    let weight = (r + g + b) / 3.0;
                    [if weight > 0.0 { weighted / weight } else { 0.0 }]
                });
                exr::write_single(exr_path, &image, Precision::Half)?;
                write_bytes(png_path, &image.map(|[value]| [*value; 3]))?;
            }
        }
        Ok(())
    }
}

/// Things that the camera rays of a view have seen.
pub(super) struct Seen<'a> {
    pub(super) features: &'a GBuffer,
    /// Means over the pixels of F0, and of roughness weighted by the mean of F0's channels.
    pub(super) gloss: Image<4>,
}

impl<'a> Seen<'a> {
    /// Those of a view of `scene` with so many rays along each axis of a pixel. Gloss is traced if
    /// one of `aovs` is of it.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn new(
        aovs: &[Aov],
        features: &'a GBuffer,
        scene: &dyn Tracer,
        (camera, rays_per_axis): (&Camera, u32),
    ) -> Result<Self> {
        let mut gloss = Image::filled(camera.width, camera.height, [0.0; 4]);
        if aovs.iter().any(|aov| aov.is_of_gloss()) {
            let rays = camera.magnified(rays_per_axis);
            let found = scene.pixel_gloss(&rays)?;
            if !found.is_empty() {
                let value = |gloss: &Gloss| {
                    let [r, g, b] = gloss.specular.to_array();
                    [r, g, b, gloss.roughness * (r + g + b) / 3.0]
                };
                let pixels = found.iter().map(value).collect();
                let one_each = "one value for each ray";
                let image = Image::from_pixels(rays.width, rays.height, pixels).expect(one_each);
                gloss = image.averaged(rays_per_axis);
            }
        }
        Ok(Self { features, gloss })
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

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gaussian, Gaussians};
    use eagpt_testkit::gaussians::{look_at, material, rectangle};
    use eagpt_trace::Device;
    use glam::{DVec3, Vec3};

    /// A wall of metal that fills the picture on the left of its middle, paint on the right.
    #[test]
    fn gloss_is_a_mean_over_the_rays_of_a_pixel() {
        let gloss = Gloss {
            specular: Vec3::new(0.8, 0.4, 0.2),
            roughness: 0.3,
        };
        let paint = material(Vec3::ZERO, 0.0, Vec3::splat(0.5));
        let wall = |centre: f32| {
            let centre = Vec3::new(centre, 0.0, 0.0);
            rectangle(centre, 2.0 * Vec3::X, 4.0 * Vec3::Z, 0.1, paint)
        };
        let metal = wall(-2.0).into_iter().map(|g| Gaussian { gloss, ..g });
        let scene: Gaussians = metal.chain(wall(2.0)).collect();
        let tracer = Device::Cpu.scene(&scene).unwrap();
        let camera = look_at(DVec3::new(0.0, -2.0, 0.0), DVec3::ZERO, 16, 8);
        let features = tracer.gbuffer(&camera).unwrap();
        for rays in [1, 2] {
            let seen = Seen::new(&[Aov::Roughness], &features, &*tracer, (&camera, rays)).unwrap();
            let of = |x: u32| seen.gloss.get(x, 4);
            let expected = [0.8, 0.4, 0.2, 0.3 * 1.4 / 3.0];
            let off = (0..4).map(|k| (of(2)[k] - expected[k]).abs());
            assert!(off.fold(0.0, f32::max) < 0.01, "{:?}", of(2));
            assert_eq!(of(13), [0.0; 4]);
        }
        let none = Seen::new(&[Aov::Albedo], &features, &*tracer, (&camera, 1)).unwrap();
        assert_eq!(none.gloss.get(2, 4), [0.0; 4]);
    }
}
