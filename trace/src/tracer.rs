//! The interface of a scene on a compute device, the same for the CPU and GPUs.

use crate::blend::{Contribution, GradientMask, LocalGradient, PixelValue};
use crate::camera_rays::CameraRays;
use crate::device::Device;
use crate::error::TraceError;
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::transport::glossy::{GlossyPoint, Mirrored};
use crate::transport::matrix::{Directions, Receiver, TransportMatrix};
use crate::transport::{Integrator, LightOptions};
use crate::view::RenderedView;
use crate::weights::BlendWeights;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Gloss};
use glam::Vec3;

/// A scene of Gaussians on a device.
///
/// Gaussians go to the device with [`Tracer::update`] and stay there; calls transfer only what they
/// return. Every method fails with [`TraceError::Device`] if the device fails or has not enough
/// memory.
pub trait Tracer: Send + Sync {
    /// The device.
    fn device(&self) -> Device;

    /// Replaces the Gaussians, refitting acceleration structures where that is enough.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError>;

    /// Replaces the albedos alone, `[n]`: geometry and emitted light stay.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn set_albedos(&mut self, albedos: &[Vec3]) -> Result<(), TraceError>;

    /// Composited features of one ray through every pixel centre.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, TraceError>;

    /// Composited features of the pixels that `rays` make, with a record of the blended hits for
    /// [`Self::adjoint`] of the same rays and [`Self::weights`] of one ray for each pixel, which
    /// trace again without one.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn record(&mut self, rays: &CameraRays) -> Result<GBuffer, TraceError>;

    /// Gradient of a loss with respect to every Gaussian, given `d_features` = dL/dV for every
    /// pixel that `rays` make, row by row. Gaussians that no ray hits get zeros. The spread, size and
    /// first-hit lanes are not differentiated.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn adjoint(
        &mut self,
        rays: &CameraRays,
        d_features: &[Features],
        mask: GradientMask,
    ) -> Result<Vec<LocalGradient>, TraceError>;

    /// Blending weights in every pixel of `camera`, without those below `least`; `None` on devices
    /// that do not keep them in the host's memory.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn weights(&mut self, camera: &Camera, least: f32) -> Result<Option<BlendWeights>, TraceError>;

    /// As [`Self::gbuffer`], with the contribution of each Gaussian to it. A Gaussian may come more
    /// than once, with different pixels.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), TraceError>;

    /// Blended gloss of one ray through every pixel centre, `[height · width]`; empty where nothing is
    /// glossy.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn pixel_gloss(&self, camera: &Camera) -> Result<Vec<Gloss>, TraceError>;

    /// Composited features along each of `rays`.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Features>, TraceError>;

    /// Whether more than half of the light passes along each of `rays` up to its distance of
    /// `distances`, scene units, one for each: shadows and views at a fraction of the cost of
    /// [`Self::trace_rays`].
    ///
    /// # Errors
    /// See [`Tracer`].
    fn are_free(&self, rays: &[Ray], distances: &[f32]) -> Result<Vec<bool>, TraceError>;

    /// Renders `camera` with `integrator`.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError>;

    /// Rows of the light-transport matrix of `receivers`, traced in `directions`. Each receiver has
    /// random numbers of its own among those of `key`: results do not depend on which receivers are
    /// traced together.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn trace_transport(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<TransportMatrix, TraceError>;

    /// Of each of `points`, what its specular lobe mirrors of the radiance that Gaussians carry
    /// towards each of its eyes; `None` where something stands between. There are `num_samples`
    /// directions for each eye, all of them together for all eyes of a point.
    ///
    /// # Errors
    /// See [`Tracer`].
    fn mirrored_towards(
        &self,
        points: &[GlossyPoint],
        num_samples: u32,
        key: RandomKey,
    ) -> Result<Vec<Vec<Option<Mirrored>>>, TraceError>;
}
