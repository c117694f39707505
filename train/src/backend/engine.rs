//! The seam between training on the host and what blends the rays.

use crate::error::Result;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Tracer;
use eagpt_trace::blend::{Contribution, LocalGradient, PixelValue};
use eagpt_trace::cpu::GradientMask;
use eagpt_trace::cpu::weights::BlendWeights;
use eagpt_trace::features::{Features, GBuffer};
use eagpt_trace::surfel::SurfelSet;

/// What blends the rays of cameras, and goes back from derivatives by their features to gradients.
pub trait Engine {
    /// What computes: recorded beside the result.
    fn device(&self) -> String;

    /// Takes note that Gaussians have changed.
    ///
    /// # Errors
    /// If the device gives up.
    fn update(&mut self, set: &SurfelSet) -> Result<()>;

    /// composited features of one ray through every pixel centre, to be followed by
    /// [`Self::adjoint`] or [`Self::weights`].
    ///
    /// # Errors
    /// If the device gives up.
    fn trace(&mut self, set: &SurfelSet, camera: &Camera) -> Result<GBuffer>;

    /// Gradients by all Gaussians; `d_features` = dL/dV for every pixel of `camera`, which was
    /// traced last.
    ///
    /// # Errors
    /// If the device gives up.
    fn adjoint(
        &mut self,
        set: &SurfelSet,
        camera: &Camera,
        d_features: &[Features],
        wanted: GradientMask,
    ) -> Result<Vec<LocalGradient>>;

    /// What each Gaussian contributes to the pixels of `camera`. A Gaussian may come more than
    /// once, with different pixels.
    ///
    /// # Errors
    /// If the device gives up.
    fn contributions(
        &mut self,
        set: &SurfelSet,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<Vec<Contribution>>;

    /// The weights of the blend in every pixel of the camera that was traced last, without those
    /// below `least`; `None` where it is better to trace again than to keep them.
    fn weights(&self, least: f32) -> Option<BlendWeights>;

    /// composited features alone.
    ///
    /// # Errors
    /// If the device gives up.
    fn gbuffer(&self, set: &SurfelSet, camera: &Camera) -> Result<GBuffer>;

    /// A scene where this computes, for rays that are not those of cameras.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    fn tracer(&self, gaussians: &Gaussians) -> Result<Box<dyn Tracer>>;
}
