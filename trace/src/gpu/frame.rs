//! The buffers of a camera's rays, for kernels of the caller: those read the features of a
//! [`Frame`], write the derivatives by them, and move the Gaussians of a [`GpuScene`] along the
//! gradients, without anything passing through the host.

use super::adjoint::TOTAL_CHUNKS;
use super::bins::TOTAL_ENTRIES;
use super::device::Device;
use super::error::GpuError;
use super::scene::GpuScene;
use eagpt_scene::Camera;
use std::sync::Arc;

/// Buffers of a camera's rays, until a camera of another size or one that needs more room comes.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// [`Features`] of every pixel, row by row: written by [`GpuScene::forward`].
    pub features: wgpu::Buffer,
    /// Derivatives of the loss by them: read by [`GpuScene::backward`].
    pub d_features: wgpu::Buffer,
    /// [`LocalGradient`], `[n]`: written by [`GpuScene::backward`].
    pub gradients: wgpu::Buffer,
    /// [`crate::surfel::Attributes`] as the camera sees them, `[n]`: written by
    /// [`GpuScene::forward`].
    pub attributes: wgpu::Buffer,
    /// Numbers of what the rays needed room for, at [`Frame::ENTRIES`] and [`Frame::CHUNKS`].
    pub totals: wgpu::Buffer,
    /// Where there was less room than needed, what was traced is worth nothing.
    pub room: FrameRoom,
}

/// Room for the rays of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRoom {
    /// Entries in the lists of tiles.
    pub entries: u32,
    /// Chunks of the record of hits.
    pub chunks: u32,
}

impl FrameRoom {
    /// Whether there is no more of anything than in `room`.
    pub fn is_within(&self, room: &Self) -> bool {
        self.entries <= room.entries && self.chunks <= room.chunks
    }
}

impl Frame {
    /// Place of the number of entries in the totals.
    pub const ENTRIES: u32 = TOTAL_ENTRIES;
    /// Place of the number of chunks in the totals.
    pub const CHUNKS: u32 = TOTAL_CHUNKS;
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

    /// [`crate::surfel::Attributes`], `[n]`.
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

    /// The buffers for cameras of the size of `camera`; `None` where one buffer does not hold all
    /// of its pixels.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn frame(&self, camera: &Camera) -> Result<Option<Frame>, GpuError> {
        let mut views = self.views();
        let (tracer, adjoint) = views.both(&self.device, &self.buffers, camera)?;
        Ok(adjoint.whole().map(|image| Frame {
            features: tracer.features.clone(),
            d_features: image.d_features().clone(),
            gradients: image.gradients().clone(),
            attributes: tracer.bins.attributes.clone(),
            totals: tracer.bins.totals.clone(),
            room: FrameRoom {
                entries: tracer.bins.capacity,
                chunks: image.num_chunks(),
            },
        }))
    }

    /// Makes more room for cameras of this size where `needed`, from the totals of a frame, is more
    /// than there is. Returns whether it was.
    ///
    /// # Errors
    /// If the device has not enough memory.
    pub fn make_room(&self, camera: &Camera, needed: FrameRoom) -> Result<bool, GpuError> {
        let (device, scene) = (&*self.device, &self.buffers);
        let mut views = self.views();
        let (tracer, adjoint) = views.both(device, scene, camera)?;
        // Lists that are incomplete say nothing about the hits on them.
        if needed.entries > tracer.bins.capacity {
            let size = (camera.width, camera.height);
            views.make_tracer(device, scene, size, needed.entries)?;
            return Ok(true);
        }
        let Some(image) = adjoint.whole() else {
            return Ok(false);
        };
        if needed.chunks > image.num_chunks() {
            let room = adjoint.more_room(device, needed.chunks)?;
            views.make_adjoint(device, scene, room)?;
            return Ok(true);
        }
        Ok(false)
    }

    /// Traces `camera` into its [`Frame`], without waiting. Nothing happens where it has none.
    ///
    /// # Errors
    /// If the device gives up.
    pub fn forward(&self, camera: &Camera) -> Result<(), GpuError> {
        let mut views = self.views();
        let (tracer, adjoint) = views.both(&self.device, &self.buffers, camera)?;
        match adjoint.whole() {
            Some(image) => image.forward(&self.device, tracer, camera),
            None => Ok(()),
        }
    }

    /// From the derivatives in the [`Frame`] of `camera`, which was traced last, to gradients,
    /// without waiting.
    ///
    /// # Errors
    /// If the device gives up.
    pub fn backward(&self, camera: &Camera) -> Result<(), GpuError> {
        let mut views = self.views();
        let (_, adjoint) = views.both(&self.device, &self.buffers, camera)?;
        match adjoint.whole() {
            Some(image) => image.backward(&self.device),
            None => Ok(()),
        }
    }
}
