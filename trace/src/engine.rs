//! The seam between ray tracing engines and everything above them.

use crate::blend::{Contribution, PixelValue};
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::transport::matrix::{Directions, Receiver, TransportMatrix};
use crate::transport::{Integrator, LightOptions};
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Image};

/// Why an engine could not do its work. The CPU engine never fails.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// A device is lost, out of memory or lacks a feature.
    #[error("device {device}: {problem}")]
    Device {
        /// Name of the device.
        device: String,
        /// What happened.
        problem: String,
    },
}

/// A rendered frame: the light, and the composited features of the camera rays it started from.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedView {
    /// Linear radiance, premultiplied by the opacity.
    pub radiance: Image<3>,
    /// Mean over the samples of the squared luminance of the light before the albedo; 0 where no
    /// light is sampled.
    pub second_moment: Image<1>,
    /// composited features of the camera rays.
    pub features: GBuffer,
    /// Rays traced beside those of the camera.
    pub num_rays: u64,
}

impl RenderedView {
    /// Means over squares of `factor` × `factor` pixels, of which the view has a whole number.
    pub fn averaged(&self, factor: u32) -> Self {
        Self {
            radiance: self.radiance.averaged(factor),
            second_moment: self.second_moment.averaged(factor),
            features: self.features.averaged(factor),
            num_rays: self.num_rays,
        }
    }
}

/// A scene that lives on a device and can be looked at.
///
/// Gaussians go to the device with [`Tracer::update`] and stay there; calls move only what they
/// return. Everything above this trait is the same for every engine.
pub trait Tracer: Send + Sync {
    /// What computes: recorded beside every result.
    fn device(&self) -> String;

    /// Replaces the Gaussians, refitting where that is enough.
    ///
    /// # Errors
    /// [`TraceError::Device`] if the device gives up.
    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError>;

    /// composited features of one ray through every pixel centre.
    ///
    /// # Errors
    /// [`TraceError::Device`] if the device gives up.
    fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, TraceError>;

    /// The same, and what each Gaussian contributes to it. A Gaussian may come more than once, with
    /// different pixels.
    ///
    /// # Errors
    /// [`TraceError::Device`] if the device gives up.
    fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), TraceError>;

    /// composited features along each of `rays`.
    ///
    /// # Errors
    /// [`TraceError::Device`] if the device gives up.
    fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Features>, TraceError>;

    /// Renders `camera` with `integrator`.
    ///
    /// # Errors
    /// [`TraceError::Device`] if the device gives up.
    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError>;

    /// Rows of the light-transport matrix of `receivers`, traced in `directions`; each has random
    /// numbers of its own among those of `key`. Which receivers are traced together makes no
    /// difference.
    ///
    /// # Errors
    /// [`TraceError::Device`] if the device gives up.
    fn trace_transport(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<TransportMatrix, TraceError>;
}
