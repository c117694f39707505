//! Buffers that depend on the size of the grid of rays, and the loop that grows them.

use super::adjoint::Adjoint;
use super::camera::CameraTracer;
use super::capacity::{Capacity, Incomplete};
use super::declarations::camera::Counters;
use super::device::Device;
use super::error::GpuError;
use super::scene_buffers::SceneBuffers;
use crate::blend::{Contribution, LocalGradient, PixelValue};
use crate::camera_rays::CameraRays;
use crate::features::{Features, GBuffer};
use eagpt_scene::Camera;
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Buffers for rays on a grid of the size last traced.
#[derive(Debug, Default)]
pub(super) struct Views {
    tracer: Option<CameraTracer>,
    adjoint: Option<Adjoint>,
    /// Capacities that grids of a size were found to need, as others will, by size.
    capacities: HashMap<(u32, u32), Capacity>,
}

impl Views {
    /// Those in `place`, which others may be using.
    pub(super) fn lock(place: &Mutex<Self>) -> MutexGuard<'_, Self> {
        // Whoever panicked left nothing half-done: results are written to buffers before they are
        // read.
        place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives all buffers back.
    pub(super) fn clear(&mut self) {
        (self.tracer, self.adjoint) = (None, None);
    }

    /// Clears the overflow flag.
    pub(super) fn restart(&self, device: &Device) {
        if let Some(tracer) = &self.tracer {
            tracer.bins.restart(device);
        }
    }

    /// The tracer for `rays`, made if there is none.
    fn tracer(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        rays: &CameraRays,
    ) -> Result<&CameraTracer, GpuError> {
        let fits = |tracer: &CameraTracer| tracer.bins.fits(rays, scene.num_surfels());
        if !self.tracer.as_ref().is_some_and(fits) {
            // The old one's memory goes first.
            self.clear();
            let size = rays.grid_size();
            let capacity = self.capacities.entry(size);
            let capacity = capacity.or_insert_with(|| Capacity::usual(size));
            self.tracer = Some(CameraTracer::new(device, scene, size, capacity.entries)?);
        }
        match &self.tracer {
            Some(tracer) => Ok(tracer),
            None => unreachable!("made above"),
        }
    }

    /// The tracer for `rays` and its adjoint, made if there are none.
    pub(super) fn both(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        rays: &CameraRays,
    ) -> Result<(&CameraTracer, &Adjoint), GpuError> {
        self.tracer(device, scene, rays)?;
        let size = rays.grid_size();
        if let (None, Some(tracer)) = (&self.adjoint, &self.tracer) {
            let capacity = self.capacities.entry(size);
            let capacity = capacity.or_insert_with(|| Capacity::usual(size));
            *capacity = capacity.within(device, size.0)?;
            self.adjoint = Some(Adjoint::new(device, scene, tracer, *capacity)?);
        }
        match (&self.tracer, &self.adjoint) {
            (Some(tracer), Some(adjoint)) => Ok((tracer, adjoint)),
            _ => unreachable!("both were made"),
        }
    }

    /// Grows the buffers for grids of the size of that of `rays`, if a frame that needs `needed`
    /// does not fit: they are made anew when next asked for. Returns whether they were too small.
    pub(super) fn grow(&mut self, rays: &CameraRays, needed: &Counters) -> bool {
        let size = rays.grid_size();
        let capacity = self.capacities.entry(size);
        let capacity = capacity.or_insert_with(|| Capacity::usual(size));
        if let Some(tracer) = &self.tracer {
            capacity.entries = capacity.entries.max(tracer.bins.capacity);
        }
        let grown = capacity.grown(needed);
        let is_larger = grown != *capacity;
        if is_larger {
            *capacity = grown;
            self.clear();
        }
        is_larger
    }

    /// Calls `record` until the buffers for `rays` hold all of it.
    fn retry<T>(
        &mut self,
        rays: &CameraRays,
        mut record: impl FnMut(&mut Self) -> Result<T, Incomplete>,
    ) -> Result<T, GpuError> {
        loop {
            match record(self) {
                Ok(done) => return Ok(done),
                Err(Incomplete::Failed(error)) => return Err(error),
                Err(Incomplete::Overflow(needed)) => self.grow(rays, &needed),
            };
        }
    }

    /// The tracer for `rays`, with its lists on the device.
    pub(super) fn binned(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        rays: &CameraRays,
    ) -> Result<&CameraTracer, GpuError> {
        self.retry(rays, |views| {
            views.tracer(device, scene, rays)?.bin(device, rays)
        })?;
        self.tracer(device, scene, rays)
    }

    /// Composited features of the pixels that `rays` make, read back.
    pub(super) fn features(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        rays: &CameraRays,
    ) -> Result<GBuffer, GpuError> {
        let (width, height) = rays.grid_size();
        let mut pixels = Vec::new();
        let tracer = self.binned(device, scene, rays)?;
        tracer.trace(device, |_, features| {
            pixels.extend(features);
            Ok(())
        })?;
        Ok(rays.means(GBuffer {
            width,
            height,
            pixels,
        }))
    }

    /// See [`crate::Tracer::adjoint`].
    pub(super) fn adjoint(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        rays: &CameraRays,
        d_features: &[Features],
    ) -> Result<Vec<LocalGradient>, GpuError> {
        self.retry(rays, |views| {
            let (tracer, adjoint) = views.both(device, scene, rays)?;
            adjoint.gradients(device, tracer, rays, d_features)
        })
    }

    /// See [`crate::Tracer::contributions`].
    pub(super) fn contributions(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), GpuError> {
        let rays = &CameraRays::from(*camera);
        let mut pixels = Vec::with_capacity(camera.num_pixels());
        let contributions = self.retry(rays, |views| {
            let (tracer, adjoint) = views.both(device, scene, rays)?;
            adjoint.contributions(device, tracer, rays, value, &mut pixels)
        })?;
        let features = GBuffer {
            width: camera.width,
            height: camera.height,
            pixels,
        };
        Ok((features, contributions))
    }
}
