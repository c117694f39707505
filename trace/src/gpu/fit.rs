//! Gaussians that change while they are looked at: what training on a device needs of the rays.
//!
//! Unlike [`super::GpuScene`], whose Gaussians come from the host, the buffers are open to kernels
//! of others: those read the features of a [`Frame`], write the derivatives by them, and move the
//! Gaussians along the gradients, without anything passing through the host.

use super::adjoint::TOTAL_CHUNKS;
use super::bins::TOTAL_ENTRIES;
use super::device::Device;
use super::error::GpuError;
use super::scene::SceneBuffers;
use super::views::Views;
use crate::blend::{Contribution, LocalGradient, PixelValue};
use crate::features::{Features, GBuffer};
use crate::surfel::SurfelSet;
use eagpt_scene::Camera;
use std::sync::{Arc, Mutex, MutexGuard};

/// Gaussians in training on a device.
#[derive(Debug)]
pub struct GpuFit {
    device: Arc<Device>,
    scene: SceneBuffers,
    views: Mutex<Views>,
}

/// Buffers of a camera's rays, until a camera of another size or one that needs more room comes.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// [`Features`] of every pixel, row by row: written by [`GpuFit::forward`].
    pub features: wgpu::Buffer,
    /// Derivatives of the loss by them: read by [`GpuFit::backward`].
    pub d_features: wgpu::Buffer,
    /// [`LocalGradient`], `[n]`: written by [`GpuFit::backward`].
    pub gradients: wgpu::Buffer,
    /// [`crate::surfel::Attributes`] as the camera sees them, `[n]`: written by
    /// [`GpuFit::forward`].
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

impl GpuFit {
    /// Brings Gaussians to `device`.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn new(device: &Arc<Device>, set: &SurfelSet) -> Result<Self, GpuError> {
        Ok(Self {
            device: Arc::clone(device),
            scene: SceneBuffers::new(device, set)?,
            views: Mutex::default(),
        })
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Replaces the Gaussians; where there are as many as before, in the same buffers.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn update(&mut self, set: &SurfelSet) -> Result<(), GpuError> {
        if self.scene.fit(set) {
            self.scene.write(&self.device, set);
            return Ok(());
        }
        // The old buffers' memory goes first.
        self.views().clear();
        self.scene = SceneBuffers::new(&self.device, set)?;
        Ok(())
    }

    /// [`crate::surfel::Surfel`], `[n]`.
    pub fn surfels(&self) -> &wgpu::Buffer {
        &self.scene.surfels
    }

    /// [`crate::surfel::Attributes`], `[n]`.
    pub fn attributes(&self) -> &wgpu::Buffer {
        &self.scene.attributes
    }

    /// Coefficients of [`eagpt_scene::Harmonics`], `[n, 24]`, where radiance differs with the
    /// direction.
    pub fn harmonics(&self) -> Option<&wgpu::Buffer> {
        self.scene.harmonics.as_ref()
    }

    /// Number of Gaussians.
    pub fn num_gaussians(&self) -> u32 {
        self.scene.num_surfels()
    }

    /// composited features of one ray through every pixel centre, read back.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, GpuError> {
        self.views().features(&self.device, &self.scene, camera)
    }

    /// Gradients by all Gaussians, read back; see [`super::GpuScene::camera_adjoint`].
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn camera_adjoint(
        &self,
        camera: &Camera,
        d_features: &[Features],
    ) -> Result<Vec<LocalGradient>, GpuError> {
        let mut views = self.views();
        views.adjoint(&self.device, &self.scene, camera, d_features)
    }

    /// composited features of one ray through every pixel centre, and what each Gaussian
    /// contributes to them, read back: the twin of [`crate::cpu::CameraRecord::contributions`], but
    /// for a Gaussian coming once.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), GpuError> {
        self.views()
            .contributions(&self.device, &self.scene, camera, value)
    }

    /// The buffers for cameras of the size of `camera`; `None` where one buffer does not hold all
    /// of its pixels.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn frame(&self, camera: &Camera) -> Result<Option<Frame>, GpuError> {
        let mut views = self.views();
        let (tracer, adjoint) = views.both(&self.device, &self.scene, camera)?;
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
        let (device, scene) = (&*self.device, &self.scene);
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
        let (tracer, adjoint) = views.both(&self.device, &self.scene, camera)?;
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
        let (_, adjoint) = views.both(&self.device, &self.scene, camera)?;
        match adjoint.whole() {
            Some(image) => image.backward(&self.device),
            None => Ok(()),
        }
    }

    fn views(&self) -> MutexGuard<'_, Views> {
        Views::lock(&self.views)
    }
}
