//! Buffers that depend on the size of cameras, with as much room as these need.

use super::adjoint::{Adjoint, Outcome, Room};
use super::bins::and_half_more;
use super::camera::{Binned, CameraTracer};
use super::device::Device;
use super::error::GpuError;
use super::scene::SceneBuffers;
use crate::blend::{Contribution, LocalGradient, PixelValue};
use crate::features::{Features, GBuffer};
use eagpt_scene::Camera;
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Buffers for cameras of the size last seen.
#[derive(Debug, Default)]
pub(super) struct Views {
    tracer: Option<CameraTracer>,
    adjoint: Option<Adjoint>,
    /// By size.
    found: HashMap<(u32, u32), Found>,
}

/// Room that cameras of a size were found to need, which others will need as well.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    /// Entries in the lists of tiles.
    entries: u32,
    record: Option<Room>,
}

impl Views {
    /// Those in `place`, which others may be using.
    pub(super) fn lock(place: &Mutex<Self>) -> MutexGuard<'_, Self> {
        // Whoever panicked left nothing half-done: results are written to buffers before they are
        // read.
        place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The tracer for `camera`, made if there is none.
    fn tracer(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
    ) -> Result<&CameraTracer, GpuError> {
        let fits = |tracer: &CameraTracer| tracer.bins.fits(camera, scene.num_surfels());
        if !self.tracer.as_ref().is_some_and(fits) {
            let size = (camera.width, camera.height);
            return self.make_tracer(device, scene, size, 0);
        }
        match &self.tracer {
            Some(tracer) => Ok(tracer),
            None => unreachable!("it fits"),
        }
    }

    /// Gives all buffers back.
    pub(super) fn clear(&mut self) {
        (self.tracer, self.adjoint) = (None, None);
    }

    /// Another tracer in place of the one there is, for lists with `num_entries` or more.
    pub(super) fn make_tracer(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        size: (u32, u32),
        num_entries: u32,
    ) -> Result<&CameraTracer, GpuError> {
        // The old one's memory goes first.
        self.clear();
        let found = self.found.entry(size).or_default();
        found.entries = found.entries.max(and_half_more(num_entries));
        let tracer = CameraTracer::new(device, scene, size, found.entries)?;
        Ok(self.tracer.insert(tracer))
    }

    /// The tracer for `camera`, with its lists on the device.
    pub(super) fn binned(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
    ) -> Result<&CameraTracer, GpuError> {
        let size = (camera.width, camera.height);
        while let Binned::MoreEntries(needed) =
            self.tracer(device, scene, camera)?.bin(device, camera)?
        {
            self.make_tracer(device, scene, size, needed)?;
        }
        self.tracer(device, scene, camera)
    }

    /// composited features of one ray through every pixel centre, read back.
    pub(super) fn features(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
    ) -> Result<GBuffer, GpuError> {
        let mut pixels = Vec::with_capacity(camera.num_pixels());
        let tracer = self.binned(device, scene, camera)?;
        tracer.trace(device, |_, features| {
            pixels.extend(features);
            Ok(())
        })?;
        Ok(GBuffer {
            width: camera.width,
            height: camera.height,
            pixels,
        })
    }

    /// See [`crate::Tracer::adjoint`].
    pub(super) fn adjoint(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
        d_features: &[Features],
    ) -> Result<Vec<LocalGradient>, GpuError> {
        self.with_room(device, scene, camera, |tracer, adjoint| {
            adjoint.gradients(device, tracer, camera, d_features)
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
        let mut pixels = Vec::with_capacity(camera.num_pixels());
        let contributions = self.with_room(device, scene, camera, |tracer, adjoint| {
            adjoint.contributions(device, tracer, camera, value, &mut pixels)
        })?;
        let features = GBuffer {
            width: camera.width,
            height: camera.height,
            pixels,
        };
        Ok((features, contributions))
    }

    /// What `run` makes of `camera` once there is room for it.
    fn with_room<T>(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
        mut run: impl FnMut(&CameraTracer, &Adjoint) -> Result<Outcome<T>, GpuError>,
    ) -> Result<T, GpuError> {
        let size = (camera.width, camera.height);
        loop {
            let (tracer, adjoint) = self.both(device, scene, camera)?;
            match run(tracer, adjoint)? {
                Outcome::Done(out) => return Ok(out),
                Outcome::MoreEntries(needed) => {
                    self.make_tracer(device, scene, size, needed)?;
                }
                Outcome::MoreRoom(room) => self.make_adjoint(device, scene, room)?,
            }
        }
    }

    /// The tracer for `camera` and its adjoint, made if there are none.
    pub(super) fn both(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
    ) -> Result<(&CameraTracer, &Adjoint), GpuError> {
        self.tracer(device, scene, camera)?;
        if self.adjoint.is_none() {
            let size = (camera.width, camera.height);
            let room = match self.found.get(&size).and_then(|found| found.record) {
                Some(room) => room,
                None => Room::usual(device, size)?,
            };
            self.make_adjoint(device, scene, room)?;
        }
        match (&self.tracer, &self.adjoint) {
            (Some(tracer), Some(adjoint)) => Ok((tracer, adjoint)),
            _ => unreachable!("both were made"),
        }
    }

    /// Another adjoint in place of the one there is.
    pub(super) fn make_adjoint(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        room: Room,
    ) -> Result<(), GpuError> {
        self.adjoint = None;
        if let Some(tracer) = &self.tracer {
            self.found.entry(tracer.bins.size()).or_default().record = Some(room);
            self.adjoint = Some(Adjoint::new(device, scene, tracer, room)?);
        }
        Ok(())
    }
}
