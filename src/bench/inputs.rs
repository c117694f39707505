//! Inputs of all stages.

use anyhow::Result;
use eagpt_scene::{Camera, Gaussians, View};
use eagpt_trace::{Device, Tracer};
use std::path::Path;
use std::sync::Arc;

/// Inputs of all stages.
pub(super) struct Bench<'a> {
    pub(super) device: &'a Device,
    /// Dataset that bakes take their cameras from.
    pub(super) cameras_at: &'a Path,
    pub(super) views: &'a [Arc<View>],
    pub(super) gaussians: &'a Gaussians,
    /// Half the diagonal of the scene's box, scene units.
    pub(super) extent: f32,
    /// Size of images for metrics and files, pixels.
    pub(super) image: [u32; 2],
    /// Samples for each pixel of path-traced frames.
    pub(super) num_samples: u32,
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

    pub(super) fn is_on_cpu(&self) -> bool {
        matches!(self.device, Device::Cpu)
    }

    /// The scene on the device.
    ///
    /// # Errors
    /// If the device gives up.
    pub(super) fn tracer(&self) -> Result<Box<dyn Tracer>> {
        Ok(self.device.scene(self.gaussians)?)
    }
}
