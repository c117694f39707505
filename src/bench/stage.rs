//! The stages: the one list of everything that can be measured.

use super::inputs::Bench;
use super::sheet::Sheet;
use super::{images, learning, rays};
use anyhow::Result;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// A part of the program whose speed is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Stage {
    /// The scene on the device: building what rays are traced against, and refitting it
    Structure,
    /// Camera rays of whole images: forward, adjoint, and contributions of Gaussians
    CameraRays,
    /// The same rays, one at a time (CPU)
    SingleRays,
    /// Rays from surfaces in all directions: all hits blended, and one hit
    BounceRays,
    /// Rays from surfaces towards emitters (CPU)
    ShadowRays,
    /// Entries of the light-transport matrix
    Transport,
    /// Iterations of training: stage 0 without and with harmonics, and stage 1
    Training,
    /// Irradiance gathered at Gaussians, as stage 1 does once
    Gathering,
    /// Path-traced frames
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
    /// All of them, in the order of the list.
    pub(super) fn all() -> &'static [Self] {
        Self::value_variants()
    }

    /// The name on the command line and in files.
    pub(super) fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// True for stages without a scene.
    pub(super) fn is_of_images(self) -> bool {
        matches!(self, Self::Metrics | Self::Exr | Self::Merging)
    }

    /// True for stages that mean nothing where nothing emits.
    pub(super) fn needs_emitters(self) -> bool {
        matches!(self, Self::ShadowRays | Self::LightSolve)
    }

    /// True for stages of the CPU alone.
    pub(super) fn needs_cpu(self) -> bool {
        matches!(self, Self::SingleRays | Self::ShadowRays)
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
            Self::Transport => rays::transport(bench, sheet),
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
