//! Frames, and the files that they are made of.

use crate::camera::Camera;
use crate::error::SceneError;
use std::path::PathBuf;

/// Folder of the radiance images.
pub const RADIANCE_DIR: &str = "Radiance-exr";
/// Folder of the emission masks.
pub const EMISSION_DIR: &str = "Emissive-exr";
/// Folder of the normals.
pub const NORMAL_DIR: &str = "Normal-exr";
/// Folder of the opacities.
pub const ALPHA_DIR: &str = "Alpha-exr";
/// Folder of the depths.
pub const DEPTH_DIR: &str = "Depth-exr";
/// Folder of the diffuse albedos.
pub const ALBEDO_DIR: &str = "DiffCol";
/// Folder of the specular reflectances.
pub const SPECULAR_DIR: &str = "GlossCol";
/// Folder of the roughness images.
pub const ROUGHNESS_DIR: &str = "Roughness";
/// Folder of the masks of clipped channels.
pub const CLIPPED_DIR: &str = "Clipped-exr";
/// Folder of the masks of known pixels.
pub const VALID_DIR: &str = "Valid-exr";
/// The file of cameras.
pub const TRANSFORMS_FILE: &str = "transforms.json";
/// The point cloud that training starts from.
pub const POINTS_FILE: &str = "points3d.ply";
/// A posed image of a dataset, not loaded.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Unique name, no extension; may contain "/".
    pub name: String,
    /// Camera of the image.
    pub camera: Camera,
    /// Paths of its images.
    pub files: ViewFiles,
}

/// The image files of a view; those that are there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ViewFiles {
    /// Linear radiance.
    pub radiance: PathBuf,
    /// Emission mask.
    pub emission: Option<PathBuf>,
    /// World-space normals.
    pub normal: Option<PathBuf>,
    /// Opacity.
    pub alpha: Option<PathBuf>,
    /// Depth along the optical axis.
    pub depth: Option<PathBuf>,
    /// Diffuse albedo.
    pub albedo: Option<PathBuf>,
    /// Specular reflectance at normal incidence.
    pub specular: Option<PathBuf>,
    /// Perceptual roughness.
    pub roughness: Option<PathBuf>,
    /// Mask of clipped channels.
    pub clipped: Option<PathBuf>,
    /// Mask of known pixels.
    pub valid: Option<PathBuf>,
}

impl ViewFiles {
    /// The files that are there, each with the folder of a dataset that it belongs in.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, &PathBuf)> {
        let files = [
            (RADIANCE_DIR, Some(&self.radiance)),
            (EMISSION_DIR, self.emission.as_ref()),
            (NORMAL_DIR, self.normal.as_ref()),
            (ALPHA_DIR, self.alpha.as_ref()),
            (DEPTH_DIR, self.depth.as_ref()),
            (ALBEDO_DIR, self.albedo.as_ref()),
            (SPECULAR_DIR, self.specular.as_ref()),
            (ROUGHNESS_DIR, self.roughness.as_ref()),
            (CLIPPED_DIR, self.clipped.as_ref()),
            (VALID_DIR, self.valid.as_ref()),
        ];
        let files = files.into_iter();
        files.filter_map(|(folder, file)| Some((folder, file?)))
    }
}

/// A frame that cannot be used.
#[derive(Debug)]
pub struct BadFrame {
    /// Its name.
    pub name: String,
    /// Why.
    pub error: SceneError,
}
