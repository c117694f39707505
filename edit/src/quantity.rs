//! Values of a Gaussian that selectors ask for.

use eagpt_scene::Gaussians;
use eagpt_scene::color::luminance;

/// A value of a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// Emission score, 0 to 1.
    Emission,
    /// Peak opacity, 0 to 1.
    Opacity,
    /// Luminance of the radiance, linear.
    Radiance,
    /// Luminance of the albedo, 0 to 1.
    Albedo,
    /// Geometric mean of the two standard deviations, scene units.
    Size,
}

impl Quantity {
    pub(crate) fn of(self, gaussians: &Gaussians, index: usize) -> f32 {
        match self {
            Self::Emission => gaussians.emissions[index],
            Self::Opacity => gaussians.opacities[index],
            Self::Radiance => luminance(gaussians.radiances[index].to_array()),
            Self::Albedo => luminance(gaussians.albedos[index].to_array()),
            Self::Size => gaussians.size_of(index),
        }
    }
}
