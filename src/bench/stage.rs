//! The stages: one table of everything that can be measured.

use super::sheet::Sheet;
use super::{images, learning, rays};
use anyhow::Result;
use clap::ValueEnum;
use eagpt_scene::{Camera, Gaussians, View};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// What a stage is measured on.
pub(super) struct Bench<'a> {
    /// Where the cameras of the dataset are.
    pub(super) cameras_at: &'a Path,
    pub(super) views: &'a [Arc<View>],
    pub(super) gaussians: &'a Gaussians,
    /// Half the diagonal of the scene's box, scene units.
    pub(super) extent: f32,
    /// Size of images for metrics and files, pixels.
    pub(super) image: [u32; 2],
    /// Folder for files.
    pub(super) work: &'a Path,
}

impl Bench<'_> {
    pub(super) fn cameras(&self) -> impl Iterator<Item = &Camera> {
        self.views.iter().map(|view| &view.camera)
    }

    /// Pixels of all views.
    pub(super) fn num_pixels(&self) -> usize {
        self.cameras().map(Camera::num_pixels).sum()
    }
}

/// A part of the program whose speed is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Stage {
    /// Building and refitting what rays are traced against
    Structure,
    /// Camera rays in tiles, forward, and with the adjoint
    CameraRays,
    /// The same rays, one at a time
    SingleRays,
    /// Rays from surfaces in all directions: all hits blended, and one hit
    BounceRays,
    /// Rays from surfaces towards emitters
    ShadowRays,
    /// Iterations of training's stage 0
    Training,
    /// Light gathered at Gaussians, as stage 1 does once
    Gathering,
    /// Multi-bounce path tracing
    Paths,
    /// A sweep of light baking
    LightSolve,
    /// Scene files
    Ply,
    /// FLIP, SSIM and PSNR of an image
    Metrics,
    /// Image files
    Exr,
    /// A bracket of RAW files merged
    Merging,
}

impl Stage {
    /// All of them.
    pub(super) const ALL: [Self; 13] = [
        Self::Structure,
        Self::CameraRays,
        Self::SingleRays,
        Self::BounceRays,
        Self::ShadowRays,
        Self::Training,
        Self::Gathering,
        Self::Paths,
        Self::LightSolve,
        Self::Ply,
        Self::Metrics,
        Self::Exr,
        Self::Merging,
    ];

    /// The name on the command line and in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Structure => "structure",
            Self::CameraRays => "camera-rays",
            Self::SingleRays => "single-rays",
            Self::BounceRays => "bounce-rays",
            Self::ShadowRays => "shadow-rays",
            Self::Training => "training",
            Self::Gathering => "gathering",
            Self::Paths => "paths",
            Self::LightSolve => "light-solve",
            Self::Ply => "ply",
            Self::Metrics => "metrics",
            Self::Exr => "exr",
            Self::Merging => "merging",
        }
    }

    /// Whether the scene has no part in it.
    pub(super) fn is_of_images(self) -> bool {
        matches!(self, Self::Metrics | Self::Exr | Self::Merging)
    }

    /// Whether it means nothing where nothing emits.
    pub(super) fn needs_emitters(self) -> bool {
        matches!(self, Self::ShadowRays | Self::LightSolve)
    }

    /// Measures it.
    ///
    /// # Errors
    /// Whatever the stage returns.
    pub(super) fn run(self, bench: &Bench<'_>, sheet: &mut Sheet<'_>) -> Result<()> {
        match self {
            Self::Structure => rays::structure(bench, sheet),
            Self::CameraRays => rays::camera_rays(bench, sheet),
            Self::SingleRays => rays::single_rays(bench, sheet),
            Self::BounceRays => rays::bounce_rays(bench, sheet),
            Self::ShadowRays => rays::shadow_rays(bench, sheet),
            Self::Training => learning::training(bench, sheet),
            Self::Gathering => learning::gathering(bench, sheet),
            Self::Paths => rays::paths(bench, sheet),
            Self::LightSolve => learning::light_solve(bench, sheet),
            Self::Ply => images::ply_files(bench, sheet),
            Self::Metrics => images::metrics(bench, sheet),
            Self::Exr => images::exr_files(bench, sheet),
            Self::Merging => images::merging(bench, sheet),
        }
    }
}
