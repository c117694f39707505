//! Gaussians on a device, behind [`Tracer`].

use super::adjoint::{Adjoint, Outcome, Room};
use super::camera::{Binned, CameraTracer};
use super::device::Device;
use super::error::GpuError;
use crate::blend::LocalGradient;
use crate::engine::{RenderedView, TraceError, Tracer};
use crate::sums::{SumImage, Sums};
use crate::surfel::{Payload, Surfel, SurfelSet};
use crate::transport::{Integrator, LightOptions};
use eagpt_scene::{Camera, Gaussians};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Prepared Gaussians in the memory of a device.
#[derive(Debug)]
pub(super) struct SceneBuffers {
    /// [`Surfel`], `[n]`.
    pub(super) surfels: wgpu::Buffer,
    /// [`Payload`], `[n]`.
    pub(super) payloads: wgpu::Buffer,
    num_surfels: u32,
}

fn lanes(set: &SurfelSet) -> Vec<[f32; 16]> {
    const { assert!(size_of::<Payload>() == size_of::<[f32; 16]>()) };
    set.payloads.iter().map(|payload| payload.0).collect()
}

impl SceneBuffers {
    pub(super) fn new(device: &Device, set: &SurfelSet) -> Result<Self, GpuError> {
        let limit = device.tier().max_bytes();
        let num_surfels = u32::try_from(set.len()).map_err(|_| GpuError::Limit {
            device: device.adapter().name.clone(),
            what: "Gaussians".to_owned(),
            needed: (set.len() * size_of::<Surfel>()) as u64,
            limit,
        })?;
        Ok(Self {
            surfels: device.upload("Gaussians", bytemuck::cast_slice(&set.surfels))?,
            payloads: device.upload("payloads", bytemuck::cast_slice(&lanes(set)))?,
            num_surfels,
        })
    }

    /// Replaces the Gaussians by as many others.
    pub(super) fn write(&self, device: &Device, set: &SurfelSet) {
        device.write(&self.surfels, bytemuck::cast_slice(&set.surfels));
        device.write(&self.payloads, bytemuck::cast_slice(&lanes(set)));
    }

    /// Number of Gaussians.
    pub(super) fn num_surfels(&self) -> u32 {
        self.num_surfels
    }
}

/// Gaussians on a device.
#[derive(Debug)]
pub struct GpuScene {
    device: Arc<Device>,
    buffers: SceneBuffers,
    /// For cameras of the size last seen.
    views: Mutex<Views>,
}

/// What depends on the size of cameras.
#[derive(Debug, Default)]
pub(super) struct Views {
    tracer: Option<CameraTracer>,
    adjoint: Option<Adjoint>,
}

impl Views {
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
            return self.make_tracer(device, scene, size, None);
        }
        match &self.tracer {
            Some(tracer) => Ok(tracer),
            None => unreachable!("it fits"),
        }
    }

    /// Another tracer in place of the one there is.
    pub(super) fn make_tracer(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        size: (u32, u32),
        num_entries: Option<u32>,
    ) -> Result<&CameraTracer, GpuError> {
        // The old one's memory goes first.
        *self = Self::default();
        // Half more than is needed now: the next view needs another number.
        let capacity = num_entries.map(|needed| needed.saturating_add(needed / 2));
        let tracer = CameraTracer::new(device, scene, size, capacity)?;
        Ok(self.tracer.insert(tracer))
    }

    /// Blended sums of one ray through every pixel centre, read back.
    pub(super) fn sums(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
    ) -> Result<SumImage, GpuError> {
        let size = (camera.width, camera.height);
        let mut tracer = self.tracer(device, scene, camera)?;
        while let Binned::MoreEntries(needed) = tracer.bin(device, camera)? {
            tracer = self.make_tracer(device, scene, size, Some(needed))?;
        }
        let mut pixels = Vec::with_capacity(camera.num_pixels());
        tracer.trace(device, |_, sums| {
            pixels.extend(sums);
            Ok(())
        })?;
        Ok(SumImage {
            width: camera.width,
            height: camera.height,
            pixels,
        })
    }

    /// See [`GpuScene::camera_adjoint`].
    pub(super) fn adjoint(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
        d_sums: &[Sums],
    ) -> Result<Vec<LocalGradient>, GpuError> {
        assert_eq!(d_sums.len(), camera.num_pixels(), "one for each pixel");
        let size = (camera.width, camera.height);
        self.tracer(device, scene, camera)?;
        loop {
            let (tracer, adjoint) = self.both(device, scene, camera)?;
            match adjoint.run(device, &tracer.bins, camera, d_sums)? {
                Outcome::Gradients(gradients) => return Ok(gradients),
                Outcome::MoreEntries(needed) => {
                    self.make_tracer(device, scene, size, Some(needed))?;
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
            let room = Room::usual(device, (camera.width, camera.height))?;
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
            self.adjoint = Some(Adjoint::new(device, scene, tracer, room)?);
        }
        Ok(())
    }
}

impl GpuScene {
    /// Brings a scene to `device`.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn new(device: &Arc<Device>, gaussians: &Gaussians) -> Result<Self, GpuError> {
        let buffers = SceneBuffers::new(device, &SurfelSet::new(gaussians))?;
        Ok(Self {
            device: Arc::clone(device),
            buffers,
            views: Mutex::default(),
        })
    }

    /// Gradient of the loss with respect to every Gaussian, given `d_sums` = dL/dV for every pixel of `camera`, row by row: that of
    /// [`crate::cpu::camera::CameraRecord::adjoint`].
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    ///
    /// # Panics
    /// If `d_sums` are not as many as the camera has pixels.
    pub fn camera_adjoint(
        &self,
        camera: &Camera,
        d_sums: &[Sums],
    ) -> Result<Vec<LocalGradient>, GpuError> {
        self.views()
            .adjoint(&self.device, &self.buffers, camera, d_sums)
    }

    fn views(&self) -> MutexGuard<'_, Views> {
        // Whoever panicked left nothing half-done: results are written to buffers before they are read.
        self.views.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Tracer for GpuScene {
    fn device(&self) -> String {
        format!("gpu: {}", self.device.adapter().name)
    }

    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
        *self = Self::new(&self.device, gaussians)?;
        Ok(())
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage, TraceError> {
        Ok(self.views().sums(&self.device, &self.buffers, camera)?)
    }

    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        _options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        if *integrator != Integrator::ZeroBounce {
            let problem = "renders 0-bounce so far; light is sampled on the CPU (--device cpu)";
            return Err(TraceError::Device {
                device: self.device(),
                problem: problem.to_owned(),
            });
        }
        let sums = self.camera_sums(camera)?;
        Ok(RenderedView {
            radiance: sums.radiance(),
            second_moment: sums.extract(|_| [0.0]),
            sums,
            num_rays: 0,
        })
    }
}
