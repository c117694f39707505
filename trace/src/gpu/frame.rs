//! The buffers of a camera's rays, for kernels of the caller: those read the features of a
//! [`Frame`], write the derivatives by them, and move the Gaussians of a [`GpuScene`] along the
//! gradients, without anything passing through the host.

use super::capacity::Capacity;
use super::declarations::camera::Counters;
use super::device::{Commands, Device};
use super::error::GpuError;
use super::scene::GpuScene;
use crate::camera_rays::CameraRays;
use std::sync::Arc;

/// Buffers of a camera's rays, until rays on a grid of another size come, or some for which they
/// have to grow.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// [`crate::Features`] of every place of the grid, row by row: written by [`GpuScene::forward`].
    pub features: wgpu::Buffer,
    /// Derivatives of the loss by them: read by [`GpuScene::backward`].
    pub d_features: wgpu::Buffer,
    /// [`crate::blend::LocalGradient`], `[n]`: written by [`GpuScene::backward`].
    pub gradients: wgpu::Buffer,
    /// [`crate::attributes::Attributes`] as the camera sees them, `[n]`: written by
    /// [`GpuScene::forward`].
    pub attributes: wgpu::Buffer,
    /// [`Counters`]: where more was needed than fits, the results are worth nothing.
    pub counters: wgpu::Buffer,
    /// Capacities of its buffers.
    pub capacity: Capacity,
}

impl GpuScene {
    /// The device, for kernels of the caller.
    pub fn gpu_device(&self) -> &Arc<Device> {
        &self.device
    }

    /// [`crate::surfel::Surfel`], `[n]`.
    pub fn surfels(&self) -> &wgpu::Buffer {
        &self.buffers.surfels
    }

    /// [`crate::attributes::Attributes`], `[n]`.
    pub fn attributes(&self) -> &wgpu::Buffer {
        &self.buffers.attributes
    }

    /// Coefficients of [`eagpt_scene::Harmonics`], `[n, 24]`, where radiance differs with the
    /// direction.
    pub fn harmonics(&self) -> Option<&wgpu::Buffer> {
        self.buffers.harmonics.as_ref()
    }

    /// Number of Gaussians.
    pub fn num_gaussians(&self) -> u32 {
        self.buffers.num_surfels()
    }

    /// The buffers for rays on a grid of the size of that of `rays`; `None` where one buffer does
    /// not hold all of it.
    ///
    /// # Errors
    /// If the device fails, or has not enough memory.
    pub fn frame(&self, rays: &CameraRays) -> Result<Option<Frame>, GpuError> {
        let mut views = self.views();
        let (tracer, adjoint) = views.both(&self.device, &self.buffers, rays)?;
        Ok(adjoint.whole().map(|image| Frame {
            features: tracer.features.clone(),
            d_features: image.d_features().clone(),
            gradients: image.gradients().clone(),
            attributes: tracer.bins.attributes.clone(),
            counters: tracer.bins.counters.clone(),
            capacity: image.capacity(),
        }))
    }

    /// Grows the buffers for grids of the size of that of `rays`, if a frame that needs `needed` does
    /// not fit. Returns whether they were too small.
    pub fn grow(&self, rays: &CameraRays, needed: &Counters) -> bool {
        self.views().grow(rays, needed)
    }

    /// Records that `rays` are traced into their [`Frame`]; nothing where they have none. Rays of one
    /// camera for each submission.
    ///
    /// # Errors
    /// If the device fails.
    pub fn forward(&self, rays: &CameraRays, commands: &mut Commands) -> Result<(), GpuError> {
        let mut views = self.views();
        let (tracer, adjoint) = views.both(&self.device, &self.buffers, rays)?;
        if let Some(image) = adjoint.whole() {
            image.forward(&self.device, tracer, rays, commands);
        }
        Ok(())
    }

    /// Records the way from the derivatives in the [`Frame`] of `rays`, which were traced last, to
    /// gradients.
    ///
    /// # Errors
    /// If the device fails.
    pub fn backward(&self, rays: &CameraRays, commands: &mut Commands) -> Result<(), GpuError> {
        let mut views = self.views();
        let (_, adjoint) = views.both(&self.device, &self.buffers, rays)?;
        if let Some(image) = adjoint.whole() {
            image.backward(&self.device, commands);
        }
        Ok(())
    }
}
